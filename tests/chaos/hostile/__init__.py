# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile images: small files that cost a careless reader gigabytes or minutes.

Each function marked with `bomb` is one image; its docstring says what it attacks. Only Python's standard
library is used: the files are put together byte by byte, because no library would write them.
"""
from hostile import jpeg, others, png, tiff, webp  # noqa: F401  (they register their images)
from hostile.registry import BOMBS  # noqa: F401
