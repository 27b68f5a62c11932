#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# Trains in the background of other work on a machine without a GPU: HardNet, then joint, then export.
# Every slice ends with a checkpoint and the next one takes as many threads as the load leaves free,
# so the script may be stopped (TERM) and started again at any time.
#
#   RUN=run SCENES="scenes" DEV=dev-scenes INIT=descriptor/model/deal.safetensors WARP=warp.safetensors \
#   HARDNET_UNTIL=13:40 UNTIL=14:00 descriptor/training/cpu_run.sh
#
# Times are UTC, today's. Run it from the repository's root. WARP (optional): weights whose backbone
# and localisation network the joint stage starts from (see warp_fit.py); default: those of INIT.
set -eu
: "${RUN:?}" "${SCENES:?}" "${DEV:?}" "${INIT:?}" "${HARDNET_UNTIL:?}" "${UNTIL:?}"
WARP=${WARP:-$INIT}
SLICE=${SLICE:-300}
PYTHON=${PYTHON:-/usr/bin/python3}
mkdir -p "$RUN"
RUN=$(realpath "$RUN")

seconds_to() { echo $(($(date -u -d "$1" +%s) - $(date -u +%s))); }

free_threads() {  # 1 .. number of cores, by the last minute's load, of which one is our own
  local cores others
  cores=$(nproc)
  others=$(awk '{ print int($1 - 0.5) }' /proc/loadavg)
  echo $((others >= cores ? 1 : cores - (others > 0 ? others : 0)))
}

train() {  # stage deadline-of-the-slices deadline-of-the-schedule extra arguments...
  local stage=$1 until=$2 schedule=$3 left
  shift 3
  while left=$(seconds_to "$until"); [ "$left" -gt 20 ]; do
    "$PYTHON" -W ignore -m descriptor.training.train --preset cpu --stage "$stage" --scenes $SCENES \
      --dev "$DEV" --run "$RUN/$stage" --until "$schedule" --seconds "$((left < SLICE ? left : SLICE))" \
      --threads "$(free_threads)" "$@"
  done
}

export OMP_NUM_THREADS=1
# The HardNet's rate has not decayed when the joint stage takes over and ends it.
train hardnet "$HARDNET_UNTIL" "$(date -u -d "$UNTIL 20 minutes" +%H:%M)" --init "$INIT"
train joint "$UNTIL" "$UNTIL" --init "$RUN/hardnet/last.safetensors" --init-warp "$WARP"
"$PYTHON" -W ignore -m descriptor.training.curves "$RUN/hardnet" "$RUN/joint" --out "$RUN/curves.png"
"$PYTHON" -W ignore -m descriptor.training.export --weights "$RUN/joint/last.safetensors" --dev "$DEV" \
  --model "$RUN/export/model" --goldens "$RUN/export/data" --against "$INIT" \
  --threads "$(free_threads)" ${EXPORT_ARGUMENTS:-}
