#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# One slice of training on a rented machine that is bare and has no network: builds the simulator if
# it is not there, makes scenes if there are none, continues every unfinished stage from its
# checkpoint, and leaves the state for the next slice in $OUT (few files below 16 MB; when all is done
# also last.safetensors).
#
#   PACK=textures.safetensors OUT=out [STATE=state] [SECONDS_LEFT=540] [SCENES=3000] [PRESET=gpu] \
#   [STAGES="hardnet warp joint"] [EIGEN=dir] [NLOHMANN=dir] descriptor/training/gpu_slice.sh
#
# EIGEN, NLOHMANN: the folders that hold Eigen/Core and nlohmann/json.hpp, where the machine has none.
# PACK: training textures as the simulator reads them. STATE: $OUT of the slice before, if the machine
# is a new one. Run it from the repository's root. A rehearsal: PRESET=tiny SCENES=6 SECONDS_LEFT=60.
set -euo pipefail
: "${PACK:?}" "${OUT:?}"
SECONDS_LEFT=${SECONDS_LEFT:-540} SCENES=${SCENES:-3000} PRESET=${PRESET:-gpu}
STAGES=${STAGES:-hardnet warp joint} PYTHON=${PYTHON:-python3} WORK=${WORK:-gpu-work}
SIZE=${SIZE:-480x360} VIEWS=${VIEWS:-5}
started=$(date +%s)
left() { echo $((SECONDS_LEFT - $(date +%s) + started)); }
mkdir -p "$OUT" "$WORK/scenes"

if [ ! -x "$WORK/simulate" ]; then
  eigen=${EIGEN:-/usr/include/eigen3} json=${NLOHMANN:-/usr/include}
  for header in "$eigen/Eigen/Core" "$json/nlohmann/json.hpp"; do
    [ -e "$header" ] || { echo "gpu_slice: no $header; bring the headers and set EIGEN and NLOHMANN" >&2; exit 1; }
  done
  # The core's sources are those of its CMake target; CMake itself may be missing here.
  core=descriptor/simulation
  sources=$(sed -n '/^  pliant_simulation STATIC/,/)/s/^ *\([a-z_./]*\.cc\).*/\1/p' $core/CMakeLists.txt)
  printf "$core/%s\n" scenes_main.cc $sources |
    xargs -P "$(nproc)" -I{} sh -c '${CXX:-c++} -std=c++20 ${CXXFLAGS:--O3 -march=native} -I. -I"$1" -I"$2" -c "$3" \
      -o "$4/$(basename "$3" .cc).o"' build "$eigen" "$json" {} "$WORK"
  ${CXX:-c++} "$WORK"/*.o -o "$WORK/simulate" -pthread
fi

# At most half of the slice goes into scenes; what is missing is made by the next one.
timeout "$(($(left) / 2))" "$WORK/simulate" --textures "$PACK" --out "$WORK/scenes" --scenes "$SCENES" \
  --views "$VIEWS" --width "${SIZE%x*}" --height "${SIZE#*x}" --seed 1 --jobs "$(nproc)" || true
OMP_NUM_THREADS=1 timeout "$(($(left) * 3 / 4))" "$PYTHON" -W ignore -m descriptor.training.features "$WORK/scenes" --jobs "$(nproc)"

"$PYTHON" -m descriptor.training.state unpack "${STATE:-$OUT}" "$WORK/runs"
init=""
for stage in $STAGES; do
  run=$WORK/runs/$stage
  if [ ! -e "$run/finished" ] && [ "$(left)" -gt 15 ]; then
    mkdir -p "$run"
    warp=""
    [ "$stage" != joint ] || [ ! -e "$WORK/runs/warp/last.safetensors" ] ||
      warp="--init-warp $WORK/runs/warp/last.safetensors"
    "$PYTHON" -W ignore -m descriptor.training.train --preset "$PRESET" --stage "$stage" --scenes "$WORK/scenes" \
      --run "$run" --seconds "$(($(left) - 10))" --threads "$(nproc)" $init $warp | tee -a "$run/console.log"
    if tail -n 1 "$run/console.log" | grep -q '^finished'; then touch "$run/finished"; fi
  fi
  [ -e "$run/finished" ] || break
  if [ "$stage" = hardnet ]; then init="--init $run/last.safetensors"; fi
done
"$PYTHON" -m descriptor.training.state pack "$WORK/runs" "$OUT"
if [ -e "$WORK/runs/joint/finished" ]; then cp "$WORK/runs/joint/last.safetensors" "$OUT/"; fi
echo "slice done after $(($(date +%s) - started)) s; $(ls "$WORK/scenes"/*.safetensors | wc -l) scenes;" \
  "finished: $(cd "$WORK/runs" && ls -d */finished 2>/dev/null | tr '\n' ' ')"
