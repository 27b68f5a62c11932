# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import unittest
from unittest import mock

import cv2
import numpy as np

from descriptor.training import dog, features
from descriptor.training.goldens import draw_image


class DogTest(unittest.TestCase):
    def test_finds_what_opencv_finds(self):
        image = cv2.GaussianBlur(draw_image(320, 240, seed=51), (0, 0), 0.8)
        expected = features.detect(image)
        found = dog.detect(image)
        self.assertGreater(len(expected), 100)
        gap = np.linalg.norm(expected[:, None, :2] - found[None, :, :2], axis=2)
        same_size = np.abs(np.log(expected[:, None, 2] / found[None, :, 2])) < 0.1
        matched = ((gap < 0.5) & same_size).any(1).mean()
        self.assertGreater(matched, 0.9)
        self.assertLess(abs(len(found) / len(expected) - 1), 0.15)

    def test_detect_without_opencv_has_the_same_form(self):
        image = draw_image(160, 120, seed=52)
        with mock.patch.object(features, "cv2", None):
            table = features.detect(image, 40)
        self.assertEqual(table.shape, (40, 6))
        self.assertTrue((np.diff(table[:, 4]) <= 0).all())

    def test_flat_and_tiny_images_have_no_keypoints(self):
        for shape in ((60, 80), (3, 3), (1, 50)):
            self.assertEqual(len(dog.detect(np.full(shape, 77, np.uint8))), 0)


if __name__ == "__main__":
    unittest.main()
