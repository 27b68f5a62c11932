#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# install.sh: gets the npm packages that package-lock.json names, when they are not there: for the tests of the web page and of the OpenAPI document.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"
# npm brings certificates of its own; behind a proxy only the system's know who is who.
system_certificates=/etc/ssl/certs/ca-certificates.crt
[ ! -e "$system_certificates" ] || export NODE_EXTRA_CA_CERTS=${NODE_EXTRA_CA_CERTS:-$system_certificates}
if ! cmp -s package-lock.json node_modules/.installed; then
  npm ci --ignore-scripts --no-audit --no-fund
  cp package-lock.json node_modules/.installed
fi
