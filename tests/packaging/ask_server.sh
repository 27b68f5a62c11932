#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# ask_server.sh URL IMAGE OTHER_VIEW: waits until the server is ready, adds IMAGE and two decoys
# made of noise, and asks with OTHER_VIEW; fails unless the answer is IMAGE's object.
set -euo pipefail
url=$1 image=$2 other=$3
for _ in $(seq 300); do
  curl -fsS -o /dev/null "$url/readyz" 2>/dev/null && break
  sleep 0.2
done
curl -fsS "$url/readyz" >/dev/null
images=$url/v1/collections/default/images
curl -fsS -F "image=@$image" -F object=wanted "$images" >/dev/null
for decoy in $(dirname "$image")/{box,home,butterfly}.*; do
  [ -e "$decoy" ] && curl -fsS -F "image=@$decoy" -F object=decoy "$images" >/dev/null
done
for _ in $(seq 30); do # the first vocabulary is trained when uploads pause
  answer=$(curl -sS -F "image=@$other" "$url/v1/collections/default/search")
  grep -q '"hits"' <<<"$answer" && break
  sleep 1
done
echo "$answer" | python3 -c '
import json, sys
hits = json.load(sys.stdin)["hits"]
print("first:", hits[0]["object"], hits[0]["score"], "inliers:", hits[0]["inliers"])
sys.exit(hits[0]["object"] != "wanted")'
