#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Draws images of kinds that look alike: which of them are in a collection, and which are not?

    tests/accuracy/make_lookalikes.py --pliant build/release/bin/pliant --out lookalikes
    pliant eval retrieval lookalikes --layout pairs --absent lookalikes/absent --protocol default

The folder `gallery` gets `--indexed` images of each kind, and `query` a simulated photo of each. The folder `absent` gets
`--absent` further images of each kind and a simulated photo of each: no answer to them is right. Images of one kind
differ in their content only (letters, numbers, notes, rooms), but have the same layout, fonts or textures.
"""
import argparse
import pathlib
import shutil
import string
import subprocess
import tempfile

import cv2
import numpy as np

WORDS = ("cloth paper fold image model bend light point query place colour print index answer object smooth local time word of the and to in is "
         "that for it as was with be by on not this have from or had an they which one you were all there would their we him been has when who will "
         "more no if out so said what up about into than them can only other new some could these two first any my now such like our over even most "
         "made after also many before must through").split()


def page(width, height, value=250):
    return np.full((height, width, 3), value, np.uint8)


def write(image, text, x, y, size=0.5, colour=(20, 20, 20), weight=1, font=cv2.FONT_HERSHEY_SIMPLEX):
    cv2.putText(image, text, (int(x), int(y)), font, size, colour, weight, cv2.LINE_AA)


def words(random, count):
    return " ".join(random.choice(WORDS, count))


def number(random, least, most):
    return str(random.integers(least, most))


def text(random, _):
    image = page(620, 877)
    for y in range(50, 840, 22):
        write(image, words(random, 11)[:62], 40, y, 0.5, font=cv2.FONT_HERSHEY_COMPLEX)
    return image


def table(random, _):
    image = page(700, 500)
    for row in range(17):
        cv2.line(image, (30, 30 + 27 * row), (670, 30 + 27 * row), (150, 150, 150), 1)
        for column in range(8):
            label = "ABCDEFGH"[column] if row == 0 else f"{random.integers(0, 9999) / 10:.1f}"
            if row < 16:
                write(image, label, 38 + 80 * column, 50 + 27 * row, 0.5)
    for column in range(9):
        cv2.line(image, (30 + 80 * column, 30), (30 + 80 * column, 462), (150, 150, 150), 1)
    return image


def invoice(random, _):
    image = page(620, 877, 252)
    cv2.fillPoly(image, [np.array([[40, 40], [100, 60], [80, 120], [45, 100]])], (160, 90, 20))
    cv2.circle(image, (120, 78), 32, (40, 40, 200), 8)
    write(image, "NORTHWIND Trading", 170, 72, 0.9, (60, 20, 20), 2)
    write(image, "12 Harbour Street, tel. 040 1234567", 170, 98, 0.45, (80, 80, 80))
    write(image, "INVOICE", 45, 195, 1.0, weight=2)
    write(image, f"No. {number(random, 10000, 99999)}   {number(random, 1, 28)}/{number(random, 1, 12)}", 45, 228, 0.5)
    for column, title in enumerate(("Pos", "Article", "Quantity", "Price", "Total")):
        write(image, title, 45 + 110 * column, 284, 0.5, weight=2)
    lines = random.integers(4, 12)
    for row in range(13):
        cv2.line(image, (40, 295 + 34 * row), (580, 295 + 34 * row), (150, 150, 150), 1)
        if row < lines:
            values = (str(row + 1), words(random, 1), number(random, 1, 90), number(random, 1, 900), number(random, 1, 9000))
            for column, value in enumerate(values):
                write(image, value, 45 + 110 * column, 318 + 34 * row, 0.5)
    write(image, "Please pay within 14 days. Our general terms apply.", 45, 780, 0.45, (60, 60, 60))
    return image


def timetable(random, _):
    image = page(560, 800)
    write(image, "LINE 12  Central Station - Harbour", 30, 45, 0.7, (120, 40, 20), 2)
    for hour in range(5, 24):
        y = 80 + 36 * (hour - 5)
        cv2.rectangle(image, (30, y), (80, y + 30), (120, 40, 20), -1)
        write(image, f"{hour:02d}", 40, y + 22, 0.7, (255, 255, 255), 2)
        for k, minute in enumerate(sorted(random.choice(60, random.integers(3, 9), replace=False))):
            write(image, f"{minute:02d}", 95 + 52 * k, y + 22, 0.6)
    return image


def music(random, _):
    image = page(640, 820)
    for staff in range(7):
        top = 60 + 105 * staff
        for line in range(5):
            cv2.line(image, (30, top + 10 * line), (610, top + 10 * line), (30, 30, 30), 1)
        cv2.ellipse(image, (48, top + 22), (9, 22), 0, 0, 300, (20, 20, 20), 2)
        for k in range(17):
            x, y = 85 + 31 * k, top + 5 * random.integers(-2, 11)
            cv2.ellipse(image, (x, y), (6, 5), -20, 0, 360, (20, 20, 20), -1 if random.random() < 0.7 else 1)
            cv2.line(image, (x + 5, y), (x + 5, y - 32), (20, 20, 20), 1)
            if k % 4 == 3:
                cv2.line(image, (x + 16, top), (x + 16, top + 40), (30, 30, 30), 1)
    return image


def keyboard(random, _):
    image = page(800, 320, 60)
    keys = list(string.ascii_uppercase + string.digits + ".,-+#")
    random.shuffle(keys)
    for row in range(4):
        for column in range(10):
            x, y = 25 + 74 * column + 12 * row, 20 + 72 * row
            cv2.rectangle(image, (x, y), (x + 64, y + 62), (225, 225, 225), -1)
            cv2.rectangle(image, (x + 5, y + 3), (x + 59, y + 52), (245, 245, 245), -1)
            write(image, keys[row * 10 + column], x + 14, y + 30, 0.8, weight=2)
    return image


def brick(random, _):
    image = page(640, 640, 170)
    for row in range(16):
        for column in range(-1, 8):
            x, y = column * 88 + (row % 2) * 44, row * 40
            colour = np.array([60, 70, 150]) + random.integers(-18, 19, 3)
            cv2.rectangle(image, (x + 3, y + 3), (x + 84, y + 36), [int(c) for c in colour], -1)
    return cv2.add(image, random.integers(0, 14, image.shape).astype(np.uint8))


def lace(_, variant):
    image = page(600, 600, 60)
    petals, pitch = 3 + variant % 5, 48 + 3 * variant
    for y in range(0, 660, pitch):
        for x in range((y // pitch % 2) * pitch // 2, 660, pitch):
            for angle in np.arange(petals) * 2 * np.pi / petals:
                centre = (int(x + 0.28 * pitch * np.cos(angle)), int(y + 0.28 * pitch * np.sin(angle)))
                cv2.circle(image, centre, int(0.16 * pitch), (235, 235, 235), 2, cv2.LINE_AA)
    return image


def knit(random, variant):
    pitch = 22 + 2 * variant
    y, x = np.mgrid[0:600, 0:600]
    slope = pitch * 0.4 * np.abs((x / pitch) % 1 - 0.5) * 2
    value = 128 + 70 * np.sin(2 * np.pi * x / pitch) * np.sin(2 * np.pi * (y + slope) / (0.8 * pitch)) + random.normal(0, 6, x.shape)
    return cv2.cvtColor(value.clip(0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)


def board(random, variant):
    fields = 6 + variant
    dark, light = (int(random.integers(0, 70)), int(random.integers(180, 256)))
    value = np.where(np.indices((fields, fields)).sum(0) % 2, light, dark).astype(np.uint8)
    return cv2.cvtColor(cv2.resize(value, (600, 600), interpolation=cv2.INTER_NEAREST), cv2.COLOR_GRAY2BGR)


def code(random, _):
    cells = random.integers(0, 2, (29, 29))
    for y, x in ((0, 0), (0, 22), (22, 0)):
        cells[max(0, y - 1):y + 8, max(0, x - 1):x + 8] = 0
        cells[y:y + 7, x:x + 7] = 1
        cells[y + 1:y + 6, x + 1:x + 6] = 0
        cells[y + 2:y + 5, x + 2:x + 5] = 1
    cells[6, 8:21] = cells[8:21, 6] = np.arange(13) % 2 == 0
    value = np.pad(np.where(cells, 0, 255).astype(np.uint8), 4, constant_values=255)
    return cv2.cvtColor(cv2.resize(value, (592, 592), interpolation=cv2.INTER_NEAREST), cv2.COLOR_GRAY2BGR)


def bars(random, _):
    image = page(640, 320, 255)
    x = 40
    while x < 590:
        width = 3 * int(random.integers(1, 5))
        cv2.rectangle(image, (x, 20), (x + width - 1, 250), (0, 0, 0), -1)
        x += width + 3 * int(random.integers(1, 5))
    write(image, " ".join(str(digit) for digit in random.integers(0, 10, 13)), 120, 295, 1.0, weight=2)
    return image


def plate(random, _):
    image = page(620, 180, 245)
    cv2.rectangle(image, (4, 4), (615, 175), (0, 0, 0), 5)
    cv2.rectangle(image, (9, 9), (60, 170), (160, 50, 0), -1)
    letters = "".join(random.choice(list(string.ascii_uppercase), 4))
    write(image, f"{letters[:2]} {letters[2:]} {number(random, 100, 9999)}", 80, 118, 2.4, (0, 0, 0), 7, cv2.FONT_HERSHEY_DUPLEX)
    return image


def plan(random, _):
    image = page(700, 520)
    cv2.rectangle(image, (40, 40), (660, 480), (20, 20, 20), 8)
    columns = np.sort(random.choice(np.arange(120, 600, 40), 4, replace=False))
    rows = np.sort(random.choice(np.arange(120, 420, 40), 2, replace=False))
    for x in columns:
        cv2.line(image, (int(x), 40), (int(x), 480), (20, 20, 20), 6)
    for y in rows:
        cv2.line(image, (40, int(y)), (660, int(y)), (20, 20, 20), 6)
    for x in columns:
        door = int(random.choice(np.r_[60:460:40]))
        cv2.line(image, (int(x), door), (int(x), door + 40), (250, 250, 250), 8)
        cv2.ellipse(image, (int(x), door), (40, 40), 0, 0, 90, (90, 90, 90), 1)
    for x in (70, *(columns + 15)):
        write(image, f"{random.integers(8, 40)} m2", x, int(random.integers(70, 460)), 0.45)
    return image


KINDS = {f.__name__: f for f in (text, table, invoice, timetable, music, keyboard, brick, lace, knit, board, code, bars, plate, plan)}


def draw(folder, variants):
    """Each kind in these variants, which differ."""
    folder.mkdir(parents=True)
    for kind, (name, function) in enumerate(KINDS.items()):
        for variant in variants:
            image = function(np.random.default_rng(1000 * kind + variant), variant)
            cv2.imwrite(str(folder / f"{name}-{variant}.png"), image)


def photograph(pliant, flat, out):
    """A simulated photo of each image of `flat`, under its name."""
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        for i, image in enumerate(sorted(flat.iterdir())):
            one = pathlib.Path(scratch, "texture")
            shutil.rmtree(one, ignore_errors=True)
            one.mkdir()
            shutil.copy(image, one)
            scenes = pathlib.Path(scratch, "scenes")
            shutil.rmtree(scenes, ignore_errors=True)
            subprocess.run([pliant, "simulate", "--preset", "objects", "--textures", one, "--out", scenes, "--scenes", "1", "--views", "2",
                            "--first", str(i), "--colour", "--strength", "0.5"], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            shutil.copy(next(scenes.glob("*/view_01.jpg")), out / f"{image.stem}.jpg")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--out", required=True, type=pathlib.Path, metavar="DIR", help="folder for the images; must not exist")
    parser.add_argument("--pliant", default="pliant", metavar="BIN", help="the program `pliant` (default: %(default)s)")
    parser.add_argument("--indexed", type=int, default=4, help="images of each kind in the gallery (default: %(default)s)")
    parser.add_argument("--absent", type=int, default=5, help="further images of each kind (default: %(default)s)")
    options = parser.parse_args()
    draw(options.out / "gallery", range(options.indexed))
    photograph(options.pliant, options.out / "gallery", options.out / "query")
    draw(options.out / "flat", range(options.indexed, options.indexed + options.absent))
    photograph(options.pliant, options.out / "flat", options.out / "absent")
    for image in (options.out / "flat").iterdir():
        image.rename(options.out / "absent" / image.name)
    (options.out / "flat").rmdir()


if __name__ == "__main__":
    main()
