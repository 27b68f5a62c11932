#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""find_in_folder.py FOLDER QUERY OUT.png: indexes a folder, asks which picture shows the object of QUERY, and plots the
matches that agree on one warp."""
import sys

try:
    import matplotlib
except ImportError:
    sys.exit("needs Matplotlib (Debian: python3-matplotlib)")
matplotlib.use("Agg")
import matplotlib.pyplot as plt
import pliant

folder, query, out = sys.argv[1:]
with pliant.Index(out + ".db", descriptor="rootsift") as index:
    index.add_folder(folder, progress=lambda done, total: print(f"{done} of {total}"))
    index.train()
    hit = index.search(query, top=1)[0]
    found = index.get(hit.image_id).source

a, b = (pliant.describe(picture, descriptor="rootsift") for picture in (query, found))
inliers, warp = pliant.verify(a, b)
figure, axes = plt.subplots(1, 2, figsize=(12, 5))
for axis, picture, points in ((axes[0], query, a.xy[inliers[:, 0]]), (axes[1], found, b.xy[inliers[:, 1]])):
    axis.imshow(plt.imread(picture), cmap="gray")
    axis.scatter(points[:, 0], points[:, 1], c=range(len(points)), s=8, cmap="hsv")  # a match has one colour
    axis.set_axis_off()
figure.suptitle(f"{hit.object}: {len(inliers)} matches agree on one warp, probability {hit.probability:.2f}")
figure.savefig(out)
print(f"{found}: {len(inliers)} matches")
