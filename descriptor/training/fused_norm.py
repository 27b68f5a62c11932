# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Batch normalisation + residual + ReLU + circular row padding as one operation.

On a CPU in training half of the time goes into these memory-bound steps when they are separate
PyTorch operations. fused_norm.cc does each direction in two passes over channels-last data. Where
no compiler is at hand, on a GPU, in evaluation and in other types than float32, the same is done
with PyTorch's own operations.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import os
import subprocess
import tempfile
import warnings
from pathlib import Path

import torch
from torch import nn
from torch.nn import functional as F

_SOURCE = Path(__file__).with_name("fused_norm.cc")


def _library_path() -> Path:
    cpu = Path("/proc/cpuinfo")
    flags = [line for line in cpu.read_text().splitlines() if line.startswith(("flags", "model name"))][:2] \
        if cpu.exists() else []
    key = hashlib.sha256(_SOURCE.read_bytes() + "\n".join(flags).encode()).hexdigest()[:16]
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "pliant"
    return cache / f"fused_norm_{key}.so"


@functools.lru_cache(maxsize=None)
def native_library() -> ctypes.CDLL | None:
    """The compiled kernels, built once per machine and source; None where there is no compiler."""
    path = _library_path()
    try:
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=path.parent) as scratch:
                built = Path(scratch) / path.name
                compiler = os.environ.get("CXX", "c++")
                subprocess.run([compiler, "-std=c++17", "-O3", "-march=native", "-fno-math-errno",
                                "-fopenmp", "-shared", "-fPIC", str(_SOURCE), "-o", str(built)],
                               check=True, capture_output=True, text=True)
                os.replace(built, path)
        return ctypes.CDLL(str(path))
    except (OSError, subprocess.CalledProcessError) as error:
        detail = getattr(error, "stderr", None) or error
        warnings.warn(f"fused_norm: no compiled kernels, training will be slower ({detail})")
        return None


def _pointer(tensor: torch.Tensor | None) -> ctypes.c_void_p:
    return ctypes.c_void_p(None if tensor is None else tensor.data_ptr())


def _longs(*values: int) -> tuple[ctypes.c_long, ...]:
    return tuple(ctypes.c_long(value) for value in values)


def _channels_last(tensor: torch.Tensor) -> torch.Tensor:
    return tensor.contiguous(memory_format=torch.channels_last)


class _FusedNorm(torch.autograd.Function):
    @staticmethod
    def forward(ctx, x, residual, gamma, beta, eps, relu, wrap):
        library = native_library()
        x = _channels_last(x)
        residual = None if residual is None else _channels_last(residual)
        n, channels, height, width = x.shape
        count = n * height * width
        sums = torch.empty(2, channels, dtype=torch.float64)
        library.NormSums(_pointer(x), *_longs(count, channels), _pointer(sums[0]),
                         _pointer(sums[1]))
        mean = sums[0] / count
        variance = (sums[1] / count - mean * mean).clamp_min_(0)
        rstd = torch.rsqrt(variance + eps)
        scale = rstd if gamma is None else rstd * gamma.double()
        shift = -mean * scale if beta is None else beta.double() - mean * scale
        statistics = [value.float() for value in (scale, shift, mean, rstd)]
        y = torch.empty(n, channels, height + 2 * wrap, width, memory_format=torch.channels_last)
        library.NormForward(_pointer(x), _pointer(residual), _pointer(statistics[0]),
                            _pointer(statistics[1]), int(relu), int(wrap),
                            *_longs(n, height, width, channels), _pointer(y))
        ctx.save_for_backward(x, residual, *statistics)
        ctx.flags, ctx.affine = (int(relu), int(wrap)), gamma is not None
        return y, mean.float(), variance.float()

    @staticmethod
    def backward(ctx, grad_y, _mean, _variance):
        library = native_library()
        x, residual, *statistics = ctx.saved_tensors
        grad_y = _channels_last(grad_y)
        n, channels, height, width = x.shape
        common = (_pointer(grad_y), _pointer(x), _pointer(residual), *map(_pointer, statistics),
                  *ctx.flags, *_longs(n, height, width, channels))
        sums = torch.empty(2, channels, dtype=torch.float64)
        library.NormBackwardSums(*common, _pointer(sums[0]), _pointer(sums[1]))
        means = (sums / (n * height * width)).float()
        grad_x = torch.empty_like(x)
        grad_residual = None if residual is None else torch.empty_like(residual)
        library.NormBackward(*common, _pointer(means[0]), _pointer(means[1]),
                             _pointer(grad_x), _pointer(grad_residual))
        grad_gamma = sums[1].float() if ctx.affine else None
        grad_beta = sums[0].float() if ctx.affine else None
        return grad_x, grad_residual, grad_gamma, grad_beta, None, None, None


def wrap_rows(x: torch.Tensor) -> torch.Tensor:
    """Circular padding by one row on the angle axis."""
    return torch.cat([x[:, :, -1:], x, x[:, :, :1]], 2)


def norm_act(bn: nn.BatchNorm2d, x: torch.Tensor, residual: torch.Tensor | None = None,
             relu: bool = True, wrap: bool = False) -> torch.Tensor:
    """relu(bn(x) + residual), rows padded circularly by one where wrap is set."""
    fused = (bn.training and x.device.type == "cpu" and x.dtype == torch.float32
             and native_library() is not None and x.shape[1] <= 512)
    if not fused:
        y = bn(x)
        y = y if residual is None else y + residual
        y = F.relu(y, inplace=True) if relu else y
        return wrap_rows(y) if wrap else y
    y, mean, variance = _FusedNorm.apply(x, residual, bn.weight, bn.bias, bn.eps, relu, wrap)
    count = x.numel() // x.shape[1]
    with torch.no_grad():
        bn.running_mean.lerp_(mean, bn.momentum)
        bn.running_var.lerp_(variance * (count / max(count - 1, 1)), bn.momentum)
        bn.num_batches_tracked += 1
    return y
