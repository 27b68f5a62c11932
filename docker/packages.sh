#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# packages.sh [OUT_DIR]: makes Pliant's Debian packages for the release of Debian that it runs on (default: in build/packages).
# It installs what it builds with, and compiles for 20 minutes of one core.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
mkdir -p "${1:-build/packages}"
out=$(realpath "${1:-build/packages}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

bash docker/install-packages.sh build python
cmake --preset quickstart -B "$work" -DPLIANT_PYTHON=ON
cmake --build "$work"
(cd "$work" && cpack -G DEB)
cp "$work"/*.deb "$out"
ls -l "$out"
