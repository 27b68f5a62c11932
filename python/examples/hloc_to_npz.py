#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Features of hloc for `pliant eval ... --features NAME=FOLDER`:  hloc_to_npz.py FEATURES.h5 FOLDER

Each image IMAGE of the file becomes FOLDER/IMAGE.npz. Needs h5py (python3-h5py)."""
import pathlib
import sys

import h5py
import numpy as np
import pliant

SIZE_PX = 8.0  # hloc stores no sizes; verification by a warp needs none


def convert(group, model_id):
    xy = np.asarray(group["keypoints"], np.float32)  # hloc, too, has pixel centres at integers
    scores = np.asarray(group["scores"], np.float32) if "scores" in group else np.ones(len(xy), np.float32)
    zeros = np.zeros_like(scores)
    keypoints = np.stack([xy[:, 0], xy[:, 1], zeros + SIZE_PX, zeros, scores, zeros], axis=1)
    width, height = (int(side) for side in group["image_size"][()])
    return pliant.Features(keypoints, np.asarray(group["descriptors"], np.float32).T, width, height, model_id)


def main(file, folder):
    def visit(name, group):
        if isinstance(group, h5py.Group) and "keypoints" in group:
            out = pathlib.Path(folder, name + ".npz")
            out.parent.mkdir(parents=True, exist_ok=True)
            convert(group, pathlib.Path(file).stem).save(out)

    with h5py.File(file, "r") as features:
        features.visititems(visit)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
