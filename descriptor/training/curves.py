# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Learning curves of a run folder as an image.

    python3 -m descriptor.training.curves RUN/hardnet RUN/warp RUN/joint --out curves.png
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

from .checkpoint import read_csv  # noqa: E402

_PANELS = (("loss", "matching loss"), ("accuracy", "positive nearer than hardest negative"),
           ("warp_r2", "R² of the warp"))


def _series(rows: list[dict[str, str]], key: str) -> tuple[list[int], list[float]]:
    points = [(int(row["step"]), float(row[key])) for row in rows if row.get(key)]
    return [step for step, _ in points], [value for _, value in points]


def draw(runs: list[Path], out: Path) -> None:
    figure, axes = plt.subplots(1, len(_PANELS) + 1, figsize=(5 * (len(_PANELS) + 1), 4))
    for run in runs:
        log, validation = read_csv(run / "log.csv"), read_csv(run / "validation.csv")
        for axis, (key, title) in zip(axes, _PANELS):
            steps, values = _series(log, key)
            if steps:
                axis.plot(steps, values, label=run.name)
            axis.set_title(title)
        for key, style in (("ms", "-"), ("mma", "--")):
            steps, values = _series(validation, key)
            if steps:
                axes[-1].plot(steps, values, style, label=f"{run.name} {key.upper()}")
    axes[-1].set_title("development set")
    for axis in axes:
        axis.set_xlabel("step")
        axis.grid(alpha=0.3)
        if axis.lines:
            axis.legend()
    figure.tight_layout()
    figure.savefig(out, dpi=90)
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    draw(arguments.runs, arguments.out)


if __name__ == "__main__":
    main()
