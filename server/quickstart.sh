#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# From a clone to the first answer: installs packages, builds, indexes demonstration images,
# starts the server, asks it one question and says what to look at. About 12 minutes on two cores.
#   --once         end after the question instead of leaving the server running
#   --data DIR     where to keep the demonstration data (default: build/quickstart-data)
#   --port N       port of the server (default: 8080; 0 = any free one)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

once=false
data=build/quickstart-data
port=8080
while [ $# -gt 0 ]; do
  case $1 in
    --once) once=true ;;
    --data) data=${2:?--data needs a directory}; shift ;;
    --port) port=${2:?--port needs a number}; shift ;;
    *) echo "usage: quickstart.sh [--once] [--data DIR] [--port N]" >&2; exit 2 ;;
  esac
  shift
done

step() { printf '\n== %s\n' "$1"; }

step "1/5 Packages (a minute)"
bash docker/install-packages.sh build demo

# Twenty minutes of one core; again at once, because only what has changed is compiled.
step "2/5 Build (about $((20 / $(nproc) + 1)) minutes on $(nproc) cores; the counter shows how far it is)"
cmake --preset quickstart
NINJA_STATUS='[%f of %t, %e s] ' cmake --build --preset quickstart
bin=build/quickstart/bin

step "3/5 Index the demonstration images (six flat objects; seconds)"
mkdir -p "$data/objects" "$data/queries"
for crumpled in server/web/demo/*-crumpled.jpg; do  # a photo of the object NAME.jpg, never indexed
  name=$(basename "$crumpled" -crumpled.jpg)
  cp "server/web/demo/$name.jpg" "$data/objects/"
  cp "$crumpled" "$data/queries/$name.jpg"
done
"$bin/pliant" index "$data/objects" --db "$data/demo.db"

step "4/5 Start the server"
log=$data/server.log
"$bin/pliant-server" --db "$data/demo.db" --listen "127.0.0.1:$port" >"$log" 2>&1 &
server=$!
trap 'kill "$server" 2>/dev/null; wait "$server" 2>/dev/null || true' EXIT
address=
for _ in $(seq 100); do
  address=$(grep -oE 'http://127\.0\.0\.1:[0-9]+' "$log" | head -n 1 || true)
  [ -n "$address" ] && curl -fsS -o /dev/null "$address/readyz" 2>/dev/null && break
  kill -0 "$server" 2>/dev/null || { echo "The server did not start:" >&2; cat "$log" >&2; exit 1; }
  sleep 0.1
done
[ -n "$address" ] || { echo "The server did not become ready:" >&2; cat "$log" >&2; exit 1; }
echo "The server answers at $address (log: $log)"

step "5/5 Ask: which object is this? ($data/queries/town-map.jpg, a photo of a crumpled map)"
curl -fsS -F "image=@$data/queries/town-map.jpg" -F limit=3 \
  "$address/v1/collections/default/search" | python3 -c '
import json, sys
answer = json.load(sys.stdin)
for hit in answer["hits"]:
    print("  {rank}. {object:<20} score {score:.3f}".format(**hit))
print("  answered in {:.0f} ms".format(answer["took_ms"]))
if not answer["hits"] or answer["hits"][0]["object"] != "town-map":
    sys.exit("expected town-map first")
'

cat <<TEXT

Look at:
  $address/                 the web page: drop one of $data/queries/* on it, or your own photo
  $bin/pliant query $data/queries/newspaper.jpg --db $data/demo.db
TEXT
if ! $once; then
  echo "The server runs until you press Ctrl-C."
  wait "$server"
fi
