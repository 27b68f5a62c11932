#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# The whole campaign, for as long as it takes to believe it, with its figures on standard output:
#   tests/chaos/campaign.sh BIN [short]
# BIN: where the programs and tests lie, built for release. About five hours on two cores, with
# `short` a quarter of one. Fuzzing needs the preset `fuzz` built; without it that part is left out, and said so.
set -uo pipefail
bin=$(realpath "$1")
here=$(dirname "$(realpath "${BASH_SOURCE[0]}")")
if [ "${2:-}" = short ]; then
  kills=40 minutes=1 deal_minutes=1 images=600 fuzz_s=10 faults=
else
  kills=1000 minutes=60 deal_minutes=15 images=50000 fuzz_s=300 faults=exhaustive
fi
failed=()

part() { # NAME COMMAND...
  printf '\n## %s\n\n    %s\n\n' "$1" "${*:2}"
  "${@:2}" || failed+=("$1")
}

part "Hostile images" python3 "$here/bombs_test.py" --bin "$bin"
part "Power loss, failing calls" env TMPDIR=/dev/shm PLIANT_CHAOS=$faults "$bin/faults_test" --gtest_brief=1
part "kill -9" python3 "$here/kill_test.py" --bin "$bin" --kills $kills
part "Two servers, many clients" python3 "$here/soak.py" --bin "$bin" --minutes $minutes --images $images
part "The same with DEAL" python3 "$here/soak.py" --bin "$bin" --minutes $deal_minutes --images 500 --descriptor deal
if [ -x "$here/../../build/fuzz/bin/fuzz_image" ]; then
  part "Fuzzing" python3 "$here/../fuzz/run.py" $fuzz_s
else
  printf '\n## Fuzzing\n\nleft out: build the preset `fuzz` first\n'
fi
printf '\nfailed: %s\n' "${failed[*]:-nothing}"
[ ${#failed[@]} -eq 0 ]
