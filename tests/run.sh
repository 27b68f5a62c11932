#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# Installs what is needed, builds with warnings as errors and runs every test of the default set.
# Arguments go to ctest, for example: bash tests/run.sh -R image
# (one test at a time: --parallel 1)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

step() { printf '\n== %s (%(%H:%M:%S)T)\n' "$1" -1; }

step "Packages"
bash docker/install-packages.sh build python test
bash tests/browser/install.sh
bash tests/postgres/install.sh || echo "PostgreSQL could not be installed: its tests are skipped."
step "Lines of the product"
bash tests/lines.sh
step "Configure"
cmake --preset ci
step "Build"
cmake --build --preset ci
step "Lint what has changed"
bash tests/tidy.sh
step "Test"
# Two at a time, but for those that need the machine for themselves: most tests wait for servers.
ctest --preset ci --label-exclude slow --parallel 2 "$@"
