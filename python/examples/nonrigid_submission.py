#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Matches for the site of the Nonrigid Correspondence Benchmark:  nonrigid_submission.py SET FOLDER

SET is an unpacked test set (selected_pairs.json and the images). Each of its splits becomes FOLDER/SPLIT.json, which you upload."""
import functools
import json
import pathlib
import sys

import pliant

KEYPOINTS = 2048  # per image, as the published rows of the benchmark


def main(root, folder):
    @functools.lru_cache(maxsize=64)
    def describe(name):
        return pliant.describe(pathlib.Path(root, name.lstrip("/")), max_keypoints=KEYPOINTS, max_side=0)

    pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
    for split, pairs in json.loads(pathlib.Path(root, "selected_pairs.json").read_text()).items():
        rows = [{"keypoints1": describe(a).xy.tolist(), "keypoints2": describe(b).xy.tolist(),
                 "matches": pliant.match(describe(a), describe(b)).pairs.tolist()} for a, b in pairs]
        pathlib.Path(folder, split + ".json").write_text(json.dumps(rows))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
