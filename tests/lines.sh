#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# Prints the product's lines and C++ files by folder, so that nobody adds in silence.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

count() {  # NAME FOLDER...: lines of all sources, number of C++ files
  local name=$1
  shift
  find "$@" -type f -regextype posix-extended -regex '.*\.(cc|h|inl|py|js|html|css|sh)' -not -path '*/__pycache__/*' -print0 |
    xargs -0r awk -v name="$name" 'FNR == 1 && FILENAME ~ /\.(cc|h|inl)$/ { ++files } END { printf "%-24s %7d %5d\n", name, NR, files }'
}

printf '%-24s %7s %5s\n' folder lines C++
for room in descriptor/*/ vocab/ index/*/ server/*/ python/ docker/; do count "${room%/}" "$room"; done
count all descriptor vocab index server python docker
