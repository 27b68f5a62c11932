#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# demo_images.sh DIR: copies demonstration images to DIR, from the photographs in Debian's
# opencv-doc package: DIR/objects/<object>/*, one view of each object, and DIR/queries/<object>.*,
# another view that is never indexed.
set -euo pipefail
target=${1:?usage: demo_images.sh DIR}
photos=/usr/share/doc/opencv-doc/examples/data
[ -d "$photos" ] || {
  echo "No photographs in $photos: install Debian's opencv-doc package." >&2
  exit 1
}

place() { # place SOURCE TARGET
  [ -f "$photos/$1" ] || {
    echo "$photos/$1 is missing: this version of opencv-doc has other images." >&2
    exit 1
  }
  mkdir -p "$(dirname "$target/$2")"
  cp "$photos/$1" "$target/$2"
}

# Objects with a second view: the first is indexed, the second is the query.
while read -r object view first second; do
  place "$first" "objects/$object/$view.${first##*.}"
  place "$second" "queries/$object.${second##*.}"
done <<'EOF'
graffiti-wall front graf1.png graf3.png
cracker-box front box.png box_in_scene.png
university-hall left leuvenA.jpg leuvenB.jpg
aloe-plant left aloeL.jpg aloeR.jpg
basketball-court first basketball1.png basketball2.png
rubber-whale first rubberwhale1.png rubberwhale2.png
monkey-head front Blender_Suzanne1.jpg Blender_Suzanne2.jpg
EOF

# Other objects.
for photo in apple baboon board building butterfly fruits home messi5 orange squirrel_cls \
  starry_night stuff; do
  place "$photo.jpg" "objects/$photo/photo.jpg"
done
for photo in blox.jpg cards.png smarties.png sudoku.png; do
  place "$photo" "objects/${photo%.*}/photo.${photo##*.}"
done
