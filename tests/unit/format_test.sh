#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# format_test.sh SOURCE_DIR: every C++ file is as .clang-format says.
set -euo pipefail
cd "$1"
mapfile -t files < <(find descriptor vocab index server tests -name '*.cc' -o -name '*.h' -o -name '*.inl')
[ "${#files[@]}" -gt 0 ]
clang-format --dry-run --Werror "${files[@]}"
echo "${#files[@]} files"
