#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Matches and warps against brute force, the command line and each other."""
import unittest

import numpy as np

import pliant
from support import FolderCase, other_view, pattern, run


class Matching(FolderCase):
    def test_brute_force(self):
        random = np.random.default_rng(1)
        a, b = random.normal(size=(40, 128)).astype(np.float32), random.normal(size=(60, 128)).astype(np.float32)
        distances = np.linalg.norm(a[:, None].astype(np.float64) - b[None], axis=2)
        nearest = distances.argmin(axis=1)
        pairs, found = pliant.match(a, b, mutual=False)
        np.testing.assert_array_equal(pairs, np.column_stack([np.arange(40), nearest]))
        np.testing.assert_allclose(found, distances.min(axis=1), rtol=1e-5)
        self.assertEqual((pairs.dtype, found.dtype), (np.int64, np.float32))
        mutual = [(i, j) for i, j in enumerate(nearest) if distances[:, j].argmin() == i]
        np.testing.assert_array_equal(pliant.match(a, b).pairs, mutual)
        two = np.sort(distances, axis=1)
        kept = np.flatnonzero(two[:, 0] <= 0.95 * two[:, 1])
        np.testing.assert_array_equal(pliant.match(a, b, ratio=0.95, mutual=False).pairs[:, 0], kept)

    def test_bits(self):
        random = np.random.default_rng(2)
        a, b = random.integers(256, size=(30, 32), dtype=np.uint8), random.integers(256, size=(20, 32), dtype=np.uint8)
        distances = np.unpackbits(a[:, None] ^ b[None], axis=2).sum(axis=2)
        pairs, found = pliant.match(a, b, mutual=False)
        np.testing.assert_array_equal(found, distances.min(axis=1))
        np.testing.assert_array_equal(distances[pairs[:, 0], pairs[:, 1]], found)

    def test_same_as_command_line(self):
        a, b = self.write("a.png", pattern(1)), self.write("b.png", other_view(1))
        said = run("match", a, b, "--descriptor", "rootsift", "--verify", "--json")
        first, second = (pliant.describe(path, descriptor="rootsift") for path in (a, b))
        pairs, distances = pliant.match(first, second)
        self.assertEqual([[i, j] for i, j, _ in said["matches"]], pairs.tolist())
        np.testing.assert_allclose([d for _, _, d in said["matches"]], distances, rtol=1e-6)
        verification = pliant.verify(first, second)
        self.assertTrue(verification)
        self.assertEqual(said["verification"]["inliers"], verification.inliers.tolist())
        self.assertEqual(said["verification"]["tentative"], verification.matches)

    def test_verify(self):
        a, b = (pliant.describe(image, descriptor="rootsift") for image in (pattern(1), other_view(1)))
        matches = pliant.match(a, b, ratio=0.9)
        inliers, warp = pliant.verify(a, b, matches)
        self.assertGreater(len(inliers), 20)
        self.assertTrue({tuple(pair) for pair in inliers} <= {tuple(pair) for pair in matches.pairs})
        self.assertLess(np.abs(warp(a.xy[inliers[:, 0]]) - b.xy[inliers[:, 1]]).max(), 4)
        np.testing.assert_array_equal(pliant.verify(a, b, matches.pairs.tolist()).inliers, inliers)
        corner = warp((30.0, 20.0))
        self.assertEqual(corner.shape, (2,))
        step = 1e-4
        derivative = (warp((30 + step, 20)) - warp((30 - step, 20))) / (2 * step)
        np.testing.assert_allclose(warp.jacobians([[30.0, 20.0]])[0][:, 0], derivative, atol=1e-5)
        nothing = pliant.verify(a, pliant.describe(pattern(9), descriptor="rootsift"))
        self.assertFalse(nothing)
        self.assertEqual((len(nothing.inliers), nothing.warp), (0, None))
        self.assertTrue(nothing.failure)
        self.assertFalse(pliant.verify(a, b, []))

    def test_fit(self):
        source = np.array([[0, 0], [100, 0], [0, 100], [100, 100], [50, 40]])
        warp = pliant.Warp.fit(source, source * 2 + 5, regularization=0)
        np.testing.assert_allclose(warp([[10, 20]]), [[25, 45]], atol=1e-6)
        self.assertLess(warp.bending_energy, 1e-9)
        with self.fails(pliant.UnprocessableError, "tps_degenerate"):
            pliant.Warp.fit([[0, 0], [1, 1], [2, 2]], [[0, 0], [1, 1], [2, 2]])

    def test_wrong(self):
        a = pliant.describe(pattern(1), descriptor="rootsift")
        rows = a.descriptors.copy()
        rows[3, 5] = np.nan
        with self.fails(pliant.InvalidArgumentError, words="3"):
            pliant.match(a, rows)
        with self.fails(pliant.ConflictError, "model_mismatch"):
            pliant.match(a, pliant.describe(pattern(1), descriptor="sift"))
        with self.fails(pliant.ConflictError):
            pliant.match(a.descriptors, np.zeros((4, 32), np.uint8))
        with self.fails(pliant.ConflictError):
            pliant.match(a.descriptors, np.zeros((4, 64), np.float32))
        with self.fails(ValueError):
            pliant.match(a, a, ratio=1.5)
        with self.fails(ValueError):
            pliant.match(a, a, ratio=float("nan"))
        for wrong in (np.zeros((4, 128), np.int64), np.zeros((4, 128), complex), [["a"]], None):
            with self.fails(TypeError):
                pliant.match(a, wrong)
        with self.fails(ValueError, "array_shape"):
            pliant.match(a, np.zeros(128, np.float32))
        np.testing.assert_array_equal(pliant.match(a, np.asfortranarray(a.descriptors)).pairs, pliant.match(a, a).pairs)
        for wrong in ([[0, len(a)]], [[-1, 0]]):
            with self.fails(pliant.InvalidArgumentError, "index_out_of_range"):
                pliant.verify(a, a, wrong)
        with self.fails(TypeError):
            pliant.verify(a, a, [[0.5, 1.0]])
        with self.fails(TypeError):
            pliant.verify(a, a.descriptors)
        with self.fails(ValueError, "bad_tolerance"):
            pliant.verify(a, a, tolerance=0)


if __name__ == "__main__":
    unittest.main()
