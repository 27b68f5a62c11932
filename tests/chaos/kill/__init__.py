# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""kill -9 at any moment, and a model of what was acknowledged that decides what must be there afterwards."""
