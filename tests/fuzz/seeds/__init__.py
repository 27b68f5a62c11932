# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The seeds of the fuzz corpora: for each target a function that returns its files by name."""
