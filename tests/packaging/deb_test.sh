#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# Makes the Debian packages, installs `pliant` in a clean Debian and runs its service's command there.
#   deb_test.sh BUILD_DIR SOURCE_DIR WORK_DIR    needs root, mmdebstrap, curl, opencv-doc
set -euo pipefail
build=$(realpath "$1")
source=$(realpath "$2")
mkdir -p "$3"
work=$(realpath "$3")
here=$source/tests/packaging
root=$work/root
port=18438

(cd "$build" && rm -f ./pliant*.deb ./python3-pliant*.deb && cpack -G DEB >"$work/cpack.log") || { cat "$work/cpack.log"; exit 1; }
ls -l "$build"/*.deb

bash "$here/base_image.sh" "$work/debian.tar"
rm -rf "$root"
mkdir -p "$root"
tar -C "$root" -xf "$work/debian.tar"
cp /etc/resolv.conf "$root/etc/"
cp "$build"/pliant_*.deb "$root/tmp/pliant.deb"
packages=(/tmp/pliant.deb)
for python in "$build"/python3-pliant_*.deb; do # where the package was built
  [ -e "$python" ] && cp "$python" "$root/tmp/python3-pliant.deb" && packages+=(/tmp/python3-pliant.deb)
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

in_root sh -c 'apt-get -qq update && DEBIAN_FRONTEND=noninteractive apt-get -qq install -y --no-install-recommends "$@"' sh "${packages[@]}" \
  >"$work/apt.log" 2>&1 || { tail -20 "$work/apt.log"; exit 1; }
in_root pliant --version
if [ "${#packages[@]}" -gt 1 ]; then
  in_root python3 -c 'import pliant; print("python:", pliant.Extractor("deal").model_id)'
fi
in_root test -e /lib/systemd/system/pliant-server.service
mkdir -p "$root/var/lib/pliant"

sed "s/^listen.*/listen = \"127.0.0.1:$port\"/" "$root/etc/pliant/server.toml" >"$root/tmp/server.toml"
chroot "$root" pliant-server --config /tmp/server.toml >"$work/server.log" 2>&1 &  # not by in_root, whose shell would get the signal
server=$!
photographs=/usr/share/doc/opencv-doc/examples/data
bash "$here/ask_server.sh" "http://127.0.0.1:$port" "$photographs/graf1.png" "$photographs/graf3.png" ||
  { cat "$work/server.log"; exit 1; }
kill "$server"
wait "$server" || true
server=
in_root apt-get -qq purge -y pliant >"$work/purge.log" 2>&1
in_root test -e /var/lib/pliant/pliant.db || { echo "purging the package removed the database" >&2; exit 1; }
echo "package: ok"
