#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
# demo_images.sh DIR: lays out demonstration images in DIR, from the photographs that Debian's
# opencv-doc package ships: DIR/objects/<object>/*, one or more views of each object, and
# DIR/queries/<object>.*, another view of it that is never indexed.
set -euo pipefail
target=${1:?usage: demo_images.sh DIR}
photos=/usr/share/doc/opencv-doc/examples/data
[ -d "$photos" ] || {
  echo "No photographs in $photos: install Debian's opencv-doc package." >&2
  exit 1
}

place() { # place SOURCE TARGET
  [ -f "$photos/$1" ] || {
    echo "$photos/$1 is missing: this version of opencv-doc ships other images." >&2
    exit 1
  }
  mkdir -p "$(dirname "$target/$2")"
  cp "$photos/$1" "$target/$2"
}

# Objects with a second view: the first is indexed, the second is asked for.
place graf1.png objects/graffiti-wall/front.png
place graf3.png queries/graffiti-wall.png
place box.png objects/cracker-box/front.png
place box_in_scene.png queries/cracker-box.png
place leuvenA.jpg objects/university-hall/left.jpg
place leuvenB.jpg queries/university-hall.jpg
place aloeL.jpg objects/aloe-plant/left.jpg
place aloeR.jpg queries/aloe-plant.jpg
place basketball1.png objects/basketball-court/first.png
place basketball2.png queries/basketball-court.png
place rubberwhale1.png objects/rubber-whale/first.png
place rubberwhale2.png queries/rubber-whale.png
place Blender_Suzanne1.jpg objects/monkey-head/front.jpg
place Blender_Suzanne2.jpg queries/monkey-head.jpg

# Others to be told apart from.
for photo in apple baboon board building butterfly fruits home messi5 orange squirrel_cls \
  starry_night stuff; do
  place "$photo.jpg" "objects/$photo/photo.jpg"
done
for photo in blox.jpg cards.png smarties.png sudoku.png; do
  place "$photo" "objects/${photo%.*}/photo.${photo##*.}"
done
