#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# tidy.sh [--all | FILE.cc...]: checks C++ sources by .clang-tidy, with clang-tidy 19.
# By default: the lines that differ from the point where the branch left main (on main: from the commit
# before), those of a header through the source beside it; of a large change, the 20 files that changed most. --all takes hours on two cores.
# The compile commands are those of build/ci (cmake --preset ci).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

most=20
commands=$(mktemp -d)
trap 'rm -rf "$commands"' EXIT
# Clang's own omp.h comes with a package of its own; it does not know one attribute of GCC's.
sed -E 's/__malloc__ \([a-z_]+\)/__malloc__/' "$(c++ -print-file-name=include/omp.h)" >"$commands/omp.h"
# Clang reads neither GCC's precompiled headers nor its own flags for them.
sed -E 's/-Winvalid-pch -include [^ ]*cmake_pch\.hxx|-fpch-preprocess//g' \
  build/ci/compile_commands.json >"$commands/compile_commands.json"
sources=$(grep -oP '"file": "\K[^"]*(?=")' "$commands/compile_commands.json" | grep -v "^$PWD/build/" | sort -u)

options=()
if [ $# -eq 0 ]; then
  base=$(git merge-base HEAD main 2>/dev/null || git rev-parse HEAD 2>/dev/null) || {
    echo "Not a git clone: no changes to check. Use --all."
    exit 0
  }
  [ "$base" != "$(git rev-parse HEAD)" ] || base=$(git rev-parse --verify -q HEAD~1 || echo "$base")
  # The most changed first: --all is there for the rest of a large change.
  mapfile -t changed < <(git diff --numstat --no-renames --diff-filter=d "$base" -- '*.cc' '*.h' | awk -F'\t' '{ print $1 + $2 "\t" $3 }' |
    sort -rn | cut -f 2 | head -n "$most")
  [ "${#changed[@]}" -gt 0 ] || { echo "No C++ file has changed."; exit 0; }
  sources=$(grep -xFf <(printf "$PWD/%s\n" "${changed[@]/%.h/.cc}") <<<"$sources" || true)
  # Only the changed lines: older findings are for --all.
  lines=$(git diff -U0 --no-renames --diff-filter=d "$base" -- "${changed[@]}" | awk '
    /^\+\+\+ / { file = substr($2, 3) }
    /^@@ / { split(substr($3, 2), at, ","); count = at[2] == "" ? 1 : at[2]
             if (count > 0) ranges[file] = ranges[file] "[" at[1] "," at[1] + count - 1 "]," }
    END { for (file in ranges) printf "{\"name\":\"/%s\",\"lines\":[%s]},", file, substr(ranges[file], 1, length(ranges[file]) - 1) }')
  options+=("--line-filter=[${lines%,}]")
elif [ "$1" != --all ]; then
  sources=$(realpath "$@")
fi
[ -n "$sources" ] || { echo "No source to check."; exit 0; }

echo "clang-tidy on $(wc -l <<<"$sources") files, about 20 seconds each"
xargs -d '\n' -P "$(nproc)" -n 1 nice clang-tidy-19 --quiet -p "$commands" --extra-arg="-isystem$commands" \
  --extra-arg=-Wno-unknown-warning-option --extra-arg=-Wno-error "${options[@]}" <<<"$sources" \
  2> >(grep -vE '^[0-9]+ warnings? (and [0-9]+ errors? )?generated\.$|^Suppressed |^Use -header-filter' >&2)
