# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import math
import unittest

import torch
from torch.nn import functional as F

from descriptor.training import losses


def descriptors(seed, count=10, dim=8):
    generator = torch.Generator().manual_seed(seed)
    return (F.normalize(torch.randn(count, dim, generator=generator)) for _ in range(2))


class MaskTest(unittest.TestCase):
    def test_who_may_not_be_a_negative(self):
        #            0: anchor  1: near in a  2: near in b  3: far      4: other chart, same texture  5: stranger
        xy_a = torch.tensor([[10., 10], [13, 10], [60, 10], [90, 90], [10, 10], [10, 10]])
        xy_b = torch.tensor([[20., 20], [70, 20], [20, 24], [50, 90], [20, 20], [20, 20]])
        surface = torch.tensor([0, 0, 0, 0, 1, 2])
        texture = torch.tensor([7, 7, 7, 7, 7, 8])
        mask = losses.false_negatives(xy_a, xy_b, surface, texture)
        self.assertEqual(mask[0].tolist(), [False, True, True, False, True, False])
        self.assertTrue(torch.equal(mask, mask.t()))
        self.assertFalse(mask.diagonal().any())
        self.assertFalse(mask[5].any())


class InfoNceTest(unittest.TestCase):
    def test_against_the_formula(self):
        a, b = descriptors(1)
        ignore = torch.zeros(10, 10, dtype=torch.bool)
        ignore[2, 5] = ignore[5, 2] = True
        tau, total = 0.07, 0.0
        for i in range(10):
            for left, right in ((a, b), (b, a)):
                open_ = [j for j in range(10) if j == i or not ignore[i, j]]
                terms = [math.exp(float(left[i] @ right[j]) / tau) for j in open_]
                total -= math.log(math.exp(float(left[i] @ right[i]) / tau) / sum(terms)) / 20
        self.assertAlmostEqual(losses.info_nce(a, b, ignore, tau).item(), total, places=4)

    def test_ignored_pairs_get_no_gradient(self):
        a, b = descriptors(2, 2)
        a.requires_grad_()
        losses.info_nce(a, b, ~torch.eye(2, dtype=torch.bool), 0.07).backward()
        self.assertLess(a.grad.abs().max().item(), 1e-6)


class TripletTest(unittest.TestCase):
    def test_hardest_negative_by_brute_force(self):
        a, b = descriptors(3)
        ignore = torch.zeros(10, 10, dtype=torch.bool)
        ignore[0, 1] = ignore[1, 0] = True
        expected = 0.0
        for i in range(10):
            others = [j for j in range(10) if j != i and not ignore[i, j]]
            negative = min(min(float((a[i] - b[j]).norm()), float((a[j] - b[i]).norm())) for j in others)
            expected += max(0.0, 0.5 + float((a[i] - b[i]).norm()) - negative) / 10
        self.assertAlmostEqual(losses.triplet(a, b, ignore).item(), expected, places=4)

    def test_near_duplicates_are_no_negatives(self):
        a, _ = descriptors(4, 4)
        twins = a.clone()
        twins[1] = a[0]  # row 1 of b equals row 0 of a
        distance = losses.distances(a, twins)
        hardest = losses.hardest_negatives(distance, torch.zeros(4, 4, dtype=torch.bool))
        self.assertGreater(hardest.min().item(), 0.1)


class WarpLossTest(unittest.TestCase):
    def test_unknown_points_do_not_count(self):
        truth = torch.zeros(2, 3, 2)
        predicted = torch.zeros(2, 3, 2)
        predicted[0, 0, 0] = 1.0       # linear part: 1 - 0.05
        predicted[1, 2] = 100.0        # unknown
        known = torch.tensor([[True, True, True], [True, False, False]])
        self.assertAlmostEqual(losses.warp_loss(predicted, truth, known).item(), 0.95 / 4, places=6)
        self.assertEqual(losses.warp_loss(predicted, truth, torch.zeros_like(known)).item(), 0.0)
        truth[0, 1] = 2.0
        error, power = losses.warp_r2_terms(predicted, truth, known)
        self.assertAlmostEqual(error, 1.0 + 8.0, places=5)
        self.assertAlmostEqual(power, 8.0, places=5)


if __name__ == "__main__":
    unittest.main()
