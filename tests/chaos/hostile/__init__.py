# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Hostile pictures: small files that cost a careless reader gigabytes or minutes.

Each function marked with `bomb` is one picture; its docstring says what it attacks. Only Python's standard
library is used: the files are put together byte by byte, because no library would write them.
"""
from hostile import jpeg, others, png, tiff, webp  # noqa: F401  (they register their pictures)
from hostile.registry import BOMBS  # noqa: F401
