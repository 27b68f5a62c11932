#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever is passed, Python gets an exception that says what is wrong, never the end of the process."""
import os
import pickle
import unittest

import numpy as np

import pliant
from support import FolderCase, pattern, png


class Images(FolderCase):
    def test_arrays(self):
        grey = pattern(1)
        for wrong, kind, words in (
                (grey.astype(np.float32), TypeError, "float32"), (grey.astype(np.float64) / 255, TypeError, "0..255"),
                (grey > 5, TypeError, "bool"), (grey.astype(np.int32), TypeError, "int32"),
                (np.zeros((0, 5), np.uint8), ValueError, "0 x 5"), (np.zeros((0, 0, 3), np.uint8), ValueError, "empty"),
                (grey.ravel(), ValueError, "H x W"), (np.zeros((20, 20, 4), np.uint8), ValueError, "20 x 20 x 4"),
                (np.zeros((20, 20, 2), np.uint8), ValueError, "20 x 20 x 2"), (np.zeros((), np.uint8), ValueError, "H x W"),
                (np.array([None]), TypeError, "object"), (np.full((40, 40), np.nan), TypeError, "float64")):
            with self.fails(kind, words=words):
                pliant.describe(wrong, descriptor="orb")
        with self.fails(pliant.UnprocessableError, "image_too_small"):
            pliant.describe(grey[:8, :8], descriptor="orb")
        huge = np.lib.stride_tricks.as_strided(np.zeros(1, np.uint8), (1, 200_000_000), (0, 0))
        with self.fails(pliant.UnprocessableError, "image_too_small"):
            pliant.describe(huge, descriptor="orb")
        with self.fails(ValueError, "channels_invalid"):
            pliant.describe(grey, descriptor="orb", channels="GBR")

    def test_bytes(self):
        whole = png(pattern(1))
        for wrong, kind, code in ((b"", pliant.UnprocessableError, "image_empty"),
                                  (b"hello, world", pliant.UnsupportedMediaTypeError, "image_type_unknown"),
                                  (whole[:200], pliant.UnprocessableError, "image_truncated")):
            with self.fails(kind, code):
                pliant.describe(wrong, descriptor="orb")

    def test_paths(self):
        with self.fails(IsADirectoryError):
            pliant.describe(self.folder, descriptor="orb")
        with self.fails(FileNotFoundError):
            pliant.describe(self.folder / "nowhere.png", descriptor="orb")
        with self.fails(FileNotFoundError):
            pliant.describe(os.fsdecode(os.fsencode(self.folder) + b"/\xff.png"), descriptor="orb")
        for wrong in ("a\0b.png", ""):
            with self.fails(ValueError):
                pliant.describe(wrong, descriptor="orb")
        for wrong in (None, 5, object(), [1, 2], ["a.png"]):
            with self.fails(TypeError):
                pliant.describe(wrong, descriptor="orb")

    def test_options(self):
        grey = pattern(1)
        with self.fails(pliant.InvalidArgumentError, "unknown_descriptor", "orb"):
            pliant.describe(grey, descriptor="surf")
        with self.fails(pliant.NotFoundError, words="nowhere"):
            pliant.describe(grey, model="/nowhere/x")
        (self.folder / "bad").write_bytes(b"no weights")
        with self.fails(pliant.CorruptError, words="bad"):
            pliant.describe(grey, model=self.folder / "bad")
        with self.fails(pliant.NotFoundError, words="\\xff"):
            pliant.describe(grey, model=os.fsdecode(b"/nowhere/\xff"))
        for options in ({"max_keypoints": 0}, {"max_keypoints": 5000}, {"max_keypoints": -1}, {"max_side": -1},
                        {"threads": -1}, {"threads": 10**9}, {"max_keypoints": 10**30}):
            with self.fails(ValueError, "out_of_range"):
                pliant.describe(grey, descriptor="orb", **options)
        for options in ({"max_keypoints": 10.5}, {"threads": None}, {"max_side": "9"}, {"max_keypoints": True},
                        {"descriptor": 5}, {"model": b"/x"}, {"max_keypoints": [1]}):
            with self.fails(TypeError):
                pliant.describe(grey, **{"descriptor": "orb", **options})
        with self.fails(ValueError, "invalid_unicode"):
            pliant.describe(grey, descriptor="\udc80")

    def test_features(self):
        rows = np.zeros((3, 128), np.float32)
        points = np.zeros((3, 6), np.float32)
        bad = points.copy()
        bad[1, 0] = np.inf
        for arguments, kind in (((points[:, :5], rows), ValueError), ((points[:2], rows), ValueError),
                                ((bad, rows), ValueError), ((points, np.full_like(rows, np.nan)), ValueError),
                                ((points.astype(str), rows), TypeError), ((points, rows.astype(np.int8)), TypeError),
                                ((points, rows[0]), ValueError)):
            with self.fails(kind):
                pliant.Features(*arguments, 10, 10)
        with self.fails(ValueError):
            pliant.Features(points, rows, -1, 10)
        with self.fails(ValueError):  # more columns than fit an int
            pliant.match(np.zeros((1, 2**32 + 32), np.uint8), np.zeros((1, 32), np.uint8))
        (self.folder / "x.npz").write_bytes(b"PK nothing")
        with self.assertRaises(Exception):
            pliant.Features.load(self.folder / "x.npz")


class Errors(unittest.TestCase):
    def test_classes(self):
        try:
            pliant.describe(b"no image", descriptor="orb")
        except pliant.Error as error:
            again = pickle.loads(pickle.dumps(error))
            self.assertEqual((type(again), again.code, str(again)), (type(error), error.code, str(error)))
            self.assertIsNone(error.status)
        self.assertTrue(issubclass(pliant.InvalidArgumentError, ValueError))
        self.assertTrue(issubclass(pliant.NotFoundError, LookupError))
        self.assertTrue(issubclass(pliant.ConnectionFailedError, ConnectionError))
        with self.assertRaises(AttributeError):
            pliant.nothing
        for name in pliant.__all__:
            self.assertIsNotNone(getattr(pliant, name))


if __name__ == "__main__":
    unittest.main()
