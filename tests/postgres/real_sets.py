#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Asks the same of a file and of PostgreSQL, sets of photographs as `pliant eval retrieval` reads them, and prints a Markdown table:

    bash tests/postgres/on_postgres.sh python3 tests/postgres/real_sets.py --bin build/release/bin REAL/packages:labels REAL/deforming:objects

Each set is indexed into a file, `pliant db copy` brings it into PostgreSQL, and a server of each answers every query, and so do servers
that hold the index in parts. A set in which the queries are searched too has its mean average precision, the others their top-1. Exit status 1
when a figure differs by more than half a point, or an answer of the parts from that of the server on PostgreSQL.
"""
import argparse
import collections
import contextlib
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
PARTS = (2, 4)
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
    """One database and the server on it, or servers of its parts: the hits of each query, and the sum of its figures."""

    def __init__(self, options, database, home, name, parts=1):
        peers, self.servers = home / f"{name}.toml", []
        entries = ['"http://127.0.0.1:1"'] * parts  # until their ports are known
        try:
            for i in range(parts):
                peers.write_text("[parts]\n" + "".join(f"{n} = [{entry}]\n" for n, entry in enumerate(entries, 1)), encoding="ascii")
                part = ["--part", f"{i + 1}/{parts}", "--peers", peers] if parts > 1 else []
                self.servers.append(Server([options.server, "--db", str(database), "--listen", "127.0.0.1:0", *part], home / f"{name}-{i}.log"))
                self.servers[i].wait_ready()
                entries[i] = f'"http://127.0.0.1:{self.servers[i].address[1]}"'
            peers.write_text("[parts]\n" + "".join(f"{n} = [{entry}]\n" for n, entry in enumerate(entries, 1)), encoding="ascii")
            self.connection = Connection(self.servers[0].address, keep_alive=False)  # asked in turns, so each waits long
            self.ids = {pathlib.Path(row["source"]).name: row["id"] for row in self.records()}
        except BaseException:
            self.__exit__()
            raise
        self.answers, self.figure = [], 0

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for server in self.servers:
            server.kill()

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
        with contextlib.ExitStack() as stack:
            file, postgres = (stack.enter_context(Asked(options, *where)) for where in ((home / "db", home, "file"), (url, home, "postgres")))
            divided = [stack.enter_context(Asked(options, url, home, f"parts{parts}", parts)) for parts in PARTS]
            for number, image in queries:
                for asked in (file, postgres, *divided):
                    asked.ask(number, image, sizes[image["object"]])
        both = file, postgres
        equal = sum(a == b for a, b in zip(file.answers, postgres.answers))
        equal_parts = [sum(a == b for a, b in zip(postgres.answers, parts.answers)) for parts in divided]
        refused = sum(status != 200 for status, _ in file.answers)
        figures = [asked.figure / len(queries) for asked in both]
        title = "mAP" if queries[0][1]["searched"] else "top-1"
        print(f"| {name} | {title} | {figures[0]:.4f} | {figures[1]:.4f} | {equal} of {len(queries)} | "
              f"{', '.join(map(str, equal_parts))} | {refused} |", flush=True)
        return abs(figures[0] - figures[1]) <= MOST_APART and set(equal_parts) == {len(queries)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--bin", required=True, type=pathlib.Path)
    parser.add_argument("--descriptor", default="deal")
    parser.add_argument("sets", nargs="+", metavar="DIR:LAYOUT")
    options = parser.parse_args()
    options.pliant, options.server = options.bin / "pliant", options.bin / "pliant-server"
    if "PLIANT_TEST_DATABASE" not in os.environ:
        sys.exit("start this by tests/postgres/on_postgres.sh")
    print("| set | figure | file | PostgreSQL | equal answers | of 2 and 4 parts | refused |\n|---|---|---|---|---|---|---|", flush=True)
    good = [measure(options, given) for given in options.sets]
    sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
