#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# base_image.sh FILE: a minimal Debian 12 root file system as a tar file (kept when it is there).
set -euo pipefail
file=${1:?usage: base_image.sh FILE}
[ -s "$file" ] && exit 0
mkdir -p "$(dirname "$file")"
mmdebstrap --format=tar --variant=minbase --include=ca-certificates bookworm "$file.part" \
  "deb http://deb.debian.org/debian bookworm main" \
  "deb http://deb.debian.org/debian bookworm-updates main" \
  "deb http://security.debian.org/debian-security bookworm-security main"
mv "$file.part" "$file"
