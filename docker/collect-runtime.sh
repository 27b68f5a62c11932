#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# collect-runtime.sh ROOT: completes ROOT, into which Pliant was installed (ROOT/usr/bin/...), to a
# root file system that runs it: the shared libraries of its programs with their copyright notices, the
# loader, a font for names in drawings, the certificates that https is checked with, busybox (health
# checks, a shell for looking around), a user, /data, /backups and /tmp.
set -euo pipefail
root=${1:?usage: collect-runtime.sh ROOT}

certificates=/etc/ssl/certs/ca-certificates.crt
{ [ -x /usr/bin/busybox ] || [ -x /bin/busybox ]; } && [ -e "$certificates" ] || {
  apt-get update
  DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends busybox-static ca-certificates
}

mkdir -p "$root"/usr/{bin,lib,lib64} "$root"/{etc,data,backups,tmp,proc,dev}
for name in bin lib lib64; do ln -sfn "usr/$name" "$root/$name"; done
chmod 1777 "$root/tmp"
chown 10001:10001 "$root/data" "$root/backups"
printf 'root:x:0:0:root:/:/bin/sh\npliant:x:10001:10001:Pliant:/data:/bin/sh\n' >"$root/etc/passwd"
printf 'root:x:0:\npliant:x:10001:\n' >"$root/etc/group"
cp -L "$(command -v busybox)" "$root/usr/bin/busybox"
ln -sf busybox "$root/usr/bin/sh"

missing=$(ldd "$root"/usr/bin/pliant* | grep 'not found' || true)
[ -z "$missing" ] || { echo "collect-runtime.sh: libraries are missing: $missing" >&2; exit 1; }
# Debian 13 keeps libheif's decoders in plugins: ldd names them, too, above what they need.
shopt -s nullglob
mapfile -t libraries < <(ldd "$root"/usr/bin/pliant* /usr/lib/*/libheif/plugins/*.so | grep -oE '/[^ :]+\.so[^ :]*' | sort -u)
for library in "${libraries[@]}"; do
  cp -L "$library" "$root/usr/${library#/usr}" 2>/dev/null || {
    mkdir -p "$root/usr$(dirname "${library#/usr}")"
    cp -L "$library" "$root/usr/${library#/usr}"
  }
done

font=/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf
mkdir -p "$root$(dirname "$font")" "$root/etc/fonts"
cp -L "$font" "$root$font"
cp -rL /etc/fonts/. "$root/etc/fonts"
mkdir -p "$root$(dirname "$certificates")"
cp -L "$certificates" "$root$certificates"

# Which Debian packages are in here, and their copyright notices.
notices=$root/usr/share/doc
mkdir -p "$notices/pliant"
for library in "${libraries[@]}" "$font" /etc/fonts/fonts.conf /usr/sbin/update-ca-certificates "$(command -v busybox)"; do
  real=$(readlink -f "$library")
  dpkg-query -S "$real" 2>/dev/null || dpkg-query -S "${real#/usr}" 2>/dev/null || true
done | sed 's/: .*//; s/, .*//' | sort -u >"$notices/pliant/packages"
mapfile -t packages <"$notices/pliant/packages"
# shellcheck disable=SC2016  # dpkg's own variables
dpkg-query -W -f '${Package} ${Version}\n' "${packages[@]}" >"$notices/pliant/packages"
for package in "${packages[@]%%:*}"; do
  [ -e "/usr/share/doc/$package/copyright" ] || continue
  mkdir -p "$notices/$package"
  cp -L "/usr/share/doc/$package/copyright" "$notices/$package/"
done
du -sm "$root"
