#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# consumer_test.sh SOURCE_DIR BUILD_DIR CXX_FLAGS: installs Pliant into an empty prefix, builds the ten-line
# consumer against the installed package alone, with the same flags, and runs it with the installed weights.
set -euo pipefail
source_dir=$1
build_dir=$2
flags=$3
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cmake --install "$build_dir" --prefix "$work/prefix" >"$work/install.log"
cmake -S "$source_dir/tests/integration/consumer" -B "$work/build" -G Ninja \
  -DCMAKE_PREFIX_PATH="$work/prefix" -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS="$flags" >"$work/configure.log"
if grep -rqF "$source_dir" "$work/prefix/lib"*/*/cmake/Pliant "$work/prefix/lib/cmake/Pliant" 2>/dev/null; then
  echo "the installed package mentions the source tree" >&2
  exit 1
fi
cmake --build "$work/build"
env PLIANT_MODEL="$work/prefix/share/pliant/deal.safetensors" \
  "$work/build/consumer" "$source_dir/tests/data/golden_163x117.png" "$work/one.db" | tee "$work/said"
grep -qE '^[1-9][0-9]* descriptors, 1 image, version [0-9.]+$' "$work/said"
"$work/prefix/bin/pliant" --version
for program in pliant pliant-server; do
  grep -q "^\.TH " "$work/prefix/share/man/man1/$program.1"
  bash -n "$work/prefix/share/bash-completion/completions/$program"
done
grep -q "^#compdef pliant pliant-server$" "$work/prefix/share/zsh/vendor-completions/_pliant"
