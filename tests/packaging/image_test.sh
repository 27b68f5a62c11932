#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# Builds docker/Dockerfile with buildah (no Docker engine needed) on a base image of our own, runs it as
# its own user without writing to its root file system, and asks it a question.
#   image_test.sh SOURCE_DIR WORK_DIR    needs root, buildah, mmdebstrap, curl, opencv-doc
set -euo pipefail
source=$(realpath "$1")
mkdir -p "$2"
work=$(realpath "$2")
here=$source/tests/packaging
base=localhost/pliant-test-base
image=localhost/pliant-test
limit_mb=300
port=18437
export BUILDAH_ISOLATION=chroot STORAGE_DRIVER=vfs

bash "$here/base_image.sh" "$work/debian.tar"
if ! buildah images -q "$base" >/dev/null 2>&1; then
  container=$(buildah from scratch)
  buildah add -q "$container" "$work/debian.tar" /
  buildah commit -q "$container" "$base"
  buildah rm "$container" >/dev/null
fi
buildah build --build-arg "DEBIAN=$base" --ignorefile "$source/.dockerignore" \
  -f "$source/docker/Dockerfile" -t "$image" "$source"

container=$(buildah from "$image")
root=$(buildah mount "$container")
server=
finish() {
  if [ -n "$server" ]; then
    kill "$server" 2>/dev/null || true
    wait "$server" 2>/dev/null || true
  fi
  buildah umount "$container" >/dev/null
  buildah rm "$container" >/dev/null
}
trap finish EXIT

megabytes=$(du -sm "$root" | cut -f 1)
echo "size: $megabytes MB (at most $limit_mb)"
[ "$megabytes" -le "$limit_mb" ]

user=$(buildah inspect --format '{{.OCIv1.Config.User}}' "$container")
echo "user: $user"
case $user in '' | 0 | 0:* | root*) echo "the image runs as root" >&2; exit 1 ;; esac

touch "$work/started"
chown "$user" "$root/data" "$root/backups"
buildah run --env PLIANT_ALLOW_ANONYMOUS=true --env PLIANT_BACKUP_DIR=/backups "$container" -- \
  /usr/bin/pliant-server --db /data/pliant.db --listen "127.0.0.1:$port" >"$work/server.log" 2>&1 &
server=$!
photographs=/usr/share/doc/opencv-doc/examples/data
bash "$here/ask_server.sh" "http://127.0.0.1:$port" "$photographs/graf1.png" "$photographs/graf3.png" ||
  { cat "$work/server.log"; exit 1; }
# The health check as the Dockerfile says it, but for the port.
mapfile -d '' -t health < <(python3 -c '
import json, re, sys
command = json.loads(re.search(r"HEALTHCHECK[^[]*(\[.*\])", open(sys.argv[1]).read())[1])
print("\0".join(command).replace("8080", sys.argv[2]), end="\0")' "$source/docker/Dockerfile" "$port")
buildah run "$container" -- "${health[@]}"

# A backup, restored by the image itself.
curl -fsS -X POST -H 'Content-Type: application/json' -d '{"name": "a.db"}' "http://127.0.0.1:$port/v1/backups" -o "$work/job.json"
job=$(python3 -c 'import json, sys; print(json.load(open(sys.argv[1]))["id"])' "$work/job.json")
curl -fsS "http://127.0.0.1:$port/v1/jobs/$job?wait=60" | grep -q '"state":"done"'
kill "$server"
wait "$server" || true
buildah run "$container" -- /usr/bin/pliant db restore /backups/a.db --db /data/pliant.db --replace
buildah run "$container" -- /usr/bin/pliant db check --db /data/pliant.db

openssl req -x509 -newkey rsa:2048 -nodes -keyout "$root/data/key.pem" -out "$root/data/cert.pem" -days 2 -subj /CN=images.example 2>/dev/null
chown "$user" "$root"/data/*.pem
buildah run --env PLIANT_ALLOW_ANONYMOUS=true "$container" -- /usr/bin/pliant-server --db /data/pliant.db \
  --listen "127.0.0.1:$port" --tls-cert /data/cert.pem --tls-key /data/key.pem >>"$work/server.log" 2>&1 &
server=$!
curl -fsSk --retry 60 --retry-delay 1 --retry-all-errors -o /dev/null "https://127.0.0.1:$port/readyz"
buildah run "$container" -- "${health[@]}"

written=$(find "$root" -xdev \( -path "$root/data" -o -path "$root/backups" -o -path "$root/tmp" -o -path "$root/proc" -o -path "$root/dev" \
  -o -path "$root/run" -o -path "$root/etc" \) -prune -o -type f -newer "$work/started" -print)
[ -z "$written" ] || { echo "written outside /data: $written" >&2; exit 1; }
echo "image: ok"
