# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Carries the run folders of all stages between machines, as few files of limited size.

    python3 -m descriptor.training.state pack RUNS OUT      RUNS/<stage>/* -> OUT/state.000, ... + OUT/state.json
    python3 -m descriptor.training.state unpack OUT RUNS    the other way; does nothing if RUNS holds a stage

A stage that has begun holds everything that later ones need, so only the youngest stage's checkpoint
travels, or its weights if it is finished; of older stages the logs and, unless the joint stage has
begun, the weights.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import tarfile
from pathlib import Path

PIECE_BYTES = 15 << 20
STAGES = ("hardnet", "warp", "joint")
_LOGS = ("log.csv", "validation.csv", "console.log", "finished")


def _begun(runs: Path) -> list[str]:
    marks = ("checkpoint.pt", "finished")
    return [stage for stage in STAGES if any((runs / stage / mark).exists() for mark in marks)]


def _travelling(runs: Path) -> list[Path]:
    begun = _begun(runs)
    chosen: list[Path] = []
    for stage in begun:
        chosen += [runs / stage / name for name in _LOGS]
        if stage == begun[-1] and not (runs / stage / "finished").exists():
            chosen.append(runs / stage / "checkpoint.pt")
        elif stage == begun[-1] or begun[-1] != "joint":
            chosen.append(runs / stage / "last.safetensors")
    return [path for path in chosen if path.exists()]


def pack(runs: Path, out: Path, piece_bytes: int = PIECE_BYTES) -> list[Path]:
    """Writes the pieces and their list; returns what was written."""
    out.mkdir(parents=True, exist_ok=True)
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as archive:
        for path in _travelling(runs):
            archive.add(path, path.relative_to(runs).as_posix())
    data = buffer.getvalue()
    for stale in out.glob("state.[0-9][0-9][0-9]"):
        stale.unlink()
    written = []
    for number, start in enumerate(range(0, len(data), piece_bytes)):
        written.append(out / f"state.{number:03d}")
        written[-1].write_bytes(data[start:start + piece_bytes])
    about = {"pieces": [path.name for path in written], "sha256": hashlib.sha256(data).hexdigest()}
    (out / "state.json").write_text(json.dumps(about))
    return [*written, out / "state.json"]


def unpack(out: Path, runs: Path) -> bool:
    """Restores the run folders; False if there is nothing to restore or a stage is there already.

    Raises ValueError if pieces are missing or damaged.
    """
    if not (out / "state.json").exists() or _begun(runs):
        return False
    about = json.loads((out / "state.json").read_text())
    try:
        data = b"".join((out / piece).read_bytes() for piece in about["pieces"])
    except FileNotFoundError as error:
        raise ValueError(f"{out}: a piece is missing ({error.filename})") from error
    if hashlib.sha256(data).hexdigest() != about["sha256"]:
        raise ValueError(f"{out}: the pieces are damaged (checksum of state.*)")
    runs.mkdir(parents=True, exist_ok=True)
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        for member in archive.getmembers():
            stage, _, name = member.name.partition("/")
            if not member.isfile() or stage not in STAGES or "/" in name or ".." in name:
                raise ValueError(f"{out}: unexpected entry '{member.name}'")
            (runs / stage).mkdir(exist_ok=True)
            (runs / stage / name).write_bytes(archive.extractfile(member).read())
    return True


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("command", choices=("pack", "unpack"))
    parser.add_argument("source", type=Path)
    parser.add_argument("target", type=Path)
    arguments = parser.parse_args()
    (pack if arguments.command == "pack" else unpack)(arguments.source, arguments.target)


if __name__ == "__main__":
    main()
