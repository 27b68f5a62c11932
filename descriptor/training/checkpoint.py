# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Checkpoints that a run can continue from to the step, and the CSV log beside them."""

from __future__ import annotations

import csv
import os
from pathlib import Path
from typing import Any, Mapping

import torch

CHECKPOINT = "checkpoint.pt"


def write_checkpoint(directory: Path, state: Mapping[str, Any]) -> None:
    """Atomic: the old checkpoint stays whole until the new one is on disk."""
    temporary = directory / f"{CHECKPOINT}.tmp{os.getpid()}"
    with temporary.open("wb") as stream:
        torch.save(dict(state), stream)
        stream.flush()
        os.fsync(stream.fileno())
    os.replace(temporary, directory / CHECKPOINT)


def read_checkpoint(directory: Path, device: torch.device) -> dict[str, Any] | None:
    """The checkpoint of a folder, or None if it has none."""
    path = directory / CHECKPOINT
    return torch.load(path, map_location=device) if path.exists() else None


class CsvLog:
    """Rows of named figures; columns are fixed by the first row. Rows beyond the step from which a
    run resumes are dropped."""

    def __init__(self, path: Path, resume_step: int):
        self.path = path
        rows = [row for row in read_csv(path) if int(row["step"]) <= resume_step]
        self.columns = list(rows[0]) if rows else None
        if rows:
            self._write(rows, "w")
        else:
            path.unlink(missing_ok=True)

    def add(self, row: Mapping[str, float]) -> None:
        if self.columns is None:
            self.columns = list(row)
            self._write([], "w")
        self._write([{key: _short(row.get(key, "")) for key in self.columns}], "a")

    def _write(self, rows: list[Mapping[str, Any]], mode: str) -> None:
        with self.path.open(mode, newline="") as stream:
            writer = csv.DictWriter(stream, self.columns)
            if mode == "w":
                writer.writeheader()
            writer.writerows(rows)


def read_csv(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def _short(value: Any) -> Any:
    return f"{value:.6g}" if isinstance(value, float) else value
