#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# Measures the accuracy figures of the documents. tables.py --help lists the options.
exec python3 "$(dirname "$0")/tables.py" "$@"
