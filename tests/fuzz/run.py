#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Runs the fuzz targets and prints what they reached.

    cmake --preset fuzz && cmake --build --preset fuzz
    tests/fuzz/run.py SECONDS [TARGET ...] [--build build/fuzz] [--total] [--jobs N] [--keep]

SECONDS is for each target. What it finds lies in BUILD/finds, the inputs that reached new code in
BUILD/corpora, where the next run goes on. An input that was slow is a find only where it takes processor time: on a busy
machine any may wait. BUILD/spent.json says how long each program was run without a find; with
--total that counts, so that a long campaign can be stopped and taken up again; a program that was built anew from other
code, or found something, begins at nothing. --jobs runs so many targets side by side. --keep adds to the corpora of the
repository what reaches more than they do, the smallest files first, as far as there is room. The exit status is 1 when
something was found.
"""
import argparse
import concurrent.futures
import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
MOST_FILES = 50  # of a corpus in the repository
MOST_BYTES = 4096  # of a file that is added to it
SHARED = {"image_structure": "image"}  # targets that have the corpus of another
# An allocation that large breaks a limit: the largest is for 4 MiB (image_fuzz.cc).
MOST_FINDS = 10  # of a target, then it is left
SLOW_S = 5  # of processor time; libFuzzer calls an input slow after 10 seconds by the clock
SLICE = 300  # seconds; what a campaign that is killed loses at most
LIMITS = ["-malloc_limit_mb=64", "-rss_limit_mb=2048", "-timeout=20", "-max_len=8192"]
LIMITS_OF = {"weights": ["-max_len=16384"]}


def run_once(program, arguments, seconds):
    """(exit status, executions, edges) of one run of libFuzzer."""
    done = subprocess.run([program, *arguments, f"-max_total_time={seconds}", "-print_final_stats=1"],
                          stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace", check=False)
    executions = re.search(r"stat::number_of_executed_units:\s+(\d+)", done.stderr)
    reached = re.findall(r"cov: (\d+) ", done.stderr)
    if not executions and done.returncode == 0:
        sys.exit(f"{program} says nothing about its run:\n{done.stderr[-2000:]}")
    return done.returncode, int(executions[1]) if executions else 0, max(map(int, reached), default=0)


def only_waited(program, find):
    """Whether an input was slow because the machine was busy. Removes it then."""
    if not re.search("-(slow-unit|timeout)-", find.name):
        return False
    patient = "-timeout=600"  # where it has to wait again; the last of two holds
    again = subprocess.Popen([program, *LIMITS, patient, find], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(again.pid, 0)
    again.returncode = os.waitstatus_to_exitcode(status)
    if usage.ru_utime + usage.ru_stime >= SLOW_S:
        return False
    find.unlink()
    return True


class Spent:
    """BUILD/spent.json: time and executions of each target's present program since it last found something."""

    def __init__(self, build):
        self.build = build
        self.path = build / "spent.json"
        self.lock = threading.Lock()
        self.targets = json.loads(self.path.read_text()) if self.path.exists() else {}

    def of(self, target):
        """{"program", "seconds", "executions"}; zeros for a program that has not run."""
        program = hashlib.sha256((self.build / "bin" / f"fuzz_{target}").read_bytes()).hexdigest()
        known = self.targets.get(target, {})
        return known if known.get("program") == program else {"program": program, "seconds": 0, "executions": 0}

    def save(self, target, entry):
        with self.lock:
            self.targets[target] = entry
            partial = self.path.with_suffix(".new")
            partial.write_text(json.dumps(self.targets, indent=2, sort_keys=True) + "\n")
            os.replace(partial, self.path)


def fuzz(build, target, seconds, spent, total):
    """Runs a target for so long, again after each find, and returns a row of the table."""
    program = build / "bin" / f"fuzz_{target}"
    corpus = build / "corpora" / target
    finds = build / "finds"
    corpus.mkdir(parents=True, exist_ok=True)
    finds.mkdir(exist_ok=True)
    before = set(finds.glob(f"{target}-*"))
    arguments = [corpus, HERE / "corpus" / SHARED.get(target, target), *LIMITS, *LIMITS_OF.get(target, []),
                 f"-artifact_prefix={finds}/{target}-"]
    entry = spent.of(target)
    executions, elapsed, edges = (entry["executions"], entry["seconds"], 0) if total else (0, 0, 0)
    found = set()
    while (left := seconds - elapsed) >= 1 and len(found) < MOST_FINDS:
        begin = time.monotonic()
        status, more, reached = run_once(program, arguments, int(min(left, SLICE)))
        took = time.monotonic() - begin
        executions, elapsed, edges = executions + more, elapsed + took, max(edges, reached)
        new = set(finds.glob(f"{target}-*")) - before - found
        if status != 0 and not new:
            sys.exit(f"{program} ended with {status}, without a find")
        new = {find for find in new if not only_waited(program, find)}
        found |= new
        entry = {"program": entry["program"], "seconds": 0 if new else entry["seconds"] + took,
                 "executions": 0 if new else entry["executions"] + more}
        spent.save(target, entry)
    return target, elapsed, executions, executions / max(elapsed, 1), edges, len(list(corpus.iterdir())), len(found)


def keep(build, target):
    """Adds what reaches more than the repository's corpus does."""
    corpus = HERE / "corpus" / SHARED.get(target, target)
    with tempfile.TemporaryDirectory() as folder:
        small = pathlib.Path(folder) / "small"
        merged = pathlib.Path(folder) / "merged"
        small.mkdir()
        merged.mkdir()
        for file in corpus.iterdir():
            (merged / file.name).write_bytes(file.read_bytes())
        for file in (build / "corpora" / target).iterdir():
            if file.stat().st_size <= MOST_BYTES:
                (small / file.name).write_bytes(file.read_bytes())
        subprocess.run([build / "bin" / f"fuzz_{target}", "-merge=1", *LIMITS, *LIMITS_OF.get(target, []), merged, small],
                       stderr=subprocess.DEVNULL, check=True)
        new = sorted((file for file in merged.iterdir() if not (corpus / file.name).exists()),
                     key=lambda file: file.stat().st_size)
        room = MOST_FILES - len(list(corpus.iterdir()))
        for file in new[:max(room, 0)]:
            data = file.read_bytes()
            (corpus / f"found_{hashlib.sha256(data).hexdigest()[:12]}").write_bytes(data)
        print(f"{target}: {len(new)} inputs reach more, {min(len(new), max(room, 0))} kept")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("seconds", type=int)
    parser.add_argument("targets", nargs="*", metavar="TARGET")
    parser.add_argument("--build", type=pathlib.Path, default=HERE.parents[1] / "build" / "fuzz")
    parser.add_argument("--total", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--keep", action="store_true")
    options = parser.parse_intermixed_args()
    known = sorted(path.name.removesuffix("_fuzz.cc") for path in HERE.glob("*_fuzz.cc"))
    targets = options.targets or known
    for target in targets:
        if target not in known:
            parser.error(f"there is no target {target}, only {', '.join(known)}")
    print(f"{'target':20} {'seconds':>8} {'executions':>12} {'per second':>10} {'edges':>7} {'corpus':>7} {'finds':>6}")
    spent = Spent(options.build)
    found = 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for row in pool.map(lambda target: fuzz(options.build, target, options.seconds, spent, options.total), targets):
            print("{:20} {:>8.0f} {:>12} {:>10.0f} {:>7} {:>7} {:>6}".format(*row), flush=True)
            found += row[-1]
    if options.keep:
        for target in targets:
            keep(options.build, target)
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
