#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""find_in_folder.py FOLDER QUERY OUT.png: indexes a folder, asks which image shows the object of QUERY, and draws the
matches that fit one warp between both. Needs Matplotlib (Debian: python3-matplotlib)."""
import sys
import matplotlib.pyplot as plt
import pliant

folder, query, out = sys.argv[1:]
with pliant.Index(out + ".db") as index:
    index.add_folder(folder)
    index.train()
    found = index.get(index.search(query, top=1)[0].image_id).source
a, b = pliant.describe(query), pliant.describe(found)
i, j = pliant.verify(a, b).inliers.T                  # numbers of the keypoints that match
plt.imshow(plt.imread(query), cmap="gray", extent=(0, a.width, a.height, 0))
plt.imshow(plt.imread(found), cmap="gray", extent=(a.width, a.width + b.width, b.height, 0))
plt.plot([a.xy[i, 0], b.xy[j, 0] + a.width], [a.xy[i, 1], b.xy[j, 1]], linewidth=0.6)
plt.axis((0, a.width + b.width, max(a.height, b.height), 0))
plt.savefig(out, dpi=200, metadata={"Title": found})
