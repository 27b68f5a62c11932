#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Measures the accuracy figures of the documents, and writes them into figures.json and between the documents' markers.

    tests/accuracy/tables.sh --real REAL --pliant build/release/bin/pliant             all measurements, within an hour on two cores
    tests/accuracy/tables.sh --pliant build/release/bin/pliant --only matching         one measurement

A document has `<!-- table: NAME -->` and `<!-- end of table -->`: between them are the commands and the rows of that table ("rows only":
the commands are in a block of the page). Measurements use the weights of descriptor/model. A row has the id of its weights: the test
`tables` refuses it after new weights.
"""
import argparse
import hashlib
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path += [str(HERE), str(HERE.parent / "integration")]
import guide_test  # noqa: E402
import real_table  # noqa: E402
from real_table import interval, markdown  # noqa: E402

ROOT = HERE.parents[1]
FIGURES = "tests/accuracy/figures.json"
DOCUMENTS = ("descriptor/model/README.md", "index/evaluation/README.md", "descriptor/RESEARCH_GUIDE.md")
WEIGHTS = {"deal": "deal", "deal-fixed": "deal", "deal-small": "deal-small"}  # descriptor: its file
MARKER = re.compile(r"<!-- table: ([\w-]+)(, rows only)? -->\n(.*?)<!-- end of table -->\n", re.DOTALL)


def model_ids(root):
    """The ids of the shipped weights, by descriptor; the others have none."""
    files = {file: hashlib.sha256((root / "descriptor/model" / f"{file}.safetensors").read_bytes()).hexdigest() for file in set(WEIGHTS.values())}
    return {name: f"{name}:{files[file][:16]}" for name, file in WEIGHTS.items()}


class Measurement:
    """Runs its commands in order. `make` turns the reports of the evaluations into rows; each is {"weights", "n", "cells"}."""

    def __init__(self, make, *commands):
        self.make, self.commands = make, commands

    def run(self, options, folder):
        reports = []
        for command in self.commands:
            print(command, file=sys.stderr, flush=True)
            words = [options.pliant, *shlex.split(command)[1:], "--jobs", str(options.jobs)]
            done = subprocess.run([*words, "--json"], cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
            if words[1] == "eval":
                reports.append(json.loads(done.stdout))
        return self.make(*reports)


def row(descriptor, n, cells):
    return {"weights": model_ids(ROOT).get(descriptor, ""), "n": n, "cells": cells}


def matching_rows(report):
    for result in report["results"]:
        half = 1.96 * result["ms_error"]
        ms = {"value": result["ms"], "low": result["ms"] - half, "high": result["ms"] + half}
        yield row(result["descriptor"], result["pairs"], {
            "method": result["descriptor"], "pairs": result["pairs"], "MS (95 %)": ms, "MMA": result["mma"],
            "precision": result["mutual_precision"], "MS / MS(SIFT)": f"{result['ms_ratio_to_sift']:.2f}"})


def sweep_rows(rotation, scale):
    series = zip(rotation["curves"][0]["series"], scale["curves"][0]["series"], rotation["results"], scale["results"])
    for turned, scaled, all_turned, all_scaled in series:
        yield row(turned["descriptor"], all_turned["pairs"], {
            "method": turned["descriptor"], "flatness, rotation": turned["lowest_over_highest"], "flatness, scale": scaled["lowest_over_highest"],
            "MMA, rotation": all_turned["mma"], "MMA, scale": all_scaled["mma"], "pairs": f"{all_turned['pairs']}, {all_scaled['pairs']}"})


def retrieval_rows(report):
    for result in report["results"]:
        yield row(result["descriptor"], report["queries"], {
            "descriptor": result["descriptor"], "protocol": result["protocol"], "queries": report["queries"],
            "@1 (95 %)": interval(result["top1"], report["queries"]), "@5": result["accuracy_at"][4], "mAP": result["map"]})


def real_rows(rows):
    """One row per set and descriptor; `rows` has those of both protocols."""
    unverified = {(r["set"], r["descriptor"]): r["value"] for r in rows if r["protocol"] == "unverified"}
    for r in rows:
        if r["protocol"] == "default":
            cells = real_table.row_of(r)
            yield row(r["descriptor"], r["queries"], {
                **{name: cells[name] for name in ("set", "queries", "descriptor", "figure")}, "value (95 %)": cells["value"],
                "unverified": unverified[r["set"], r["descriptor"]],
                **{name: cells[name] for name in ("found right", "found wrong")}, "found without the object": cells["left out"]})


class RealMeasurement:
    commands = ("tests/accuracy/tables.sh --real REAL --pliant build/release/bin/pliant --only real",
                "pliant eval retrieval REAL/SET --descriptor deal --protocol default,unverified --seeds 1")

    def run(self, options, folder):
        if not options.real:
            sys.exit("The measurement real needs --real, the folder of the sets. fetch_real.py fetches them.")
        words = shlex.split(self.commands[1])
        wanted = argparse.Namespace(real=options.real, pliant=options.pliant, cache=options.cache or pathlib.Path(folder), jobs=options.jobs,
                                    descriptor=words[words.index("--descriptor") + 1], protocol=words[words.index("--protocol") + 1],
                                    seeds=1, words=None, absent=[], model=None)
        rows, answers = [], []
        for real_set in real_table.sets_below(options.real):
            print(self.commands[1].replace("SET", real_set.folder), file=sys.stderr, flush=True)
            measured, first = real_table.measure(real_set, wanted)
            rows += measured
            answers += first
        reliability = [row(cells["descriptor"], cells["answers"], cells) for cells in real_table.rows_of_reliability(answers)]
        return {"real": list(real_rows(rows)), "probabilities": reliability}


MATCHED = "deal,deal-small,deal-fixed,sift+repeats,rootsift,sift,daisy,brisk,orb"
MEASUREMENTS = {
    "matching": Measurement(
        lambda report: {"matching": list(matching_rows(report))},
        "pliant simulate --textures procedural --out pairs --scenes 60 --views 4 --seed 2",
        f"pliant eval matching pairs --pairs 60 --keypoints 1000 --descriptor {MATCHED}"),
    "street": Measurement(
        lambda report: {"street": list(matching_rows(report))},
        "pliant simulate --textures procedural --out street --preset street --scenes 30 --views 3 --seed 3",
        "pliant eval matching street --pairs 30 --keypoints 1000 --enlarge --descriptor deal,deal-small,rootsift,sift"),
    "sweeps": Measurement(
        lambda *reports: {"sweeps": list(sweep_rows(*reports))},
        "pliant simulate --textures procedural --out rotation --preset rotation --scenes 4 --seed 6",
        "pliant simulate --textures procedural --out scale --preset scale --scenes 6 --seed 8",
        "pliant eval matching rotation --keypoints 1000 --descriptor deal,deal-small,deal-fixed,sift",
        "pliant eval matching scale --keypoints 1000 --descriptor deal,deal-small,deal-fixed,sift"),
    "objects": Measurement(
        lambda report: {"objects": list(retrieval_rows(report))},
        "pliant simulate --textures procedural --out objects --preset objects --scenes 30 --views 6 --seed 4",
        "pliant eval retrieval objects --descriptor deal,rootsift --protocol paper,default,unverified"),
    "guide-matching": Measurement(
        lambda report: {"guide-matching": list(matching_rows(report))},
        "pliant simulate --textures procedural --format folders --out scenes --scenes 4 --views 3 --width 320 --height 240 --seed 5",
        "pliant eval matching scenes --descriptor deal,rootsift,orb --keypoints 300"),
    "guide-retrieval": Measurement(
        lambda report: {"guide-retrieval": list(retrieval_rows(report))},
        "pliant simulate --preset objects --textures procedural --out objects --scenes 8 --views 4 --width 320 --height 240 --seed 6",
        "pliant eval retrieval objects --descriptor deal,rootsift --protocol paper,default --seeds 1 --max-keypoints 300"),
    "real": RealMeasurement(),
}


def rounded(value):
    if isinstance(value, dict):
        return {key: rounded(part) for key, part in value.items()}
    return round(value, 6) if isinstance(value, float) else value


def measure(options):
    figures = json.loads((ROOT / FIGURES).read_text(encoding="utf-8")) if (ROOT / FIGURES).exists() else {}
    os.environ["PLIANT_MODEL"] = str(ROOT / "descriptor/model")
    for name in options.only or MEASUREMENTS:
        with tempfile.TemporaryDirectory() as folder:
            for table, rows in MEASUREMENTS[name].run(options, folder).items():
                figures[table] = {"commands": MEASUREMENTS[name].commands, "rows": rounded_rows(rows)}
        write_figures(figures)


def rounded_rows(rows):
    return [{**line, "cells": rounded(line["cells"])} for line in rows]


def write_figures(figures):
    """One line per row, so that a change of one row is one line."""
    tables = []
    for name, table in sorted(figures.items()):
        rows = ",\n".join("  " + json.dumps(line) for line in table["rows"])
        tables.append(f'"{name}": {{"commands": {json.dumps(table["commands"], indent=1)},\n "rows": [\n{rows}]}}')
    (ROOT / FIGURES).write_text("{" + ",\n".join(tables) + "}\n", encoding="utf-8")


def filled(text, figures):
    """The text of a document with the rows of the figures between its markers."""
    def fill(match):
        name, rows_only = match.group(1), match.group(2) or ""
        if name not in figures:  # not measured yet
            return match.group(0)
        table = figures[name]
        commands = "" if rows_only else "\n" + "".join(f"    {command}\n" for command in table["commands"]) + "\n"
        return f"<!-- table: {name}{rows_only} -->\n{commands}{markdown([line['cells'] for line in table['rows']])}\n<!-- end of table -->\n"
    return MARKER.sub(fill, text)


def fill_documents():
    figures = json.loads((ROOT / FIGURES).read_text(encoding="utf-8"))
    for page in (ROOT / name for name in DOCUMENTS):
        page.write_text(filled(page.read_text(encoding="utf-8"), figures), encoding="utf-8")


def problems(root, environment):
    """What the documents below root have that figures.json, the weights or the programs do not have."""
    figures = json.loads((root / FIGURES).read_text(encoding="utf-8"))
    ids, seen, known = model_ids(root), set(), {}
    for name in DOCUMENTS:
        text = (root / name).read_text(encoding="utf-8")
        for table, rows_only, _ in MARKER.findall(text):
            seen.add(table)
            if rows_only and table in figures:
                plain = text.replace("\\\n  ", "")
                yield from (f"{name}: the page lacks the command of {table}: {command}" for command in figures[table]["commands"] if command not in plain)
        unknown = {table for table, _, _ in MARKER.findall(text)} - set(figures)
        if unknown or text.count("<!-- table: ") != len(MARKER.findall(text)):
            yield f"{name}: a table without figures or without an end: {', '.join(unknown)}"
        elif filled(text, figures) != text:
            yield f"{name}: a table differs from {FIGURES}. Run tests/accuracy/tables.sh."
        yield from (f"{name}: {stale} are not the shipped weights" for stale in re.findall(r"\bdeal(?:-\w+)?:[0-9a-f]{16}\b", text)
                    if stale not in ids.values())
    yield from (f"{FIGURES}: no document has the table {table}" for table in sorted(set(figures) - seen))
    for table, content in figures.items():
        for line in content["rows"]:
            descriptor = line["cells"].get("descriptor") or line["cells"].get("method")
            if line["weights"] != ids.get(descriptor, ""):
                yield f"{table}: the row of {descriptor} is of the weights {line['weights'] or 'of none'}, not {ids.get(descriptor)}. Measure again."
        try:
            guide_test.check_options("\n".join(content["commands"]), environment, ROOT, known)
        except RuntimeError as error:
            yield f"{table}: {error}"


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--pliant", required=True, metavar="BIN", help="the program `pliant`")
    parser.add_argument("--real", type=pathlib.Path, metavar="DIR", help="folder of the sets of real photos, which fetch_real.py fetches")
    parser.add_argument("--only", action="append", choices=MEASUREMENTS, help="measure only this; can be repeated")
    parser.add_argument("--cache", type=pathlib.Path, metavar="DIR", help="keep the features of the real photos here for the next run")
    parser.add_argument("--jobs", type=int, default=0, help="threads; 0 = one per core")
    options = parser.parse_args()
    options.pliant = str(pathlib.Path(options.pliant).resolve())
    return options


def main():
    measure(parse_arguments())
    fill_documents()


if __name__ == "__main__":
    main()
