#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Draws what `pliant eval matching|retrieval|tracking --json` prints: plot.py REPORT.json OUT.png

    pliant eval matching DIR --json > matching.json && python3 index/evaluation/plot.py matching.json matching.png
"""
import argparse
import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt  # noqa: E402

MARKERS = "osD^v<>pX*"


def style(names, name):
    """A name has the same colour and marker in all charts of a figure."""
    place = names.index(name)
    return {"color": f"C{place % 10}", "marker": MARKERS[place % len(MARKERS)], "markersize": 4, "label": name}


def new_figure(title, subtitle, charts, columns=2, height=4.2):
    columns = min(columns, charts)
    rows = -(-charts // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(5.2 * columns + 2, height * rows + 0.8), squeeze=False,
                                layout="constrained")
    figure.suptitle(f"{title}\n{subtitle}", fontsize=10)
    for axis in axes.flat[charts:]:
        axis.remove()
    for axis in axes.flat[:charts]:
        axis.grid(alpha=0.3)
    return figure, list(axes.flat[:charts])


def add_legend(axes, columns):
    """One for all charts, to the right of the first row."""
    entries = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    corner = axes[min(columns, len(axes)) - 1]
    corner.legend(entries.values(), entries.keys(), loc="upper left", bbox_to_anchor=(1.02, 1), fontsize=8)


def matching(report):
    """Bars for each descriptor; MS over a sweep of rotation or scale."""
    results = report["results"]
    curves = [curve for curve in report["curves"] if len(curve["values"]) > 1]
    figure, axes = new_figure("Matching", f"{report['pairs']} pairs; bars: means over pairs; whiskers: standard error",
                              1 + len(curves), columns=1, height=max(3, 0.55 * len(results)))
    for place, (name, key) in enumerate((("MS", "ms"), ("MMA", "mma"), ("mutual precision", "mutual_precision"))):
        errors = [row["ms_error"] for row in results] if key == "ms" else None
        axes[0].barh([i + 0.27 * place for i in range(len(results))], [row[key] for row in results], 0.25, xerr=errors,
                     label=name, color=("#2e4266", "#7c9cbe", "#d6b068")[place])
    axes[0].set_yticks([i + 0.27 for i in range(len(results))], [row["descriptor"] for row in results])
    axes[0].invert_yaxis()
    names = [row["descriptor"] for row in results]
    for axis, curve in zip(axes[1:], curves, strict=True):
        for series in curve["series"]:
            axis.plot(curve["values"], series["ms"], **style(names, series["descriptor"]))
        if curve["over"] == "scale":
            axis.set_xscale("log")
        axis.set_xlabel("scale of the object" if curve["over"] == "scale" else "rotation in the image plane, degrees")
        axis.set_xticks(curve["values"], [f"{value:g}" for value in curve["values"]])
        axis.minorticks_off()
        axis.set_ylabel("MS")
        axis.set_ylim(bottom=0)
    return figure, axes


def retrieval(report):
    """Accuracy over K, a chart for each protocol; whiskers: the spread over seeds."""
    rows = report["results"]
    protocols = list(dict.fromkeys(row["protocol"] for row in rows))
    sizes = {}
    for row in rows:
        sizes.setdefault((row["descriptor"], row["protocol"]), set()).add(row["words"])

    def name_of(row):
        several = len(sizes[row["descriptor"], row["protocol"]]) > 1
        return f"{row['descriptor']}, {row['words']} words" if several else row["descriptor"]

    names = list(dict.fromkeys(map(name_of, rows)))
    figure, axes = new_figure(
        "Retrieval: accuracy over K", f"{report['queries']} queries, {report['pictures']} images of "
        f"{report['objects']} objects, {report['distractors']} distractors; mean and spread of {report['seeds']} seeds",
        len(protocols))
    for axis, protocol in zip(axes, protocols, strict=True):
        for row in rows:
            if row["protocol"] == protocol:
                ranks = range(1, len(row["accuracy_at"]) + 1)
                spread = row.get("spread", {}).get("accuracy_at")  # other programs give none
                axis.errorbar(ranks, row["accuracy_at"], yerr=spread, **style(names, name_of(row)))
        axis.set(title=f"protocol {protocol}", xlabel="K, images looked at", ylim=(0, 1.02),
                 ylabel="accuracy: share of the object's images", xticks=(1, 5, 10, 15, 20))
    return figure, axes


def tracking(report):
    """The metrics over the time of the sequences."""
    charts = [("inlier_rate", "RANSAC inliers / matches"), ("tracked_share", "frames tracked"),
              ("ssim", "SSIM of the un-warped frame")]
    if any(row["found_share"] > 0 for row in report["results"]):
        charts.append(("error_px", "error where found, pixels"))
    names = [row["descriptor"] for row in report["results"]]
    figure, axes = new_figure(
        "Tracking over the time of the sequences", f"{len(report['sequences'])} sequences, {report['frames']} frames; "
        "tracked: found within 3 % of the object's size", len(charts))
    for axis, (key, label) in zip(axes, charts, strict=True):
        for name in names:
            points = [(step["time"], row[key]) for step in report["over_time"] for row in step["results"]
                      if row["descriptor"] == name and row["frames"] > 0 and row[key] is not None]
            axis.plot([x for x, _ in points], [y for _, y in points], **style(names, name))
        axis.set(xlabel="position in the sequence", ylabel=label)
        axis.set_ylim(bottom=0, top=None if key == "error_px" else 1.02)
    return figure, axes


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("report", metavar="REPORT.json", type=pathlib.Path)
    parser.add_argument("out", metavar="OUT.png", type=pathlib.Path, help="PNG, PDF or SVG, by the name")
    arguments = parser.parse_args()
    report = json.loads(arguments.report.read_text(encoding="utf-8"))
    draw = {"over_time": tracking, "curves": matching, "queries": retrieval}
    kind = next((key for key in draw if key in report), None)
    if kind is None:
        sys.exit(f"{arguments.report} is not a report of `pliant eval ... --json`")
    figure, axes = draw[kind](report)
    add_legend(axes, axes[0].get_gridspec().ncols)
    figure.savefig(arguments.out, dpi=110)


if __name__ == "__main__":
    main()
