#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Fetches the sets of real photos from their repositories, in the layout that `pliant eval retrieval` reads. Needs git and the internet.

    tests/accuracy/fetch_real.py --out REAL [--set packages]

real_sets.json has the repository and the licence of each set, and for each file the start of its git object id. Files are found by their
contents, wherever the repository has them. A missing file is named, and the exit status is then 1.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

MANIFEST = pathlib.Path(__file__).with_name("real_sets.json")
DIGITS = 10  # of an object id


def git(folder, *arguments, **more):
    return subprocess.run(["git", "--literal-pathspecs", "-C", folder, *arguments], check=True, stdout=subprocess.PIPE, **more).stdout


def fetch(name, source, out):
    """Writes the files of a set below out/name. Returns the names of those that the repository does not have."""
    with tempfile.TemporaryDirectory() as clone:
        subprocess.run(["git", "clone", "--quiet", "--filter=blob:none", "--no-checkout", source["repository"], clone], check=True)
        entries = [entry.split("\t", 1) for entry in git(clone, "ls-tree", "-r", "-z", "HEAD").decode().split("\0") if entry]
        paths = {facts.split()[2][:DIGITS]: path for facts, path in entries}
        files = {f"{part}/{file}": paths.get(object_id) for part, ids in source["files"].items() for file, object_id in ids.items()}
        wanted = sorted({path for path in files.values() if path})
        if wanted:  # one download for all: only these files
            git(clone, "checkout", "--quiet", "HEAD", "--pathspec-from-file=-", "--pathspec-file-nul", input="\0".join(wanted).encode())
        for file, path in files.items():
            if path:
                target = out / name / file
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes((pathlib.Path(clone) / path).read_bytes())
    return [file for file, path in files.items() if not path]


def main():
    sets = json.loads(MANIFEST.read_text(encoding="utf-8"))
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--out", required=True, type=pathlib.Path, metavar="DIR", help="folder for the sets, one folder each")
    parser.add_argument("--set", action="append", choices=sets, help="fetch only this set; can be repeated")
    options = parser.parse_args()
    complete = True
    for name in options.set or sets:
        missing = fetch(name, sets[name], options.out)
        print(f"{name}: {len(missing)} files missing. Source: {sets[name]['repository']}. Licence: {sets[name]['licence']}.",
              *(f"missing: {name}/{file}" for file in missing), sep="\n")
        complete = complete and not missing
    sys.exit(not complete)


if __name__ == "__main__":
    main()
