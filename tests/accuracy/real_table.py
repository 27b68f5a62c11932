#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Measures retrieval on sets of real photos and prints one Markdown table.

    tests/accuracy/real_table.py --real REAL --pliant build/release/bin/pliant --cache CACHE --json real.json

REAL holds one folder per set. The program names missing sets and skips them. `--model` measures other
weights. Every query counts: refused queries are misses, and also have a column. "Found right" and "found wrong"
are the shares of queries whose first hit counts as found (probability 0.9 or more). "Left out" counts the queries
that find something when their object is taken out. `--absent` adds queries that show no object of the set, and
counts false alarms. Shares of queries have intervals of 95 % (Wilson 1927).
"""
import argparse
import dataclasses
import json
import math
import os
import pathlib
import subprocess
import sys


@dataclasses.dataclass(frozen=True)
class RealSet:
    folder: str
    layout: str
    metric: str  # key of the results in `pliant eval retrieval --json`
    title: str


SETS = (
    RealSet("worn-shirts", "pairs", "top1", "top-1"),
    RealSet("packages", "labels", "top1", "top-1"),
    RealSet("banknotes", "labels", "top1", "top-1"),
    RealSet("beer-labels", "pairs", "top1", "top-1"),
    RealSet("deforming", "objects", "map", "mAP"),
)


def ask(command, environment):
    """The JSON that a command prints. Exit status 3: done, but images were refused."""
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode not in (0, 3):
        sys.exit(f"{' '.join(command)} failed with exit status {done.returncode}")
    return json.loads(done.stdout)


def measure(real_set, options):
    """The rows of one set: the program's results, with the set and its number of queries."""
    environment = dict(os.environ)
    if options.model:
        environment["PLIANT_MODEL"] = str(options.model)
    command = [options.pliant, "eval", "retrieval", str(options.real / real_set.folder),
               "--layout", real_set.layout, "--descriptor", options.descriptor, "--protocol", options.protocol,
               "--seeds", str(options.seeds), "--json"]
    if options.words:
        command += ["--words", options.words]
    for folder in options.absent:
        command += ["--absent", str(folder)]
    if options.cache:
        command += ["--cache", str(options.cache / real_set.folder)]
    if options.jobs:
        command += ["--jobs", str(options.jobs)]
    report = ask(command, environment)
    return [{"set": real_set.folder, "metric": real_set.title, "value": result[real_set.metric],
             "queries": report["queries"], "refused": [skipped["file"] for skipped in report["skipped"]], **result}
            for result in report["results"]]


def interval(share, of):
    """The share with its interval of 95 % (Wilson 1927)."""
    z = 1.96
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z * math.sqrt(share * (1 - share) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    return f"{share:.3f} ({max(0, middle - half):.3f} to {min(1, middle + half):.3f})"


def table(rows):
    lines = ["| set | descriptor | protocol | words | figure | value | queries | refused | found right | found wrong | left out | false alarms "
             "| ms per query |", "|---|---|---|---|---|---|---|---|---|---|---|---|---|"]
    for row in rows:
        alarms = f"{row['false_alarms']:.0f} of {row['absent_queries']}" if row["absent_queries"] else ""
        queries = row["queries"]
        value = interval(row["value"], queries) if row["metric"] == "top-1" else f"{row['value']:.3f}"
        left_out = f"{row['left_out_alarms']:.0f} of {row['left_out_queries']}" if row["left_out_queries"] else ""
        lines.append(f"| {row['set']} | {row['descriptor']} | {row['protocol']} | {row['words']:.0f} | {row['metric']} | {value} | {queries} "
                     f"| {row['refused_queries']} | {interval(row['found_right'], queries)} | {interval(row['found_wrong'], queries)} | {left_out} "
                     f"| {alarms} | {1000 * row['seconds_per_query']:.0f} |")
    return "\n".join(lines)


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--real", required=True, type=pathlib.Path, metavar="DIR", help="folder with one folder per set")
    parser.add_argument("--pliant", default="pliant", metavar="BIN", help="the program `pliant` (default: %(default)s)")
    parser.add_argument("--descriptor", default="deal,rootsift", help="comma-separated descriptors (default: %(default)s)")
    parser.add_argument("--protocol", default="default,unverified", help="comma-separated protocols (default: %(default)s)")
    parser.add_argument("--words", help="comma-separated sizes of the vocabulary; default: as in pliant index")
    parser.add_argument("--seeds", type=int, default=1, help="vocabularies per row (default: %(default)s)")
    parser.add_argument("--model", type=pathlib.Path, help="weight file to measure; default: the installed one")
    parser.add_argument("--cache", type=pathlib.Path, help="folder that keeps the features for the next run")
    parser.add_argument("--absent", type=pathlib.Path, action="append", default=[], metavar="DIR",
                        help="folder of further queries that show no object of the sets; can be repeated")
    parser.add_argument("--jobs", type=int, default=0, help="threads; 0 = one per core")
    parser.add_argument("--set", action="append", choices=[real_set.folder for real_set in SETS],
                        help="measure only this set; can be repeated; default: all sets below --real")
    parser.add_argument("--json", type=pathlib.Path, metavar="FILE", help="file for all figures")
    return parser.parse_args()


def main():
    options = parse_arguments()
    rows = []
    for real_set in SETS:
        if options.set and real_set.folder not in options.set:
            continue
        if not (options.real / real_set.folder).is_dir():
            print(f"skipped {real_set.folder}: {options.real / real_set.folder} is not a folder", file=sys.stderr)
            continue
        rows += measure(real_set, options)
        if options.json:
            options.json.write_text(json.dumps({"rows": rows}, indent=1) + "\n", encoding="utf-8")
    if not rows:
        sys.exit(f"{options.real} has none of the folders {', '.join(real_set.folder for real_set in SETS)}")
    print(table(rows))


if __name__ == "__main__":
    main()
