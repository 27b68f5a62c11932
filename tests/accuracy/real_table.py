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

A second table has the parts of each set: two halves by a hash of the query's name (fit on one, report the other),
and the kinds of beer labels. A third says how often hits of a probability are right, with and without the object
of the query in the collection, and the expected calibration error (Guo et al., ICML 2017), last by half.
"""
import argparse
import collections
import csv
import dataclasses
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import zlib


@dataclasses.dataclass(frozen=True)
class RealSet:
    folder: str
    layout: str
    metric: str  # key of the results in `pliant eval retrieval --json`
    title: str
    kinds: tuple[str, ...] = ()  # prefixes of the queries' names


SETS = (
    RealSet("worn-shirts", "pairs", "top1", "top-1"),
    RealSet("packages", "labels", "top1", "top-1"),
    RealSet("banknotes", "labels", "top1", "top-1"),
    RealSet("beer-labels", "pairs", "top1", "top-1", ("label_", "sam_", "logo_")),
    RealSet("deforming", "objects", "map", "mAP"),
)


@dataclasses.dataclass(frozen=True)
class Answer:
    """The first hit of a query."""
    set: str
    query: str  # name of its file, or of folder and file where folders have the same file names
    descriptor: str
    protocol: str
    left_out: bool  # asked without the images of its object
    right: bool
    probability: float | None  # None without hits or without probabilities

    @property
    def half(self):
        return zlib.crc32(self.query.encode()) % 2

    @property
    def found(self):
        return self.probability is not None and self.probability >= FOUND


FOUND = 0.9  # probability from which a hit counts as found
BINS = (0, 0.2, 0.5, 0.8, 0.9, 0.95, 1.01)


def sets_below(real, wanted=None):
    """The wanted sets that have a folder; names the others."""
    asked = [real_set for real_set in SETS if real_set.folder in (wanted or real_set.folder)]
    found = [real_set for real_set in asked if (real / real_set.folder).is_dir()]
    for real_set in asked:
        if real_set not in found:
            print(f"skipped {real_set.folder}: {real / real_set.folder} is not a folder", file=sys.stderr)
    return found or sys.exit(f"{real} has none of the folders {', '.join(real_set.folder for real_set in asked)}")


def query_name(real_set, path):
    return f"{path.parent.name}/{path.name}" if real_set.layout == "objects" else path.name


def read_answers(real_set, file):
    with open(file, encoding="utf-8", newline="") as text:
        return [Answer(real_set.folder, query_name(real_set, pathlib.Path(row["query"])), row["descriptor"], row["protocol"],
                       row["left_out"] == "1", row["right"] == "1",
                       float(row["probability"]) if row["probability"] else None)
                for row in csv.DictReader(text) if row["rank"] in ("", "1")]


def ask(command, environment):
    """The JSON that a command prints. Exit status 3: done, but images were refused."""
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode not in (0, 3):
        sys.exit(f"{' '.join(command)} failed with exit status {done.returncode}")
    return json.loads(done.stdout)


def measure(real_set, options):
    """The rows of one set (the program's results, with the set and its number of queries), and its answers."""
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
    with tempfile.TemporaryDirectory() as folder:
        answers = pathlib.Path(folder, "answers.csv")
        report = ask([*command, "--answers", str(answers)], environment)
        first = read_answers(real_set, answers)
    rows = [{"set": real_set.folder, "metric": real_set.title, "value": result[real_set.metric],
             "queries": report["queries"], "refused": [skipped["file"] for skipped in report["skipped"]], **result}
            for result in report["results"]]
    return rows, first


def interval(share, of):
    """The share with its interval of 95 % (Wilson 1927)."""
    z = 1.96
    middle = (share + z * z / (2 * of)) / (1 + z * z / of)
    half = z * math.sqrt(share * (1 - share) / of + z * z / (4 * of * of)) / (1 + z * z / of)
    return {"value": share, "low": max(0, middle - half), "high": min(1, middle + half)}


def cell(value):
    if isinstance(value, dict):
        return f"{value['value']:.3f} ({value['low']:.3f} to {value['high']:.3f})"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def markdown(rows):
    """A table of rows, which map each column's title to a text, a number or an interval."""
    lines = [list(rows[0]), ["---"] * len(rows[0]), *([cell(value) for value in row.values()] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def counted(count, of):
    return f"{count:.0f} of {of}" if of else ""


def row_of(row):
    queries = row["queries"]
    return {"set": row["set"], "descriptor": row["descriptor"], "protocol": row["protocol"], "words": int(row["words"]), "figure": row["metric"],
            "value": interval(row["value"], queries) if row["metric"] == "top-1" else row["value"], "queries": queries,
            "refused": row["refused_queries"], "found right": interval(row["found_right"], queries),
            "found wrong": interval(row["found_wrong"], queries), "left out": counted(row["left_out_alarms"], row["left_out_queries"]),
            "false alarms": counted(row["false_alarms"], row["absent_queries"]), "ms per query": round(1000 * row["seconds_per_query"])}


def share(answers, accepts):
    return interval(sum(map(accepts, answers)) / len(answers), len(answers)) if answers else ""


def rows_of_parts(answers):
    kinds = {real_set.folder: real_set.kinds for real_set in SETS}
    for (name, descriptor, protocol), group in by(answers, lambda a: (a.set, a.descriptor, a.protocol)):
        parts = [(f"half {half}", [a for a in group if a.half == half]) for half in (0, 1)]
        parts += [(f"{kind}*", [a for a in group if a.query.startswith(kind)]) for kind in kinds[name]]
        for part, all_of_it in parts:
            asked = [a for a in all_of_it if not a.left_out]
            yield {"set": name, "part": part, "descriptor": descriptor, "protocol": protocol, "queries": len(asked),
                   "first hit right": share(asked, lambda a: a.right), "found right": share(asked, lambda a: a.found and a.right),
                   "found wrong": share(asked, lambda a: a.found and not a.right),
                   "left out, found": share([a for a in all_of_it if a.left_out], lambda a: a.found)}


def by(answers, key):
    groups = collections.defaultdict(list)
    for answer in answers:
        groups[key(answer)].append(answer)
    return groups.items()


def calibration_error(answers):
    """Mean distance of the probability and the share of right answers, over the bins."""
    gaps = [abs(sum(a.probability - a.right for a in group))
            for _, group in by(answers, lambda a: next(b for b in reversed(BINS) if a.probability >= b))]
    return sum(gaps) / len(answers)


def bootstrapped(answers, figure, draws=1000):
    """The figure with its interval of 95 % (percentile bootstrap over the answers)."""
    generator = random.Random(1)
    drawn = sorted(figure(generator.choices(answers, k=len(answers))) for _ in range(draws))
    return {"value": figure(answers), "low": drawn[draws // 40], "high": drawn[-1 - draws // 40]}


def verified(answers):
    return [a for a in answers if a.probability is not None and a.protocol != "unverified"]


def rows_of_halves(answers):
    for (descriptor, half), group in sorted(by([a for a in verified(answers) if not a.left_out], lambda a: (a.descriptor, a.half))):
        yield {"descriptor": descriptor, "queries": f"with their object, half {half}", "answers": len(group),
               "calibration error": bootstrapped(group, calibration_error)}


def rows_of_reliability(answers):
    answers = verified(answers)
    for descriptor, group in by(answers, lambda a: a.descriptor):
        for title, asked in (("with their object", [a for a in group if not a.left_out]),
                             ("without it", [a for a in group if a.left_out]), ("both", group)):
            bins = {f"{low} to {min(1, high)}": [a for a in asked if low <= a.probability < high] for low, high in zip(BINS, BINS[1:])}
            if asked:
                yield {"descriptor": descriptor, "queries": title, "answers": len(asked),
                       **{name: counted(sum(a.right for a in here), len(here)) for name, here in bins.items()},
                       "calibration error": calibration_error(asked)}


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
    answers = []
    for real_set in sets_below(options.real, options.set):
        measured, first = measure(real_set, options)
        rows += measured
        answers += first
        if options.json:
            options.json.write_text(json.dumps({"rows": rows}, indent=1) + "\n", encoding="utf-8")
    print(markdown([row_of(row) for row in rows]))
    print("\n" + markdown(list(rows_of_parts(answers))))
    print("\nRight answers of first hits by probability:\n\n" + markdown(list(rows_of_reliability(answers))))
    print("\n" + markdown(list(rows_of_halves(answers))))


if __name__ == "__main__":
    main()
