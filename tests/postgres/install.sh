#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# install.sh: installs Debian's PostgreSQL server (15 in Debian 12, 17 in Debian 13) for the tests, with sudo when not root.
# Does nothing where there is one. Debian's package would also make a database, and run it whenever the machine starts: the
# tests start their own servers, so a setting that exists only during the installation prevents that.
set -euo pipefail
if compgen -G '/usr/lib/postgresql/*/bin/initdb' >/dev/null || command -v initdb >/dev/null; then exit 0; fi

as_root=()
if [ "$(id -u)" -ne 0 ]; then as_root=(sudo); fi
setting=/etc/postgresql-common/createcluster.d/pliant-tests.conf
trap '"${as_root[@]}" rm -f "$setting"' EXIT
"${as_root[@]}" mkdir -p "$(dirname "$setting")"
"${as_root[@]}" tee "$setting" >/dev/null <<<'create_main_cluster = false'
"${as_root[@]}" apt-get update
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends postgresql
