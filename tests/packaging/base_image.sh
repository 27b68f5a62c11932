#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# base_image.sh FILE [RELEASE]: a minimal root file system of a Debian release, as a tar file (kept when it is there). By
# default of this machine's release: what is built here runs on that one.
set -euo pipefail
file=${1:?usage: base_image.sh FILE [RELEASE]}
[ -s "$file" ] && exit 0
mkdir -p "$(dirname "$file")"
release=${2:-$(. /etc/os-release && echo "$VERSION_CODENAME")}
mmdebstrap --format=tar --variant=minbase --include=ca-certificates "$release" "$file.part" \
  "deb http://deb.debian.org/debian $release main" \
  "deb http://deb.debian.org/debian $release-updates main" \
  "deb http://security.debian.org/debian-security $release-security main"
mv "$file.part" "$file"
