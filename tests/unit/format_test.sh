#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# format_test.sh SOURCE_DIR: every C++ file is as .clang-format says. clang-format 19 judges, which
# Debian 12 and 13 both have: versions lay the same style out differently. Exit status 77: it is missing.
set -euo pipefail
cd "$1"
command -v clang-format-19 >/dev/null || { echo "needs clang-format-19"; exit 77; }
mapfile -t files < <(find descriptor vocab index server python tests -name '*.cc' -o -name '*.h' -o -name '*.inl')
[ "${#files[@]}" -gt 0 ]
clang-format-19 --dry-run --Werror "${files[@]}"
echo "${#files[@]} files"
