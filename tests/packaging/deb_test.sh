#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# Makes the Debian packages, installs them in a clean Debian and runs its programs and its service's command there.
#   deb_test.sh BUILD_DIR SOURCE_DIR WORK_DIR            needs root, mmdebstrap, curl, opencv-doc
#   deb_test.sh PACKAGES_DIR SOURCE_DIR WORK_DIR RELEASE tests packages that were made on this release (trixie)
set -euo pipefail
build=$(realpath "$1")
source=$(realpath "$2")
mkdir -p "$3"
work=$(realpath "$3")
here=$source/tests/packaging
root=$work/root
port=18438

[ $# -gt 3 ] || (cd "$build" && rm -f ./*.deb && cpack -G DEB >"$work/cpack.log") || { cat "$work/cpack.log"; exit 1; }
ls -l "$build"/*.deb

bash "$here/base_image.sh" "$work/debian.tar" "${@:4}"
rm -rf "$root"
mkdir -p "$root"
tar -C "$root" -xf "$work/debian.tar"
cp /etc/resolv.conf "$root/etc/"
for package in "$build"/*.deb; do
  name=${package##*/}
  cp "$package" "$root/tmp/${name%%_*}.deb"
done
mount -t proc proc "$root/proc"
mount --bind /dev "$root/dev"
server=
finish() {
  if [ -n "$server" ]; then
    kill "$server" 2>/dev/null || true
    wait "$server" 2>/dev/null || true
  fi
  umount "$root/dev" "$root/proc"
}
trap finish EXIT
in_root() { chroot "$root" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 "$@"; }

install() {
  in_root sh -c 'DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends "$@"' sh "$@" >"$work/apt.log" 2>&1 ||
    { tail -20 "$work/apt.log"; exit 1; }
  grep 'disk space' "$work/apt.log"
}

in_root apt-get -qq update
install /tmp/pliant.deb
in_root pliant --version
in_root pliant-server --version
photographs=/usr/share/doc/opencv-doc/examples/data
mkdir -p "$root"/tmp/shop/wall
cp "$photographs"/graf1.png "$root/tmp/shop/wall"
cp "$photographs"/{box.png,home.jpg,butterfly.jpg} "$source/tests/browser/thing_601.heic" "$root/tmp/shop"
cp "$photographs/graf3.png" "$root/tmp/photo.png"
mkdir "$root/tmp/frames"
cp "$photographs"/graf[13].png "$root/tmp/frames"
in_root pliant index /tmp/shop --db /tmp/shop.db
in_root pliant query /tmp/photo.png --db /tmp/shop.db | tee "$work/query.txt"
grep -q '^ *1.* wall ' "$work/query.txt"
if in_root pliant track /tmp/photo.png /tmp/frames 2>"$work/track.txt"; then exit 1; fi
grep 'is not installed' "$work/track.txt"
install /tmp/pliant-video.deb
in_root pliant track /tmp/photo.png /tmp/frames
if [ -e "$root/tmp/python3-pliant.deb" ]; then # where the package was built
  install /tmp/python3-pliant.deb
  in_root python3 -c 'import pliant; print("python:", pliant.__version__, pliant.Extractor("deal").model_id)'
fi
in_root test -e /lib/systemd/system/pliant-server.service
mkdir -p "$root/var/lib/pliant"

sed "s/^listen.*/listen = \"127.0.0.1:$port\"/" "$root/etc/pliant/server.toml" >"$root/tmp/server.toml"
chroot "$root" pliant-server --config /tmp/server.toml >"$work/server.log" 2>&1 &  # not by in_root, whose shell would get the signal
server=$!
bash "$here/ask_server.sh" "http://127.0.0.1:$port" "$photographs/graf1.png" "$photographs/graf3.png" ||
  { cat "$work/server.log"; exit 1; }
kill "$server"
wait "$server" || true
server=
in_root apt-get -qq purge -y pliant >"$work/purge.log" 2>&1
in_root test -e /var/lib/pliant/pliant.db || { echo "purging the package removed the database" >&2; exit 1; }
echo "package: ok"
