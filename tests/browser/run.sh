#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# run.sh BUILD_DIR [FILE]: drives the web page of BUILD_DIR/bin/pliant-server in Chromium. Screenshots go to
# BUILD_DIR/browser. FILE: all.mjs by default, or one of cases/. Installs the missing npm packages of package-lock.json.
set -euo pipefail
build=$(cd "${1:?usage: run.sh BUILD_DIR}" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")"
bash install.sh
PLIANT_BIN=$build/bin PLIANT_OUT=$build/browser exec node "${2:-all.mjs}"
