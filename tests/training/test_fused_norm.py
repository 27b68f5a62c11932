# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import itertools
import unittest
from unittest import mock

import torch

from torch.nn import functional as F

from descriptor.training import fast_linear, fused_norm


class FusedNormTest(unittest.TestCase):
    def run_once(self, native, relu, wrap, with_residual, affine):
        torch.manual_seed(11)
        bn = torch.nn.BatchNorm2d(24, affine=affine)
        if affine:
            torch.nn.init.uniform_(bn.weight, 0.5, 1.5)
            torch.nn.init.uniform_(bn.bias, -0.5, 0.5)
        x = (torch.randn(5, 24, 6, 7) * 2 + 1).requires_grad_()
        residual = torch.randn(5, 24, 6, 7).requires_grad_() if with_residual else None
        weights = torch.randn(5, 24, 6 + 2 * wrap, 7)
        library = fused_norm.native_library() if native else None
        with mock.patch.object(fused_norm, "native_library", lambda: library):
            y = fused_norm.norm_act(bn, x, residual, relu, wrap)
            (y * weights).sum().backward()
        results = {"y": y, "x": x.grad, "mean": bn.running_mean, "var": bn.running_var}
        if with_residual:
            results["residual"] = residual.grad
        if affine:
            results |= {"weight": bn.weight.grad, "bias": bn.bias.grad}
        return {name: value.detach().clone() for name, value in results.items()}

    def test_kernels_agree_with_pytorch(self):
        self.assertIsNotNone(fused_norm.native_library(), "no C++ compiler found")
        for flags in itertools.product((False, True), repeat=4):
            expected, found = self.run_once(False, *flags), self.run_once(True, *flags)
            for name in expected:
                torch.testing.assert_close(found[name], expected[name], atol=2e-5, rtol=2e-5,
                                           msg=lambda text: f"{name} relu,wrap,residual,affine={flags}: {text}")

    def test_gradient_by_finite_differences(self):
        torch.manual_seed(12)
        bn = torch.nn.BatchNorm2d(3, affine=False)
        x = torch.randn(2, 3, 4, 4).requires_grad_()
        weights = torch.randn(2, 3, 6, 4)
        value = lambda t: (fused_norm.norm_act(bn, t, wrap=True) * weights).sum()  # noqa: E731
        value(x).backward()
        direction = torch.randn_like(x)
        step = 1e-3
        with torch.no_grad():
            slope = (value(x + step * direction) - value(x - step * direction)) / (2 * step)
        self.assertAlmostEqual(slope.item(), (x.grad * direction).sum().item(), delta=0.05)


class FastLinearTest(unittest.TestCase):
    def test_agrees_with_torch_in_value_and_gradients(self):
        results = []
        for product in (F.linear, fast_linear.linear):
            torch.manual_seed(13)
            leaves = [torch.randn(5, 33), torch.randn(7, 33), torch.randn(7)]
            x, weight, bias = (leaf.requires_grad_() for leaf in leaves)
            y = product(x, weight, bias)
            (y * torch.randn(5, 7)).sum().backward()
            results.append([y.detach(), x.grad, weight.grad, bias.grad])
        for expected, found in zip(*results):
            torch.testing.assert_close(found, expected, atol=1e-5, rtol=1e-5)


if __name__ == "__main__":
    unittest.main()
