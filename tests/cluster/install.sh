#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# install.sh: gets ClickHouse for the tests of clusters, where Debian has it (12, not 13) and it is not
# there. Its package would start a server, also whenever the machine starts; so it is unpacked into
# build/clickhouse, and only the libraries that it needs are installed. ZooKeeper and Java come from
# docker/packages-test.txt.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
folder=$PWD/build/clickhouse
PATH=$PATH:/usr/sbin
if command -v clickhouse-server >/dev/null || [ -x "$folder/usr/sbin/clickhouse-server" ]; then exit 0; fi

candidate() { apt-cache policy clickhouse-server 2>/dev/null | awk '$1 == "Candidate:" { print $2 }'; }

as_root=()
if [ "$(id -u)" -ne 0 ]; then as_root=(sudo); fi
[ -n "$(candidate)" ] || "${as_root[@]}" apt-get update
if [ -z "$(candidate)" ] || [ "$(candidate)" = "(none)" ]; then
  echo "This Debian has no package clickhouse-server: the tests of clusters are skipped, but for those of ZooKeeper."
  exit 0
fi
mapfile -t libraries < <(apt-cache depends clickhouse-server clickhouse-common |
  awk '$1 == "Depends:" && $2 ~ /^lib|^zlib/ { print $2 }' | sort -u)
"${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
  apt-get install -y --no-install-recommends "${libraries[@]}"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
(cd "$work" && apt-get -o APT::Sandbox::User=root download clickhouse-server clickhouse-common)
mkdir -p "$work/root"
for package in "$work"/*.deb; do dpkg-deb -x "$package" "$work/root"; done
mkdir -p "$folder"
cp -a "$work/root/usr" "$folder/"
