# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Training of the DEAL network: data, losses, stages, checkpoints, export."""
