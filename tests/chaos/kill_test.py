#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Kills the server and the command line with SIGKILL at random moments, again and again, and compares what is there
afterwards with what was acknowledged.

    tests/chaos/kill_test.py --bin build/release/bin [--kills 1000] [--seed N] [--seconds S]

Each round has a database of its own: originals in the database, in a directory or in both, with and without automatic
training, every fourth with the descriptor `deal`. Eight clients and one that starts jobs change it until the server is
killed: under load, while it starts, or while it stops after SIGTERM. After the next start every acknowledged
upload, replacement and deletion must be as acknowledged, what had no answer must have happened as a whole or not at all,
jobs must be as server/reference/images.md promises, counts, lists, searches, backups and `pliant db check` must agree, and
no file of nothing may stay. At the end of a round `pliant index`, `db originals`, `vocab train`, `db backup` and `db
rm` are killed and run again.

The same seed makes the same requests; the moments differ. A failure prints the history of what is wrong, and keeps the
folder.
"""
import argparse
import dataclasses
import os
import pathlib
import shutil
import sys
import tempfile
import time

from kill.commands import Commands
from kill.model import Report
from kill.round import Round
from service.server import Wrong

LIVES = 16  # of a round; fewer when fewer kills are wanted
MODEL = pathlib.Path(__file__).resolve().parents[2] / "descriptor" / "model" / "deal.safetensors"
MOST_SHOWN = 10


def play(number, options, folder, report, lives):
    """False when something was wrong."""
    place = folder / f"round-{number}"
    place.mkdir()
    round_ = Round(number, options.seed, place, options.bin, report)
    begin, kills = time.monotonic(), report.figures.kills
    try:
        round_.run(lives)
        if not report.wrong:
            Commands(round_).run()
        if not report.wrong:
            round_.finish()
    except Wrong as wrong:
        report.add("other", str(wrong))
    finally:
        round_.tidy()
    print(f"round {number} ({round_.setup}): {report.figures.kills - kills} kills in {time.monotonic() - begin:.0f} s, "
          f"{len(round_.model.live())} images at the end", flush=True)
    if report.wrong:
        print(f"WRONG in round {number}, life {round_.model.life}, kill {report.figures.kills}, seed {options.seed}; "
              f"the folder is {place}")
        print("\n".join(report.wrong[:MOST_SHOWN]))
        return False
    shutil.rmtree(place)
    return True


def campaign(options, folder, report):
    lives, begin, number = min(LIVES, max(4, options.kills // 10)), time.monotonic(), options.first_round
    while report.figures.kills < options.kills and time.monotonic() - begin < options.seconds:
        if not play(number, options, folder, report, lives):
            return False
        number += 1
    return True


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--bin", required=True, type=pathlib.Path, metavar="DIR")
    parser.add_argument("--kills", type=int, default=40, help="at least so many; default 40, about a minute on a core")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="no round begins after this time")
    parser.add_argument("--seed", type=int, default=20240607)
    parser.add_argument("--first-round", type=int, default=0, metavar="N", help="begin with round N of this seed")
    parser.add_argument("--folder", type=pathlib.Path, help="where the databases are made; default: a temporary one")
    options = parser.parse_args()
    options.bin = options.bin.resolve()
    os.environ.setdefault("PLIANT_MODEL", str(MODEL))
    folder = pathlib.Path(tempfile.mkdtemp(prefix="pliant-kill-", dir=options.folder))
    report = Report()
    print(f"seed {options.seed}, {options.folder or ''} {folder}", flush=True)
    sound = False
    try:
        sound = campaign(options, folder, report)
    finally:  # also when somebody has seen enough and interrupts it
        print(", ".join(f"{number} {name}" for name, number in dataclasses.asdict(report.figures).items())
              + " (" + ", ".join(f"{number} {kind}" for kind, number in sorted(report.kinds.items())) + ")", flush=True)
    if sound:
        shutil.rmtree(folder)
    sys.exit(not sound)


if __name__ == "__main__":
    main()
