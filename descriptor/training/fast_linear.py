# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Linear layers at oneDNN's speed where PyTorch was built on a reference BLAS.

Debian's PyTorch multiplies matrices through the reference BLAS (2 GFLOP/s a core); oneDNN's inner
product is there too and 30 times faster. Elsewhere this is torch's own linear.
"""

from __future__ import annotations

import torch
from torch.nn import functional as F


def _product(x: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """x [N, K], weight [M, K] -> x weight^T through oneDNN."""
    return torch._C._nn.mkldnn_linear(x.contiguous().to_mkldnn(), weight.contiguous(), None).to_dense()


class _OneDnnLinear(torch.autograd.Function):
    @staticmethod
    def forward(ctx, x, weight):
        ctx.save_for_backward(x, weight)
        return _product(x, weight)

    @staticmethod
    def backward(ctx, grad):
        x, weight = ctx.saved_tensors
        grad_x = _product(grad, weight.t()) if ctx.needs_input_grad[0] else None
        grad_weight = _product(grad.t(), x.t()) if ctx.needs_input_grad[1] else None
        return grad_x, grad_weight


def needs_onednn(x: torch.Tensor) -> bool:
    """Float32 on a CPU whose PyTorch has oneDNN but not MKL's BLAS."""
    return (x.device.type == "cpu" and x.dtype == torch.float32 and torch.backends.mkldnn.is_available()
            and not torch.backends.mkl.is_available())


def linear(x: torch.Tensor, weight: torch.Tensor, bias: torch.Tensor | None = None) -> torch.Tensor:
    """x [N, K] -> [N, M]; the same as F.linear."""
    if len(x) and needs_onednn(x):
        product = _OneDnnLinear.apply(x, weight)
        return product if bias is None else product + bias
    return F.linear(x, weight, bias)
