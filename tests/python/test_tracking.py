#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Tracking and simulation: the functions of `pliant track` and `pliant simulate`."""
import json
import subprocess
import unittest

import cv2
import numpy as np

import pliant
from support import BIN, FolderCase, other_view, pattern


class Tracking(FolderCase):
    def setUp(self):
        super().setUp()
        self.reference = self.write("ref.png", pattern(1))
        for number, seed in enumerate((1, 8, 1)):
            self.write(f"frames/f{number}.png", other_view(seed))

    def test_same_as_command_line(self):
        done = subprocess.run([BIN / "pliant", "track", self.reference, self.folder / "frames", "--descriptor", "rootsift",
                               "--json"], stdout=subprocess.PIPE, check=True, timeout=200)
        theirs = [json.loads(line) for line in done.stdout.splitlines()][:-1]
        ours = list(pliant.track(self.reference, self.folder / "frames", descriptor="rootsift"))
        self.assertEqual([frame.found for frame in ours], [True, False, True])
        for one, other in zip(ours, theirs, strict=True):
            self.assertEqual((one.number, one.file, one.found, one.reason, one.keypoints, one.matches, one.mesh),
                             tuple(other[name] for name in ("frame", "file", "found", "reason", "keypoints", "matches",
                                                            "mesh")))
            self.assertEqual(len(one.on_template), other["inliers"])
            self.assertAlmostEqual(one.inlier_rate, other["inlier_rate"], places=3)
            self.assertEqual(one.warp is None, not one.found)
        first = ours[0]
        self.assertLess(np.abs(first.warp(first.on_template) - first.in_frame).max(), 4)

    def test_any_frames(self):
        tracker = pliant.Tracker(pattern(1), region=(20, 10, 100, 90), descriptor="rootsift")
        self.assertEqual(tracker.region, (20, 10, 100, 90))
        self.assertEqual((tracker.features.width, tracker.features.height), (100, 90))
        frames = list(pliant.track(tracker, (other_view(1) for _ in range(3)), every=2))
        self.assertEqual([(frame.number, frame.found) for frame in frames], [(0, True), (2, True)])
        mask = np.zeros((120, 160), np.uint8)
        mask[10:100, 20:120] = 255
        self.assertEqual(pliant.Tracker(pattern(1), mask=mask, descriptor="rootsift").region, (20, 10, 100, 90))

    def test_video(self):
        path = str(self.folder / "v.avi")
        video = cv2.VideoWriter(path, cv2.VideoWriter_fourcc(*"MJPG"), 10, (160, 120))
        for _ in range(3):
            video.write(cv2.cvtColor(other_view(1), cv2.COLOR_GRAY2BGR))
        video.release()
        frames = list(pliant.track(self.reference, path, descriptor="rootsift"))
        self.assertEqual([frame.found for frame in frames], [True] * 3)
        self.assertAlmostEqual(frames[2].time_s, 0.2, places=2)

    def test_wrong(self):
        for options, kind in (({"region": (0, 0, 500, 500)}, ValueError), ({"region": (0, 0, 4)}, ValueError),
                              ({"region": (0, 0, 5, 5)}, ValueError), ({"mask": np.zeros((5, 5), np.uint8)}, pliant.Error),
                              ({"tolerance": 0}, ValueError), ({"max_ratio": -1}, ValueError),
                              ({"descriptor": "surf"}, ValueError), ({"speed": 1}, TypeError)):
            with self.subTest(options=options), self.fails(kind):
                pliant.track(pattern(1), [], **{"descriptor": "rootsift", **options})
        with self.fails(pliant.UnprocessableError, "too_few_features"):
            pliant.Tracker(np.full((64, 64), 9, np.uint8), descriptor="rootsift")
        with self.fails(pliant.NotFoundError):
            pliant.track(pattern(1), self.folder / "nowhere", descriptor="rootsift")
        with self.fails(TypeError):
            pliant.track(pattern(1), b"bytes", descriptor="rootsift")
        with self.fails(TypeError):
            list(pliant.track(pattern(1), [pattern(1).astype(float)], descriptor="rootsift"))


class Simulation(FolderCase):
    def setUp(self):
        super().setUp()
        self.textures = self.folder / "textures"
        for seed in range(2):
            self.write(f"textures/{seed}.png", pattern(seed, 256, 256))

    def test_simulate(self):
        heard = []
        report = pliant.simulate(self.textures, self.folder / "out", preset="objects", scenes=2, views=2, width=96, height=64,
                                 seed=3, progress=lambda done, total: heard.append((done, total)))
        self.assertEqual((report.scenes, report.images, report.skipped), (2, 4, []))
        self.assertEqual(sorted(heard), [(1, 2), (2, 2)])
        self.assertEqual(len(list((self.folder / "out").rglob("*.jpg"))), 4)
        again = pliant.simulate(self.textures, self.folder / "out", preset="objects", scenes=2, views=2, width=96, height=64,
                                seed=3)
        self.assertEqual((again.scenes, again.unchanged), (0, 2))

    def test_wrong(self):
        out = self.folder / "out"
        for options, kind in (({"preset": "waves"}, ValueError), ({"strength": 7.0}, ValueError), ({"scenes": -1}, ValueError),
                              ({"scenes": 1.5}, TypeError), ({"colours": 1}, TypeError), ({"strength": "x"}, ValueError)):
            with self.subTest(options=options), self.fails(kind):
                pliant.simulate(self.textures, out, **options)
        with self.fails(pliant.NotFoundError, "textures_not_found"):
            pliant.simulate(self.folder / "nowhere", out)

        def stop(*_):
            raise KeyError("enough")

        with self.fails(KeyError):
            pliant.simulate(self.textures, out, scenes=50, width=64, height=48, progress=stop)


if __name__ == "__main__":
    unittest.main()
