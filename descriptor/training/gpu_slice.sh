#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# One slice of training on a rented machine that is bare and has no network: builds the simulator if
# it is not there, makes scenes if there are none, continues every unfinished stage from its
# checkpoint, and leaves the state for the next slice in $OUT (few files below 16 MB; also
# last.safetensors once the last stage has begun).
#
#   PACK=textures.safetensors OUT=out [STATE=state] [SECONDS_LEFT=540] [SETS="pairs street"] [SCENES=3000] \
#   [FIRST=1000] [PRESET=gpu] [STAGES="hardnet warp joint"] [INIT=weights.safetensors] [TEACHER=weights.safetensors] \
#   [EIGEN=dir] [NLOHMANN=dir] descriptor/training/gpu_slice.sh
#
# SETS: presets of the simulator. FIRST scenes of each are made before training begins, the others up
# to SCENES during training, FIRST at a time: training looks for new ones after one and two thirds of a
# stage's time. INIT: weights that the first of the stages starts from; the last stage's rates then
# fall to nothing at the end of this slice.
# TEACHER: the weights that STAGES="distill-warp distill-head" learns from.
# EIGEN, NLOHMANN: the folders that hold Eigen/Core and nlohmann/json.hpp, where the machine has none.
# PACK: training textures as the simulator reads them. STATE: $OUT of the slice before, if the machine
# is a new one. Run it from the repository's root. A rehearsal: PRESET=tiny SCENES=6 SECONDS_LEFT=60.
set -euo pipefail
: "${PACK:?}" "${OUT:?}"
SECONDS_LEFT=${SECONDS_LEFT:-540} SETS=${SETS:-pairs street} SCENES=${SCENES:-3000} PRESET=${PRESET:-gpu}
FIRST=${FIRST:-$(((SCENES + 2) / 3))}
STAGES=${STAGES:-hardnet warp joint} PYTHON=${PYTHON:-python3} WORK=${WORK:-gpu-work} INIT=${INIT:-} TEACHER=${TEACHER:-}
last_stage=${STAGES##* }
SIZE=${SIZE:-480x360} VIEWS=${VIEWS:-5}
started=$(date +%s)
left() { echo $((SECONDS_LEFT - $(date +%s) + started)); }
mkdir -p "$OUT" "$WORK/more" "$WORK/runs"

# The state of the runs, as pieces of 15 MB: logs, the checkpoint of the stage that is not finished, and
# the weights that later stages start from. The last stage has all it needs in its own checkpoint.
pack() {
  rm -f "$OUT"/state.*
  (
    cd "$WORK/runs"
    for stage in $STAGES; do
      find "$stage" -name '*.csv' -o -name console.log -o -name finished
      if [ ! -e "$stage/finished" ]; then
        find "$stage" -name checkpoint.pt
      elif [ "$stage" = "$last_stage" ] || [ ! -e "$last_stage/last.safetensors" ]; then
        echo "$stage/last.safetensors"
      fi
    done 2>/dev/null | tar -c -T -
  ) | split -b 15M -d -a 3 - "$OUT/state."
  (cd "$OUT" && sha256sum state.??? > state.sha256)
}
unpack() { # FROM; nothing where a stage has begun
  if [ ! -e "$1/state.sha256" ] || [ -n "$(ls "$WORK/runs")" ]; then return; fi
  (cd "$1" && sha256sum --check --quiet state.sha256) || { echo "gpu_slice: the state in $1 is damaged" >&2; exit 1; }
  cat "$1"/state.??? | tar -x -C "$WORK/runs"
}
unpack "${STATE:-$OUT}"

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

make_scenes() { # FOLDER SET FROM TO SECONDS NICENESS: scenes and their keypoints; gives up after so long
  nice -n "$6" timeout "$5" "$WORK/simulate" --textures "$PACK" --out "$1" --preset "$2" --first "$3" --scenes "$(($4 - $3))" \
    --views "$VIEWS" --width "${SIZE%x*}" --height "${SIZE#*x}" --seed 1 --jobs "$(nproc)" || true
  OMP_NUM_THREADS=1 nice -n "$6" timeout "$5" "$PYTHON" -W ignore -m descriptor.training.features "$1" --jobs "$(nproc)"
}

# At most half of the slice goes into the first scenes; what is missing is made by the next one.
folders=() beside=""
for set in $SETS; do
  mkdir -p "$WORK/scenes/$set" "$WORK/more/$set"
  folders+=("$WORK/scenes/$set")
  make_scenes "$WORK/scenes/$set" "$set" 0 "$FIRST" "$(($(left) / 3))" 0
done
if [ "$FIRST" -lt "$SCENES" ]; then
  {
    for ((from = FIRST; from < SCENES; from += FIRST)); do
      to=$((from + FIRST < SCENES ? from + FIRST : SCENES))
      for set in $SETS; do
        make_scenes "$WORK/more/$set" "$set" "$from" "$to" "$(left)" 19
        # The keypoints before the scenes: a scene that is seen must not be without.
        mv -n "$WORK/more/$set"/*.features "$WORK/more/$set"/*.safetensors "$WORK/scenes/$set/"
      done
    done
  } > "$WORK/more.log" 2>&1 &
  beside=$!
fi

train() { # STAGE SECONDS, then further arguments
  local stage=$1 seconds=$2
  shift 2
  "$PYTHON" -W ignore -m descriptor.training.train --preset "$PRESET" --stage "$stage" --scenes "${folders[@]}" \
    --run "$WORK/runs/$stage" --seconds "$seconds" --threads 2 "$@" | tee -a "$WORK/runs/$stage/console.log"
}

init=() until=()
if [ -n "$INIT" ]; then
  init=(--init "$INIT")
  until=(--until "$(date -u -d "@$((started + SECONDS_LEFT - 10))" +%H:%M:%S)")
fi
for stage in $STAGES; do
  run=$WORK/runs/$stage
  if [ ! -e "$run/finished" ] && [ "$(left)" -gt 15 ]; then
    mkdir -p "$run"
    warp=()
    [ "$stage" != joint ] || [ ! -e "$WORK/runs/warp/last.safetensors" ] ||
      warp=(--init-warp "$WORK/runs/warp/last.safetensors")
    clock=()
    [ "$stage" != "$last_stage" ] || clock=("${until[@]}")
    [[ $stage != distill-* ]] || clock+=(--teacher "$TEACHER" --shape deal-small)
    for part in ${beside:+3 2} 1; do
      train "$stage" "$((($(left) - 5) / part))" "${init[@]}" "${warp[@]}" "${clock[@]}"
      if tail -n 1 "$run/console.log" | grep -q '^finished'; then touch "$run/finished"; break; fi
    done
  fi
  [ -e "$run/finished" ] || break
  if [[ $stage = @(hardnet|distill-warp) ]]; then init=(--init "$run/last.safetensors"); fi
done
[ -z "$beside" ] || pkill -P "$beside" || true
pack
if [ -e "$WORK/runs/$last_stage/last.safetensors" ]; then cp "$WORK/runs/$last_stage/last.safetensors" "$OUT/"; fi
echo "slice done after $(($(date +%s) - started)) s; $(find "$WORK/scenes" -name '*.safetensors' | wc -l) scenes;" \
  "finished: $(cd "$WORK/runs" && ls -d */finished 2>/dev/null | tr '\n' ' ')"
