# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Process-wide settings that make training fast and repeatable."""

from __future__ import annotations

import ctypes
import resource

import torch

_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_MAX = -1, -2, -4


def configure(threads: int) -> torch.device:
    """Sets threads, the allocator and CUDA's modes; returns the device to train on.

    glibc hands every large tensor back to the kernel and pays page faults for the next one, which
    costs a CPU 40 % of the training time: keep the memory instead.
    """
    torch.set_num_threads(threads)
    # Each tensor from a worker process holds a file descriptor.
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    try:
        libc = ctypes.CDLL(None)
        libc.mallopt(_M_MMAP_MAX, 0)
        libc.mallopt(_M_TRIM_THRESHOLD, -1)
        libc.mallopt(_M_TOP_PAD, 64 << 20)
    except (AttributeError, OSError):
        pass  # another C library: only slower
    if not torch.cuda.is_available():
        return torch.device("cpu")
    torch.backends.cuda.matmul.allow_tf32 = True
    torch.backends.cudnn.allow_tf32 = True
    torch.backends.cudnn.benchmark = False
    torch.backends.cudnn.deterministic = True
    return torch.device("cuda")
