#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What `pliant match --colmap` writes, COLMAP reconstructs: the cameras that took the images of two
textured walls are found where they were.

    colmap_test.py --bin DIR

The schema and the rows are checked everywhere; what COLMAP makes of them where it is installed
(Debian's package colmap).
"""
import argparse
import json
import os
import pathlib
import re
import shutil
import sqlite3
import subprocess
import sys
import tempfile

import cv2
import numpy as np

WIDTH, HEIGHT, FOCAL = 480, 360, 560.0
VIEWS = 6
MOST_PAIRS = 2147483647


def texture(seed):
    """Blots of many sizes, [512, 512] uint8."""
    random = np.random.RandomState(seed)
    canvas = np.full((512, 512), 128, np.uint8)
    for _ in range(900):
        centre = tuple(int(v) for v in random.randint(0, 512, 2))
        radius = int(np.exp(random.uniform(np.log(3), np.log(28))))
        cv2.circle(canvas, centre, radius, int(random.randint(256)), -1, cv2.LINE_AA)
    return cv2.GaussianBlur(canvas, (0, 0), 1.0)


def camera(number):
    """Rotation and centre of a camera that looks at the corner of the walls."""
    angle = np.radians(-22 + 44 * number / (VIEWS - 1))
    centre = np.array([4.2 * np.sin(angle), 0.35 * np.cos(3 * angle) - 0.2, -4.2 * np.cos(angle)])
    forward = -centre / np.linalg.norm(centre)
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward]), centre


def render(number, textures):
    """Two walls that meet in the axis y, each 2 x 2.4, from camera `number`."""
    rotation, centre = camera(number)
    intrinsic = np.array([[FOCAL, 0, WIDTH / 2 - 0.5], [0, FOCAL, HEIGHT / 2 - 0.5], [0, 0, 1]])
    image = np.full((HEIGHT, WIDTH), 90, np.uint8)
    for side, wall in zip((-1, 1), textures):
        # Pixel (u, v) of the texture lies at along * u / 512 + (0, 2.4 v / 512 - 1.2, 0).
        along = np.array([2.0 * side, 0.0, -0.9])
        frame = np.stack([along / 512, [0, 2.4 / 512, 0], [0, -1.2, 0]], axis=1)
        frame[:, 2] -= centre
        homography = intrinsic @ rotation @ frame
        inside = np.full(wall.shape, 255, np.uint8)
        size = (WIDTH, HEIGHT)
        mask = cv2.warpPerspective(inside, homography, size)
        seen = cv2.warpPerspective(wall, homography, size, flags=cv2.INTER_AREA)
        image[mask > 127] = seen[mask > 127]
    return image


def run(command, expected=0):
    environment = dict(os.environ, QT_QPA_PLATFORM="offscreen")
    done = subprocess.run([str(word) for word in command], env=environment, capture_output=True, text=True,
                          check=False, timeout=500)
    if done.returncode != expected:
        sys.exit(f"{command} ended with {done.returncode}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}")
    return done


def require(condition, what):
    if not condition:
        sys.exit(f"colmap_test: {what}")


def rows_of(database):
    with sqlite3.connect(database) as connection:
        images = connection.execute("SELECT image_id, name FROM images ORDER BY image_id").fetchall()
        points = {number: np.frombuffer(data, np.float32).reshape(rows, cols) for number, rows, cols, data in
                  connection.execute("SELECT * FROM keypoints")}
        matches = {(pair // MOST_PAIRS, pair % MOST_PAIRS): np.frombuffer(data or b"", np.uint32).reshape(rows, cols)
                   for pair, rows, cols, data in connection.execute("SELECT * FROM matches")}
        cameras = connection.execute("SELECT model, width, height, params FROM cameras").fetchall()
    return images, points, matches, cameras


def check_rows(database, views, pliant):
    """The database holds what `match --json` says."""
    images, points, matches, cameras = rows_of(database)
    require([name for _, name in images] == [f"{i}.png" for i in range(VIEWS)], f"images {images}")
    require(sorted(matches) == [(a + 1, b + 1) for a in range(VIEWS) for b in range(a + 1, VIEWS)], "pairs")
    require(len(cameras) == 1 and cameras[0][:3] == (2, WIDTH, HEIGHT), f"cameras {cameras}")
    parameters = np.frombuffer(cameras[0][3], np.float64)
    require(np.allclose(parameters, [1.2 * WIDTH, WIDTH / 2, HEIGHT / 2, 0]), f"camera {parameters}")
    told = json.loads(run([pliant, "match", views / "0.png", views / "1.png", "--json"]).stdout)
    for number in (0, 1):
        require(np.allclose(points[number + 1], np.array(told["positions"][number]) + 0.5, atol=1e-3), "keypoints")
    require(np.array_equal(matches[1, 2], np.array(told["matches"], np.float64)[:, :2].astype(np.uint32)), "matches")


def same_schema(ours, theirs):
    def columns(database):
        with sqlite3.connect(database) as connection:
            tables = [name for name, in connection.execute("SELECT name FROM sqlite_master WHERE type='table'")]
            return {table: connection.execute(f"PRAGMA table_info({table})").fetchall() for table in tables}
    mine, other = columns(ours), columns(theirs)
    for table, expected in other.items():
        require(mine.get(table) == expected, f"table {table}: {mine.get(table)}, COLMAP's is {expected}")


def centres_of(model):
    """Name -> centre, of a model as text: IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, every other line."""
    lines = [line for line in (model / "images.txt").read_text().splitlines() if not line.startswith("#")]
    centres = {}
    for line in lines[::2]:
        words = line.split()
        w, x, y, z = (float(word) for word in words[1:5])
        rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                             [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                             [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])
        centres[words[9]] = -rotation.T @ np.array([float(word) for word in words[5:8]])
    return centres


def worst_distance(found, truth):
    """Largest distance after the best similarity (Umeyama 1991), as a share of the cameras' spread."""
    x, y = found - found.mean(0), truth - truth.mean(0)
    left, scales, right = np.linalg.svd(y.T @ x)
    sign = np.diag([1, 1, np.sign(np.linalg.det(left @ right))])
    scale = np.trace(np.diag(scales) @ sign) / (x ** 2).sum()
    away = np.linalg.norm(scale * x @ (left @ sign @ right).T - y, axis=1)
    return away.max() / np.linalg.norm(y, axis=1).max()


def reconstruct(work, database, views):
    version = re.search(r"COLMAP (\d+\.\d+)", run(["colmap", "help"]).stdout)
    if version and version.group(1) == "3.8":  # later ones make other tables, and read these
        run(["colmap", "database_creator", "--database_path", work / "theirs.db"])
        same_schema(database, work / "theirs.db")
    run(["colmap", "exhaustive_matcher", "--database_path", database, "--SiftMatching.use_gpu", "0"])
    with sqlite3.connect(database) as connection:
        verified = connection.execute("SELECT count(*), sum(rows) FROM two_view_geometries WHERE rows > 0").fetchone()
    print(f"COLMAP confirms {verified[1]} matches of {verified[0]} pairs")
    require(verified[0] >= VIEWS, "COLMAP confirms too few pairs")
    models = work / "models"
    models.mkdir()
    run(["colmap", "mapper", "--database_path", database, "--image_path", views, "--output_path", models,
         "--Mapper.min_model_size", VIEWS])
    text = work / "text"
    text.mkdir()
    run(["colmap", "model_converter", "--input_path", models / "0", "--output_path", text, "--output_type", "TXT"])
    centres = centres_of(text)
    require(len(centres) == VIEWS, f"of {VIEWS} images COLMAP places {sorted(centres)}")
    worst = worst_distance(np.array([centres[f"{i}.png"] for i in range(VIEWS)]),
                           np.array([camera(i)[1] for i in range(VIEWS)]))
    print(f"cameras lie within {100 * worst:.1f} % of where they were")
    require(worst < 0.05, "the cameras are not where they were")


def check_wrong_use(work, views, pliant, database):
    def refused(words, status, code):
        answer = json.loads(run([pliant, "match", *words, "--json"], status).stdout)
        require(answer["error"]["code"] == code, f"{words}: {answer}")
    refused([views, "--colmap", database], 1, "file_exists")
    refused([views, "--colmap", work / "nowhere" / "x.db"], 1, "no_such_directory")
    one = work / "one"
    one.mkdir()
    shutil.copy(views / "0.png", one)
    refused([one, "--colmap", work / "x.db"], 2, "too_few_images")
    (one / "broken.png").write_bytes((views / "1.png").read_bytes()[:500])
    refused([one, "--colmap", work / "x.db"], 2, "too_few_images")
    cv2.imwrite(str(one / "other.png"), cv2.imread(str(views / "2.png"))[:300])
    refused([one, "--colmap", work / "x.db", "--one-camera"], 2, "sizes_vary")
    done = run([pliant, "match", one, "--colmap", work / "x.db", "--json"], 3)
    require(json.loads(done.stdout)["skipped"][0]["file"] == "broken.png", done.stdout)
    require(len(rows_of(work / "x.db")[3]) == 2, "a camera an image")
    pairs = work / "pairs.txt"
    for text in ("", "0.png", "0.png 0.png", "0.png 9.png", "0.png 1.png 2.png"):
        pairs.write_text(f"# two a line\n{text}\n")
        refused([views, "--colmap", work / "y.db", "--pairs", pairs], 2, "pairs_invalid")
    refused([views, "--colmap", work / "y.db", "--pairs", work], 1, "cannot_read")
    pairs.write_text("0.png 1.png\n\n3.png 2.png\n2.png 3.png\n")
    run([pliant, "match", views, "--colmap", work / "y.db", "--pairs", pairs, "--verify", "--descriptor", "rootsift"])
    require(sorted(rows_of(work / "y.db")[2]) == [(1, 2), (3, 4)], "the pairs named")
    run([pliant, "match", views / "0.png", views / "1.png", "--colmap", work / "z.db", "--descriptor", "orb"])
    require([name for _, name in rows_of(work / "z.db")[0]] == ["0.png", "1.png"], "two images")
    run([pliant, "match", views / "0.png", "--colmap", work / "w.db", "--draw", "w.png"], 2)
    run([pliant, "match", views], 2)
    left = [path.name for path in work.iterdir() if ".new-" in path.name or path.name == "w.db"]
    require(not left, f"left over: {left}")


def check_turned(work, views, pliant):
    """Keypoints lie in the pixels as they are stored, whatever EXIF says: COLMAP does not turn images."""
    image = cv2.imread(str(views / "0.png"))
    folder = work / "turned"
    for orientation in (1, 6, 8):
        (folder / str(orientation)).mkdir(parents=True)
        data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
        exif = (b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0" + bytes([orientation]) + bytes(7))
        segment = b"\xff\xe1" + (len(exif) + 2).to_bytes(2, "big") + exif
        for name in ("a.jpg", "b.jpg"):
            (folder / str(orientation) / name).write_bytes(data[:2] + segment + data[2:])
    run([pliant, "match", folder, "--colmap", work / "turned.db", "--descriptor", "rootsift"])
    images, points, _, cameras = rows_of(work / "turned.db")
    require(all(row[1:3] == (WIDTH, HEIGHT) for row in cameras), "sizes as stored")
    sets = {name: points[number] for number, name in images}
    for name in ("6/a.jpg", "8/a.jpg"):
        distances = np.linalg.norm(sets[name][:, None] - sets["1/a.jpg"][None], axis=2).min(1)
        require((distances < 1.5).mean() > 0.8, f"{name}: {(distances < 1.5).mean():.2f} of the keypoints are in place")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    options = parser.parse_args()
    pliant = options.bin.resolve() / "pliant"
    with tempfile.TemporaryDirectory() as name:
        work = pathlib.Path(name)
        views = work / "views"
        views.mkdir()
        textures = [texture(1), texture(2)]
        for i in range(VIEWS):
            cv2.imwrite(str(views / f"{i}.png"), render(i, textures))
        database = work / "views.db"
        print(run([pliant, "match", views, "--colmap", database, "--one-camera"]).stdout, end="")
        check_rows(database, views, pliant)
        check_wrong_use(work, views, pliant, database)
        check_turned(work, views, pliant)
        if shutil.which("colmap") is None:
            print("skipped: COLMAP is not installed, so what it makes of the database was not tried "
                  "(bash docker/install-packages.sh peers)")
            sys.exit(77)
        reconstruct(work, database, views)


if __name__ == "__main__":
    main()
