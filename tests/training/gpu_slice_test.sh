#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# A slice on a bare machine, rehearsed: simulator built with the compiler alone, scenes, all stages;
# then the next slice on a machine that has only the first one's state.
#
#   gpu_slice_test.sh PYTHON
set -euo pipefail
cd "$(dirname "$0")/../.."
python=$1
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "gpu_slice_test: $1" >&2; tail -n 20 "$work"/*.log >&2; exit 1; }

mkdir "$work/images"
"$python" - "$work/images" <<'PY'
import sys
import cv2, numpy as np
rng = np.random.default_rng(3)
for i in range(4):
    coarse = rng.integers(0, 256, (24, 32, 3), np.uint8)
    cv2.imwrite(f"{sys.argv[1]}/{i}.png", cv2.resize(coarse, (320, 240), interpolation=cv2.INTER_CUBIC))
PY
"$python" -m descriptor.simulation.pack_textures "$work/images" "$work/pack.safetensors" > "$work/pack.log"

slice() { # NAME, then assignments
  local name=$1; shift
  env PACK="$work/pack.safetensors" PRESET=tiny SCENES=6 VIEWS=3 SIZE=240x180 SECONDS_LEFT=600 CXXFLAGS=-O1 PYTHON="$python" \
      WORK="$work/$name" OUT="$work/$name-out" "$@" bash descriptor/training/gpu_slice.sh > "$work/$name.log" 2>&1 || fail "$name slice failed"
}
slice first
[ -s "$work/first-out/last.safetensors" ] || fail "all stages should be finished and the weights there"
[ -z "$(find "$work/first-out" -size +16M)" ] || fail "a file above 16 MB"
mkdir -p "$work/second" && cp -r "$work/first/simulate" "$work/first/scenes" "$work/second/"
slice second STATE="$work/first-out"
cmp "$work/first-out/last.safetensors" "$work/second-out/last.safetensors" || fail "finished stages should not be trained again"
mkdir -p "$work/small" && cp -r "$work/first/simulate" "$work/first/scenes" "$work/small/"
slice small STAGES="distill-warp distill-head" TEACHER=descriptor/model/deal.safetensors
[ "$(stat -c %s "$work/small-out/last.safetensors")" -lt 6000000 ] || fail "a distilled network should be a small one"
printf x >> "$work/first-out/state.000"
if env PACK="$work/pack.safetensors" WORK="$work/third" OUT="$work/third-out" STATE="$work/first-out" \
  bash descriptor/training/gpu_slice.sh > "$work/third.log" 2>&1; then fail "a damaged state should be refused"; fi
grep -q "state in .* is damaged" "$work/third.log" || fail "the damage should be named"
