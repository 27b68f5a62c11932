#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Keypoints and descriptors: the same as the command line's, from whatever form of image."""
import os
import pickle
import unittest

import cv2
import numpy as np

import pliant
from support import FolderCase, pattern, png, run


class Describe(FolderCase):
    def test_same_as_command_line(self):
        path = self.write("a.png", pattern(1))
        for descriptor, kind, dim in (("deal", np.float32, 64), ("deal-small", np.float32, 64), ("sift", np.float32, 128), ("orb", np.uint8, 32)):
            out = self.folder / f"{descriptor}.npz"
            said = run("describe", path, "--descriptor", descriptor, "--out", out, "--jobs", "1", "--json")
            with np.load(out) as theirs:
                ours = pliant.describe(path, descriptor=descriptor, threads=1)
                np.testing.assert_array_equal(ours.keypoints, theirs["keypoints"])
                np.testing.assert_array_equal(ours.descriptors, theirs["descriptors"])
                self.assertEqual((ours.width, ours.height, ours.model_id),
                                 (theirs["width"], theirs["height"], str(theirs["model_id"])))
            self.assertEqual(said["keypoints"], len(ours))
            self.assertGreater(len(ours), 50)
            self.assertEqual((ours.keypoints.dtype, ours.descriptors.dtype), (np.float32, kind))
            self.assertEqual((ours.keypoints.shape[1], ours.descriptors.shape[1]), (6, dim))
            loaded = pliant.Features.load(out)
            np.testing.assert_array_equal(loaded.descriptors, ours.descriptors)
        np.testing.assert_allclose(np.linalg.norm(pliant.describe(path).descriptors, axis=1), 1, atol=1e-5)

    def test_of_a_folder(self):
        (self.folder / "set" / "deep").mkdir(parents=True)
        for name, seed in (("set/b.png", 1), ("set/deep/Mütze.png", 2), ("set/c.uv.png", 3)):
            self.write(name, pattern(seed))
        run("describe", self.folder / "set", "--descriptor", "rootsift", "--out", self.folder / "x.npz", "--json")
        found = pliant.Features.load_folder(self.folder / "x.npz")
        self.assertEqual(list(found), ["b.png", "deep/Mütze.png"])
        for name, features in found.items():
            expected = pliant.describe(self.folder / "set" / name, descriptor="rootsift")
            np.testing.assert_array_equal(features.keypoints, expected.keypoints)
            np.testing.assert_array_equal(features.descriptors, expected.descriptors)
            self.assertEqual((features.width, features.height, features.model_id), (160, 120, expected.model_id))
        with self.assertRaises(pliant.InvalidArgumentError) as wrong:
            pliant.Features.load(self.folder / "x.npz")
        self.assertEqual(wrong.exception.code, "features_of_folder")
        found["b.png"].save(self.folder / "one.npz")
        with self.assertRaises(pliant.InvalidArgumentError):
            pliant.Features.load_folder(self.folder / "one.npz")

    def test_other_files_are_named(self):
        pliant.describe(pattern(1), descriptor="rootsift").save(self.folder / "one.npz")
        whole = (self.folder / "one.npz").read_bytes()
        np.savez(self.folder / "other.npz", a=1)
        np.savez(self.folder / "half.npz", keypoints=np.zeros((1, 6)))
        np.save(self.folder / "array.npy", np.zeros((1, 6)))
        (self.folder / "text.npz").write_text("words")
        (self.folder / "empty.npz").write_bytes(b"")
        (self.folder / "cut.npz").write_bytes(whole[:len(whole) // 2])
        (self.folder / "flipped.npz").write_bytes(whole[:400] + bytes([whole[400] ^ 1]) + whole[401:])
        for name in ("other.npz", "half.npz", "array.npy", "text.npz", "empty.npz", "cut.npz", "flipped.npz"):
            for load in (pliant.Features.load, pliant.Features.load_folder):
                if name == "flipped.npz" and load == pliant.Features.load_folder:
                    continue
                with self.subTest(name), self.assertRaisesRegex(pliant.Error, name):
                    load(self.folder / name)

    def test_forms_of_per_image(self):
        grey = pattern(2)
        colour = np.dstack([grey, pattern(3), 255 - grey])
        for image in (grey, colour):
            path = self.write("b.png", image)
            expected = pliant.describe(path, descriptor="rootsift")
            forms = [str(path), path.read_bytes(), bytearray(path.read_bytes()), memoryview(path.read_bytes()), image,
                     np.asfortranarray(image), np.repeat(image, 2, axis=1)[:, ::2], image[::-1].copy()[::-1]]
            if image.ndim == 2:
                forms.append(image[:, :, np.newaxis])
            for form in forms:
                got = pliant.describe(form, descriptor="rootsift")
                np.testing.assert_array_equal(got.keypoints, expected.keypoints)
                np.testing.assert_array_equal(got.descriptors, expected.descriptors)
        bgr = cv2.imread(str(path))
        np.testing.assert_array_equal(pliant.describe(bgr, descriptor="rootsift", channels="BGR").keypoints,
                                      expected.keypoints)
        swapped = pliant.describe(bgr, descriptor="rootsift", channels="RGB")
        self.assertFalse(np.array_equal(swapped.keypoints, expected.keypoints))

    def test_any_file_name(self):
        path = os.fsencode(self.folder) + b"/\xff\xfe caf\xc3\xa9.png"
        with open(path, "wb") as file:
            file.write(png(pattern(1)))
        self.assertGreater(len(pliant.describe(os.fsdecode(path), descriptor="rootsift")), 50)

    def test_options(self):
        image = pattern(1, 400, 300)
        self.assertEqual(len(pliant.describe(image, descriptor="rootsift", max_keypoints=20)), 20)
        small = pliant.describe(image, descriptor="rootsift", max_side=200)
        self.assertEqual((small.width, small.height), (400, 300))
        self.assertGreater(small.xy[:, 0].max(), 200)
        more = pliant.describe(pattern(1), descriptor="rootsift", enlarge_below=4000)
        self.assertGreater(len(more), len(pliant.describe(pattern(1), descriptor="rootsift")))
        extractor = pliant.Extractor("orb")
        self.assertEqual((extractor.descriptor, extractor.dim), ("orb", 32))
        self.assertEqual(extractor.describe(image).model_id, extractor.model_id)
        self.assertIn("deal", pliant.descriptor_names())

    def test_plain_image(self):
        features = pliant.describe(np.full((64, 64), 128, np.uint8), descriptor="rootsift")
        self.assertEqual(features.keypoints.shape, (0, 6))
        self.assertEqual(len(features.descriptors), 0)
        self.assertEqual(len(pliant.match(features, features).pairs), 0)


class Values(FolderCase):
    def test_opencv(self):
        features = pliant.describe(pattern(1), descriptor="sift")
        points = features.to_cv()
        self.assertIsInstance(points[0], cv2.KeyPoint)
        again = pliant.Features.from_cv(points, features.descriptors, 160, 120, features.model_id)
        np.testing.assert_array_equal(again.keypoints, features.keypoints)
        np.testing.assert_array_equal(again.descriptors, features.descriptors)
        # OpenCV describes our keypoints as our SIFT does: octave and angle arrived whole.
        _, theirs = cv2.SIFT_create().compute(pattern(1), points)
        self.assertLess(np.abs(theirs - features.descriptors).max(), 2)
        none = pliant.Features.from_cv([], np.empty((0, 128), np.float32), 160, 120)
        self.assertEqual(none.keypoints.shape, (0, 6))

    def test_kept_apart(self):
        """Features are copies that cannot change under a thread that works with them."""
        rows = np.zeros((3, 6))
        features = pliant.Features(rows, np.ones((3, 128)), 10, 10)
        rows[:] = 7
        self.assertEqual(features.keypoints.max(), 0)
        with self.assertRaises(ValueError):
            features.descriptors[0, 0] = 1
        again = pickle.loads(pickle.dumps(features))
        np.testing.assert_array_equal(again.descriptors, features.descriptors)

    def test_save(self):
        features = pliant.describe(pattern(1), descriptor="orb")
        features.save(self.folder / "f.npz")
        again = pliant.Features.load(self.folder / "f.npz")
        np.testing.assert_array_equal(again.keypoints, features.keypoints)
        self.assertEqual((again.width, again.height, again.model_id), (160, 120, features.model_id))
        with self.fails(pliant.InvalidArgumentError, "bad_features_name"):
            features.save(self.folder / "f.safetensors")


if __name__ == "__main__":
    unittest.main()
