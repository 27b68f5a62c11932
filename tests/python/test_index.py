#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""An index through its whole life, and against the command line on the same file."""
import os
import subprocess
import unittest

import numpy as np

import pliant
from support import BIN, FolderCase, other_view, pattern, png, run


class IndexCase(FolderCase):
    def open(self, **options):
        index = pliant.Index(self.folder / "x.db", descriptor="rootsift", **options)
        self.addCleanup(index.close)
        return index

    def filled(self, count=6):
        index = self.open()
        for seed in range(count):
            index.add(pattern(seed), object=f"o{seed}", id=f"p{seed}", metadata={"seed": seed, "odd": seed % 2 == 1})
        index.train(words=60)
        return index


class Life(IndexCase):
    def test_closer_look(self):
        with self.filled(12) as index:
            for closer_look in (True, False):
                absent = index.search(pattern(50), closer_look=closer_look)
                self.assertEqual((absent.verdict, absent.document["looked_closer"]), ("not_found", closer_look))

    def test_round_trip(self):
        with self.open() as index:
            self.assertEqual((len(index), list(index), index.vocabularies()), (0, [], []))
            with self.fails(pliant.ConflictError, "no_vocabulary", "has no vocabulary yet: add images, then call train()"):
                index.search(pattern(0))
            with self.fails(pliant.ConflictError, "no_images"):
                index.train()
            path = self.write("shelf/mug.png", pattern(0))
            added = index.add(path, object="mug", metadata={"shop": "café", "year": 2024})
            self.assertEqual((added.outcome, added.object, added.width, added.height), ("created", "mug", 160, 120))
            self.assertEqual(added.source, str(path))
            self.assertEqual(index.add(path, object="mug", metadata={"year": 2024, "shop": "café"}).outcome, "unchanged")
            with self.fails(pliant.ConflictError, "same_bytes"):
                index.add(path, object="cup")
            index.add(pattern(1), object="cup", id="cup-1")
            self.assertEqual(index.add(pattern(2), object="cup", id="cup-1").outcome, "replaced")
            heard = []
            vocabulary = index.train(words=50, progress=heard.append)
            self.assertEqual((vocabulary.words, vocabulary.active), (50, True))
            self.assertEqual(heard, sorted(heard))
            self.assertGreater(len(heard), 1)
            self.assertEqual(index.vocabularies(), [vocabulary])
            index.use(vocabulary.id)

            hits = index.search(other_view(0))
            self.assertIsInstance(hits, list)
            self.assertEqual((hits[0].object, hits[0].image_id, hits[0].rank), ("mug", added.id, 1))
            self.assertEqual(hits[0].metadata, {"shop": "café", "year": 2024})
            self.assertGreater(hits[0].inliers, 10)
            self.assertEqual(hits[0].polygon.shape[1], 2)
            self.assertEqual((hits.verdict, hits.found, hits.total), ("found", 1, 2))
            self.assertIsNone(index.search(pattern(7), verify="none").verdict)

            self.assertEqual(len(index), 2)
            self.assertEqual([p.id for p in index], sorted(["cup-1", added.id]))
            self.assertEqual([p.id for p in index.images(object="cup")], ["cup-1"])
            self.assertEqual(list(index.objects()), [("cup", 1), ("mug", 1)])
            self.assertIn("cup-1", index)
            self.assertNotIn("cup-2", index)
            self.assertEqual(index.content(added.id), path.read_bytes())
            self.assertEqual(index.content("cup-1"), png(pattern(2)))
            features = index.features(added.id)
            self.assertEqual(len(features), added.keypoints)
            self.assertEqual(index.check(), [])
            index.backup(self.folder / "copy.db")
            self.assertTrue(index.remove(added.id))
            self.assertFalse(index.remove(added.id))
            self.assertNotIn("mug", [hit.object for hit in index.search(other_view(0))])
            self.assertEqual(index.remove_object("cup"), 1)
            self.assertEqual(len(index), 0)
        with self.fails(ValueError, "closed"):
            len(index)
        index.close()
        with pliant.Index(self.folder / "copy.db", read_only=True) as copy:
            self.assertEqual(copy.search(other_view(0))[0].object, "mug")
            with self.fails(pliant.Error):
                copy.add(pattern(5))

    def test_names_and_metadata_change(self):
        index = self.filled(3)
        absent = index.search(pattern(7, 640, 480), min_score=1)
        self.assertEqual((absent.verdict, absent.found), ("not_found", 0))
        index.update("p0", object="mug é", metadata={"odd": None, "shelf": 5})
        self.assertEqual((index.get("p0").object, index.get("p0").metadata), ("mug é", {"seed": 0, "shelf": 5}))
        changed = index.update("p0", object="", source="mug.png")
        self.assertEqual((changed, changed.object, changed.source), (index.get("p0"), "", "mug.png"))
        self.assertEqual(index.rename_object("o1", "cup"), 1)
        self.assertEqual(index.search(other_view(1))[0].object, "cup")
        with self.fails(pliant.ConflictError, "object_exists"):
            index.rename_object("o2", "cup")
        self.assertEqual(index.rename_object("o2", "cup", merge=True), 2)
        self.assertEqual(list(index.objects()), [("cup", 2)])
        for work, kind, code in ((lambda: index.update("none", object="x"), pliant.NotFoundError, "image_not_found"),
                                 (lambda: index.rename_object("none", "x"), pliant.NotFoundError, "object_not_found"),
                                 (lambda: index.rename_object("cup", ""), ValueError, None),
                                 (lambda: index.update("p0"), TypeError, None),
                                 (lambda: index.update("p0", object=5), TypeError, None),
                                 (lambda: index.update("p0", metadata=[1]), TypeError, None)):
            with self.fails(kind, code):
                work()

    def test_collections(self):
        with self.open() as index, self.open(collection="shelf") as shelf:
            shelf.add(pattern(1))
            self.assertEqual((len(index), len(shelf)), (0, 1))
        with self.fails(pliant.NotFoundError, "collection_not_found"):
            self.open(collection="nowhere", create=False)

    def test_many_pages(self):
        """More objects than a page has, so that the second page is asked for."""
        from pliant import index as module
        before = module._PAGE
        module._PAGE = 2
        self.addCleanup(setattr, module, "_PAGE", before)
        index = self.filled(5)
        self.assertEqual([p.id for p in index], [f"p{i}" for i in range(5)])
        self.assertEqual(dict(index.objects()), {f"o{i}": 1 for i in range(5)})

    def test_add_folder(self):
        for seed in range(3):
            self.write(f"shop/o{seed}/a.png", pattern(seed))
        (self.folder / "shop" / "o0" / "broken.png").write_bytes(b"no image")
        index = self.open()
        heard = []
        report = index.add_folder(self.folder / "shop", progress=lambda done, total: heard.append((done, total)))
        self.assertEqual((report.indexed, report.unchanged), (3, 0))
        self.assertEqual([code for _, code, _ in report.skipped], ["image_type_unknown"])
        self.assertEqual(heard[-1], (4, 4))
        self.assertEqual(index.add_folder(self.folder / "shop").unchanged, 3)
        self.assertEqual([name for name, _ in index.objects()], ["o0", "o1", "o2"])
        with self.fails(pliant.NotFoundError):
            index.add_folder(self.folder / "nowhere")
        with self.fails(ValueError, "object_from_invalid"):
            index.add_folder(self.folder, object_from="colour")

    def test_file_name_that_is_no_text(self):
        path = os.fsdecode(os.fsencode(self.folder) + b"/\xff.db")
        with pliant.Index(path, descriptor="rootsift") as index:
            source = os.fsencode(self.folder) + b"/\xfe.png"
            with open(source, "wb") as file:
                file.write(png(pattern(1)))
            self.assertIn("\\xfe.png", index.add(os.fsdecode(source)).source)
        self.assertTrue(os.path.exists(path))


class Searches(IndexCase):
    def test_same_as_command_line(self):
        index = self.filled()
        query = self.write("q.png", other_view(3))
        for options, flags in (({}, []), ({"rank": "histogram", "group_by": "image"}, ["--rank", "histogram", "--group-by", "image"]),
                               ({"region": (20, 20, 100, 80)}, ["--region", "20,20,100,80"]), ({"top": 2}, ["--top", "2"])):
            ours = index.search(query, **options).document
            theirs = run("query", query, "--db", self.folder / "x.db", "--json", *flags)
            for document in (ours, theirs):
                document.pop("took_ms")
                document.pop("timings")
            self.assertEqual(ours, theirs)
        self.assertEqual(index.search(query)[0].object, "o3")

    def test_options(self):
        index = self.filled()
        view = other_view(3)
        self.assertEqual(len(index.search(view, top=2)), 2)
        self.assertEqual(len(index.search(view, top=0)), 6)
        self.assertEqual(index.search(view, top=2, offset=1)[0].rank, 2)
        self.assertEqual({hit.metadata["odd"] for hit in index.search(view, filter={"odd": True})}, {True})
        self.assertEqual([hit.image_id for hit in index.search(view, object="o1")], ["p1"])
        explained = index.search(view, explain=True)[0]
        self.assertEqual(len(explained.explain["pairs"]), explained.inliers)
        self.assertEqual(index.search(view, verify="none")[0].inliers, 0)
        self.assertEqual(index.search_stored("p4")[0].image_id, "p4")
        by_features = index.search(pliant.describe(view, descriptor="rootsift", enlarge_below=0))
        self.assertEqual(by_features[0].object, "o3")
        self.assertEqual([hit.object for hit in index.search(view, min_score=0.5)], ["o3"])
        with self.fails(pliant.ConflictError, "model_mismatch"):
            index.search(pliant.describe(view, descriptor="sift"))

    def test_wrong(self):
        index = self.filled(2)
        view = other_view(1)
        for options, kind in (({"rank": "best"}, ValueError), ({"verify": "homography"}, ValueError),
                              ({"group_by": "colour"}, ValueError), ({"region": (1, 2, 3)}, ValueError),
                              ({"region": (0, 0, -5, 5)}, ValueError), ({"region": (0, 0, float("nan"), 5)}, ValueError),
                              ({"min_score": float("nan")}, ValueError), ({"min_score": 7}, ValueError),
                              ({"filter": {"a": {"near": 1}}}, ValueError), ({"filter": "x"}, TypeError),
                              ({"top": -1}, ValueError), ({"top": 2.0}, TypeError), ({"colour": 1}, TypeError),
                              ({"object": 5}, TypeError)):
            with self.subTest(options=options), self.fails(kind):
                index.search(view, **options)
        with self.fails(TypeError, words="options are top, offset,"):
            index.search(view, limit=3)
        with self.fails(pliant.NotFoundError):
            index.search_stored("nothing")
        with self.fails(pliant.UnprocessableError, "too_few_features"):
            index.search(np.full((64, 64), 9, np.uint8))
        for arguments, kind in (({"object": "a\nb"}, ValueError), ({"object": 5}, TypeError), ({"id": "a b"}, ValueError),
                                ({"id": ""}, ValueError), ({"metadata": {"x": float("nan")}}, ValueError),
                                ({"metadata": [1]}, TypeError), ({"metadata": {"x": object()}}, TypeError),
                                ({"object": "\ud800"}, ValueError), ({"object": "x" * 600}, ValueError)):
            with self.subTest(arguments=arguments), self.fails(kind):
                index.add(pattern(7), **arguments)
        with self.fails(TypeError, words="metadata: "):
            index.add(pattern(7), metadata={"x": np.float32(1)})
        with self.fails(pliant.UnprocessableError, "too_few_features"):
            index.add(np.full((64, 64), 9, np.uint8))
        with self.fails(pliant.NotFoundError):
            index.get("nothing")
        for options in ({"words": 10**6}, {"words": -1}, {"sample": -2}):
            with self.fails(ValueError):
                index.train(**options)
        self.assertEqual(len(index), 2)

    def test_databases(self):
        with self.fails(pliant.NotFoundError):
            pliant.Index(self.folder / "nowhere.db", create=False)
        with self.fails(pliant.NotFoundError):
            pliant.Index(self.folder / "no" / "where.db")
        (self.folder / "text.db").write_text("no database, but long enough to be looked at" * 100)
        with self.fails(pliant.CorruptError):
            pliant.Index(self.folder / "text.db")
        with self.fails(pliant.Error):
            pliant.Index(self.folder)
        self.filled(1).close()
        with self.fails(pliant.ConflictError, "model_mismatch"):
            pliant.Index(self.folder / "x.db", descriptor="sift")
        with self.fails(pliant.ConflictError, "extraction_mismatch"):
            pliant.Index(self.folder / "x.db", max_keypoints=7)
        with pliant.Index(self.folder / "few.db", descriptor="rootsift", max_keypoints=30) as few:
            few.add(pattern(1), id="a")
        # The database remembers. An image with few keypoints is described enlarged, too: 30 more.
        self.assertGreater(len(pliant.describe(pattern(2), descriptor="rootsift", enlarge_below=4000)), 60)
        with pliant.Index(self.folder / "few.db") as few:
            self.assertLessEqual(few.get("a").keypoints, 60)
            self.assertLessEqual(few.add(pattern(2)).keypoints, 60)
        with self.fails(TypeError):
            pliant.Index(5)

    def test_progress_that_raises(self):
        index = self.filled(3)

        def stop(*_):
            raise KeyError("enough")

        with self.fails(KeyError):
            index.train(progress=stop)
        self.assertEqual(len(index.vocabularies()), 1)
        self.write("more/a.png", pattern(50))
        with self.fails(KeyError):
            index.add_folder(self.folder / "more", progress=stop)
        self.assertEqual(index.check(), [])

    def test_beside_the_command_line(self):
        """What one process writes, the other sees."""
        index = self.filled(2)
        self.write("shop/new/a.png", pattern(40))
        subprocess.run([BIN / "pliant", "index", self.folder / "shop", "--db", self.folder / "x.db"], check=True,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=100)
        self.assertEqual(len(index), 3)
        self.assertEqual(index.search(other_view(40))[0].object, "new")


if __name__ == "__main__":
    unittest.main()
