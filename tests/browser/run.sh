#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# run.sh BUILD_DIR [FILE]: drives the web page of BUILD_DIR/bin/pliant-server in Chromium. Screenshots go to
# BUILD_DIR/browser. FILE: all.mjs unless told, or one of cases/. Gets the two npm packages that package-lock.json names when they are not there.
set -euo pipefail
build=$(cd "${1:?usage: run.sh BUILD_DIR}" && pwd)
cd "$(dirname "${BASH_SOURCE[0]}")"
# npm brings certificates of its own; behind a proxy only the system's know who is who.
system_certificates=/etc/ssl/certs/ca-certificates.crt
[ ! -e "$system_certificates" ] || export NODE_EXTRA_CA_CERTS=${NODE_EXTRA_CA_CERTS:-$system_certificates}
if ! cmp -s package-lock.json node_modules/.installed; then
  npm ci --ignore-scripts --no-audit --no-fund
  cp package-lock.json node_modules/.installed
fi
PLIANT_BIN=$build/bin PLIANT_OUT=$build/browser exec node "${2:-all.mjs}"
