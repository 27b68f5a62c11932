#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Asks the same of a file and of PostgreSQL, sets of photographs as `pliant eval retrieval` reads them, and prints a Markdown table:

    bash tests/postgres/on_postgres.sh python3 tests/postgres/real_sets.py --bin build/release/bin REAL/packages:labels REAL/deforming:objects

Each set is indexed into a file, `pliant db copy` brings it into PostgreSQL, and a server of each answers every query. A set in which the
queries are searched too has its mean average precision, the others their top-1. Exit status 1 when a figure differs by more than half a point.
"""
import argparse
import collections
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "chaos"))
from service.server import Connection, Server  # noqa: E402  (needs the path above)

MOST_APART = 0.005
SEARCH = "/v1/collections/default/search"


def run(*command):
    # 3: done, but images were refused
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode not in (0, 3):
        sys.exit(f"{' '.join(map(str, command))} ended with {done.returncode}")
    return done.stdout


def fill(options, folder, layout, home):
    """Images as `pliant eval retrieval --list` names them; the database in home/db."""
    images = json.loads(run(options.pliant, "eval", "retrieval", folder, "--layout", layout, "--list", "--json"))["pictures"]
    for number, image in enumerate(images):
        if image["searched"]:
            file = pathlib.Path(image["file"])
            (home / "gallery" / image["object"]).mkdir(parents=True, exist_ok=True)
            shutil.copy(file, home / "gallery" / image["object"] / f"{number}{file.suffix}")
    run(options.pliant, "index", home / "gallery", "--db", home / "db", "--descriptor", options.descriptor)
    return images


def fresh_database(name):
    """The URL of a schema of its own."""
    base = os.environ["PLIANT_TEST_DATABASE"]
    run("psql", "-q", base, "-c", f"CREATE SCHEMA {name}")
    return f"{base}?options=-csearch_path%3D{name}"


def precision(relevant, ranked):
    """Average precision of the objects of a ranking."""
    found = total = 0
    for rank, right in enumerate(ranked, 1):
        if right:
            found += 1
            total += found / rank
    return total / relevant if relevant else 0


class Asked:
    """One database and the server on it: the hits of each query, and the sum of its figures."""

    def __init__(self, options, database, home, name):
        self.server = Server([options.server, "--db", str(database), "--listen", "127.0.0.1:0"], home / f"{name}.log")
        try:
            self.server.wait_ready()
            self.connection = Connection(self.server.address, keep_alive=False)  # asked in turns, so each waits long
            self.ids = {pathlib.Path(row["source"]).name: row["id"] for row in self.records()}
        except BaseException:
            self.server.kill()
            raise
        self.answers, self.figure = [], 0

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.server.kill()

    def records(self):
        after = ""
        while after is not None:
            page = self.connection.get(f"/v1/collections/default/images?limit=500{after}")
            yield from page["images"]
            after = f"&cursor={page['next']}" if page.get("next") else None

    def ask(self, number, image, of_object):
        file = pathlib.Path(image["file"])
        if image["searched"]:
            question = {"image_id": self.ids[f"{number}{file.suffix}"], "group_by": "image", "limit": 100}
            status, said = self.connection.json("POST", SEARCH, question)
        else:
            status, data = self.connection.ask("POST", f"{SEARCH}?group_by=object&limit=20", file.read_bytes())
            said = json.loads(data)
        hits = said["hits"] if status == 200 else []
        right = [hit["object"] == image["object"] for hit in hits]
        self.figure += precision(of_object - 1, right) if image["searched"] else bool(right[:1] and right[0])
        self.answers.append((status, [(hit["image_id"], hit["score"]) for hit in hits]))


def measure(options, given):
    folder, layout = given.rsplit(":", 1)
    name = pathlib.Path(folder).name
    with tempfile.TemporaryDirectory(prefix="pliant-real-") as temporary:
        home = pathlib.Path(temporary)
        images = fill(options, folder, layout, home)
        url = fresh_database(name.replace("-", "_"))
        run(options.pliant, "db", "copy", url, "--db", home / "db", "--compare", "0")
        sizes = collections.Counter(image["object"] for image in images if image["searched"])
        queries = [(number, image) for number, image in enumerate(images) if image["query"]]
        with Asked(options, home / "db", home, "file") as file, Asked(options, url, home, "postgres") as postgres:
            both = file, postgres
            for number, image in queries:
                for asked in both:
                    asked.ask(number, image, sizes[image["object"]])
        equal = sum(a == b for a, b in zip(file.answers, postgres.answers))
        refused = sum(status != 200 for status, _ in file.answers)
        figures = [asked.figure / len(queries) for asked in both]
        title = "mAP" if queries[0][1]["searched"] else "top-1"
        print(f"| {name} | {title} | {figures[0]:.4f} | {figures[1]:.4f} | {equal} of {len(queries)} | {refused} |", flush=True)
        return abs(figures[0] - figures[1]) <= MOST_APART


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--bin", required=True, type=pathlib.Path)
    parser.add_argument("--descriptor", default="deal")
    parser.add_argument("sets", nargs="+", metavar="DIR:LAYOUT")
    options = parser.parse_args()
    options.pliant, options.server = options.bin / "pliant", options.bin / "pliant-server"
    if "PLIANT_TEST_DATABASE" not in os.environ:
        sys.exit("start this by tests/postgres/on_postgres.sh")
    print("| set | figure | file | PostgreSQL | equal answers | refused |\n|---|---|---|---|---|---|", flush=True)
    good = [measure(options, given) for given in options.sets]
    sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
