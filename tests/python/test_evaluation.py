#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Keypoints and descriptors of another program, here OpenCV's SIFT: in the benchmarks, and in an index."""
import json
import os
import pathlib
import subprocess
import sys
import unittest

import cv2
import h5py
import numpy as np

import pliant
from support import BIN, FolderCase, other_view, pattern, run

EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "python" / "examples"


def sift(image):
    if not isinstance(image, np.ndarray):
        image = cv2.imread(os.fspath(image), cv2.IMREAD_GRAYSCALE)
    keypoints, descriptors = cv2.SIFT_create(400).detectAndCompute(image, None)
    return pliant.Features.from_cv(keypoints, descriptors, image.shape[1], image.shape[0], "opencv-sift")


def figures(rows, *names):
    return [[row["descriptor"], *(row[name] for name in names)] for row in rows]


class Benchmarks(FolderCase):
    def save(self, root, compressed=False):
        """FOLDER/IMAGE.npz of each image below `root`."""
        for image in [*root.rglob("*.png"), *root.rglob("*.jpg")]:
            if image.name.endswith(".uv.png"):
                continue
            out = self.folder / "features" / f"{image.relative_to(root)}.npz"
            out.parent.mkdir(parents=True, exist_ok=True)
            sift(image).save(out)
            if compressed:
                with np.load(out) as arrays:
                    np.savez_compressed(out, **arrays)
        return f"opencv={self.folder / 'features'}"

    def test_matching(self):
        data = self.folder / "pairs"
        pliant.simulate("procedural", data, preset="pairs", format="folders", scenes=2, views=2, width=400, height=300, seed=4)
        rows = pliant.evaluate_matching(data, sift, name="opencv", descriptors=["sift"], max_keypoints=300)
        self.assertEqual([row["descriptor"] for row in rows], ["sift", "opencv"])
        self.assertGreater(rows[1]["ms"], 0.6 * rows[0]["ms"])  # nearly the same method, at nearly the same keypoints
        self.assertLess(rows[1]["keypoints"], 301)
        from_files = run("eval", "matching", data, "--descriptor", "sift", "--keypoints", "300", "--features", self.save(data), "--json")
        names = ("ms", "mma", "correct_matches", "keypoints", "true_pairs", "pairs")
        self.assertEqual(figures(from_files["results"], *names), figures(rows, *names))
        worse = pliant.evaluate_matching(data, lambda path: shuffled(sift(path)), descriptors=["sift"], max_keypoints=300)
        self.assertLess(worse[1]["ms"], 0.2 * rows[1]["ms"])

    def test_retrieval(self):
        data = self.folder / "objects"
        pliant.simulate("procedural", data, preset="objects", format="folders", scenes=4, views=2, width=320, height=240, seed=6)
        rows = pliant.evaluate_retrieval(data, sift, name="opencv", descriptors=["sift"], protocols=["paper", "default"])
        self.assertEqual(figures(rows, "protocol"), [["sift", "paper"], ["sift", "default"], ["opencv", "paper"], ["opencv", "default"]])
        self.assertGreaterEqual(rows[3]["top1"], 0.75)
        from_files = run("eval", "retrieval", data, "--descriptor", "sift", "--seeds", "1", "--features", self.save(data, compressed=True),
                         "--json")
        names = ("protocol", "words", "top1", "map", "accuracy_at", "refused_queries")
        self.assertEqual(figures(from_files["results"], *names), figures(rows, *names))

    def test_errors(self):
        data = self.folder / "pairs"
        pliant.simulate("procedural", data, preset="pairs", format="folders", scenes=1, views=2, width=320, height=240)

        def fail(path):
            raise ZeroDivisionError(path)

        with self.assertRaisesRegex(ZeroDivisionError, "view_0"):
            pliant.evaluate_matching(data, fail)
        with self.assertRaisesRegex(TypeError, "describe must return Features"):
            pliant.evaluate_matching(data, lambda path: None)
        self.assertIn("give NAME=FOLDER", self.refused(data, "opencv"))
        (self.folder / "empty").mkdir()
        self.assertRegex(self.refused(data, f"opencv={self.folder / 'empty'}"), r"scene_\d+/view_0\d\.png\.npz")
        pliant.simulate("procedural", self.folder / "tensors", preset="pairs", format="tensors", scenes=1, views=2, width=320, height=240)
        self.assertIn("no image files", self.refused(self.folder / "tensors", f"opencv={self.folder / 'empty'}"))

    def refused(self, data, features):
        done = subprocess.run([BIN / "pliant", "eval", "matching", data, "--descriptor", "sift", "--features", features],
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, timeout=100)
        self.assertNotEqual(done.returncode, 0)
        return done.stderr

    def test_nonrigid_submission(self):
        root = self.folder / "set"
        images = [pattern(3, 320, 240), other_view(3, 320, 240)]
        for number, image in enumerate(images):
            folder = root / f"test_sequence_000/scenario_00{number}"
            folder.mkdir(parents=True)
            cv2.imwrite(str(folder / "rgba_00000.png"), image)
        first, second = (f"test_sequence_000/scenario_00{number}/rgba_00000.png" for number in (0, 1))
        (root / "selected_pairs.json").write_text(json.dumps({"scale_1": [[first, second], ["/" + second, first]], "scale_2": [[first, first]]}))
        subprocess.run([sys.executable, EXAMPLES / "nonrigid_submission.py", root, self.folder / "out"], check=True, timeout=100)
        there, back = json.loads((self.folder / "out/scale_1.json").read_text())
        self.assertEqual((there["keypoints1"], there["keypoints2"]), (back["keypoints2"], back["keypoints1"]))
        self.assertGreater(len(there["matches"]), 20)
        self.assertEqual(sorted(there["matches"]), sorted([a, b] for b, a in back["matches"]))
        (same,) = json.loads((self.folder / "out/scale_2.json").read_text())
        self.assertEqual(same["matches"], [[i, i] for i in range(len(same["keypoints1"]))])

    def test_hloc(self):
        file = self.folder / "feats-superpoint.h5"
        with h5py.File(file, "w") as features:
            group = features.create_group("db/one.jpg")
            group["keypoints"] = np.array([[1, 2], [30, 40]], np.float16)
            group["scores"] = np.array([0.5, 0.25], np.float16)
            group["descriptors"] = np.arange(6, dtype=np.float16).reshape(3, 2)  # D x N
            group["image_size"] = np.array([64, 48])
        subprocess.run([sys.executable, EXAMPLES / "hloc_to_npz.py", file, self.folder / "out"], check=True, timeout=100)
        features = pliant.Features.load(self.folder / "out" / "db" / "one.jpg.npz")
        np.testing.assert_array_equal(features.keypoints[:, [0, 1, 4]], [[1, 2, 0.5], [30, 40, 0.25]])
        np.testing.assert_array_equal(features.descriptors, [[0, 2, 4], [1, 3, 5]])
        self.assertEqual((features.width, features.height, features.model_id), (64, 48, "feats-superpoint"))


def shuffled(features):
    rows = np.random.default_rng(1).permutation(len(features))
    return pliant.Features(features.keypoints, features.descriptors[rows], features.width, features.height, features.model_id)


class Index(FolderCase):
    def test_own_descriptor(self):
        path = self.folder / "own.db"
        shop = {f"object {seed}": sift(pattern(seed, 320, 240)) for seed in range(4)}
        with pliant.Index(path, descriptor=shop["object 0"]) as index:
            for name, features in shop.items():
                self.assertEqual(index.add(features, object=name, source=f"{name}.png").outcome, "created")
            again = index.add(shop["object 1"], object="object 1")
            self.assertEqual(again.outcome, "unchanged")
            self.assertEqual((again.width, again.height, again.keypoints), (320, 240, len(shop["object 1"])))
            index.train(words=16)
            with self.assertRaises(pliant.NotFoundError) as raised:
                index.content(again.id)
            self.assertEqual(raised.exception.code, "content_not_kept")
            with self.assertRaises(pliant.UnprocessableError) as raised:
                index.add(pattern(9))
            self.assertEqual(raised.exception.code, "described_elsewhere")
            with self.assertRaises(pliant.ConflictError) as raised:
                index.add(pliant.describe(pattern(9), descriptor="sift"))
            self.assertEqual(raised.exception.code, "model_mismatch")
            narrow = pliant.Features(shop["object 0"].keypoints, shop["object 0"].descriptors[:, :64], 320, 240, "opencv-sift")
            with self.assertRaises(pliant.ConflictError):
                index.add(narrow)
        with pliant.Index(path) as index:  # the database knows its form
            self.assertEqual(index.search(sift(other_view(2, 320, 240)))[0].object, "object 2")
            self.assertEqual(index.check(), [])
            many = pliant.Features(np.ones((4097, 6)), np.ones((4097, 128), np.float32), 320, 240, "opencv-sift")
            with self.assertRaisesRegex(pliant.InvalidArgumentError, "at most 4096 keypoints, not 4097"):
                index.add(many)
        self.assertEqual(run("db", "stats", "--db", path, "--json")["images"], 4)

    def test_features_of_pliant(self):
        with pliant.Index(self.folder / "a.db", descriptor="sift") as index:
            features = pliant.describe(pattern(1), descriptor="sift")
            self.assertEqual(index.add(features, id="one").outcome, "created")
            self.assertEqual(index.add(pattern(2), id="two").outcome, "created")
            self.assertEqual(len(index.features("one")), len(features))


if __name__ == "__main__":
    unittest.main()
