#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What tables.py refuses in documents and figures, and what fetch_real.py gets from a repository.

    tables_test.py BIN        the folder of the programs
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

import fetch_real
import tables

BIN = pathlib.Path(sys.argv.pop(1)).resolve()
CARD = "descriptor/model/README.md"


class Refusals(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        for name in (*tables.DOCUMENTS, tables.FIGURES, "descriptor/model/deal.safetensors", "descriptor/model/deal-small.safetensors"):
            (self.root / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(tables.ROOT / name, self.root / name)

    def problems(self):
        return "\n".join(tables.problems(self.root, dict(os.environ, PATH=f"{BIN}:{os.environ['PATH']}")))

    def replace(self, name, old, new):
        text = (self.root / name).read_text(encoding="utf-8")
        self.assertIn(old, text)
        (self.root / name).write_text(text.replace(old, new, 1), encoding="utf-8")

    def test_what_is_shipped_is_right(self):
        self.assertEqual(self.problems(), "")

    def test_a_row_that_the_figures_lack(self):
        self.replace(CARD, "| sift |", "| SIFT |")
        self.assertIn(f"{CARD}: a table differs", self.problems())

    def test_rows_of_older_weights(self):
        with (self.root / "descriptor/model/deal.safetensors").open("ab") as file:
            file.write(b" ")
        found = self.problems()
        for table in ("matching", "real", "objects", "guide-retrieval"):
            self.assertIn(f"{table}: the row of deal is of the weights deal:", found)
        self.assertNotIn("the row of deal-small", found)
        self.assertIn("index/evaluation/README.md: deal:", found)

    def test_a_command_with_an_option_that_does_not_exist(self):
        self.replace(tables.FIGURES, "--keypoints 1000", "--key-points 1000")
        self.assertIn("--key-points is no option", self.problems())

    def test_tables_without_figures_and_figures_without_a_table(self):
        self.replace(CARD, "<!-- table: sweeps -->", "<!-- table: swept -->")
        found = self.problems()
        self.assertIn("without figures or without an end: swept", found)
        self.assertIn("no document has the table sweeps", found)

    def test_a_guide_that_lacks_the_command_of_its_table(self):
        self.replace("descriptor/RESEARCH_GUIDE.md", "--keypoints 300", "--keypoints 301")
        self.assertIn("the page lacks the command of guide-matching", self.problems())


class Fetching(unittest.TestCase):
    def test_files_are_found_by_their_contents(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            photos = folder / "source/some where/ü"
            photos.mkdir(parents=True)
            (photos / "a photo.jpg").write_bytes(b"photo\r\n\0")
            (photos / "other.jpg").write_bytes(b"never asked for")

            def git(*arguments):
                done = subprocess.run(["git", "-C", folder / "source", "-c", "user.name=x", "-c", "user.email=x", *arguments], check=True,
                                      stdout=subprocess.PIPE, text=True)
                return done.stdout.strip()

            git("init", "--quiet")
            git("config", "uploadpack.allowFilter", "true")
            git("add", ".")
            git("commit", "--quiet", "--message", "x")
            known = git("hash-object", "--no-filters", str(photos / "a photo.jpg"))[:fetch_real.DIGITS]
            source = {"repository": (folder / "source").as_uri(), "files": {"query": {"1.jpg": known, "2.jpg": "0" * fetch_real.DIGITS}}}
            self.assertEqual(fetch_real.fetch("set", source, folder / "out"), ["query/2.jpg"])
            self.assertEqual([path.name for path in (folder / "out").rglob("*.*")], ["1.jpg"])
            self.assertEqual((folder / "out/set/query/1.jpg").read_bytes(), b"photo\r\n\0")


if __name__ == "__main__":
    unittest.main()
