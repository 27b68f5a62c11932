#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# format_test.sh SOURCE_DIR: every C++ file is as .clang-format says. Only clang-format 14 (Debian 12)
# judges: other versions lay the same style out differently. Exit status 77: another version is here.
set -euo pipefail
cd "$1"
version=$(clang-format --version)
case $version in
  *"version 14."*) ;;
  *) echo "needs clang-format 14, not: $version"; exit 77 ;;
esac
mapfile -t files < <(find descriptor vocab index server python tests -name '*.cc' -o -name '*.h' -o -name '*.inl')
[ "${#files[@]}" -gt 0 ]
clang-format --dry-run --Werror "${files[@]}"
echo "${#files[@]} files"
