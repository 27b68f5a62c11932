# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import tempfile
import unittest
from pathlib import Path

import numpy as np

import planar_scenes
from descriptor.training import features, geometry, tensor_file
from descriptor.training.batches import BatchOptions, SceneSet, draw_batch
from descriptor.training.scenes import Scene, SurfacePoints
from descriptor.training.validation import development_pairs, evaluate, one_to_one, sift_describer
from descriptor.training.warp_target import true_warp


class SceneTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.path = Path(cls.folder.name) / "scene_000000.safetensors"
        cls.homographies = planar_scenes.write_scene(cls.path, seed=41)
        cls.scene = Scene(cls.path)

    def points(self, count=50, seed=1):
        uv = np.random.default_rng(seed).uniform(0.15, 0.85, (count, 2)).astype(np.float32)
        return SurfacePoints(np.zeros(count, np.uint8), uv)

    def test_projection_location_and_jacobian_agree_with_the_homography(self):
        points = self.points()
        for view, matrix in enumerate(self.homographies):
            truth = planar_scenes.apply(matrix, points.uv.astype(np.float64))
            found = self.scene.project(view, points)
            self.assertLess(np.abs(found - truth).max(), 0.3, f"view {view}")
            located = self.scene.locate(view, truth)
            self.assertTrue((located.chart == 0).all())
            self.assertLess(np.abs(located.uv - points.uv).max(), 1e-3)
            self.assertTrue(self.scene.visible(view, points, found, 2.0).all())
            step = 1e-4
            for axis in range(2):
                moved = points.uv.astype(np.float64)
                moved[:, axis] += step
                slope = (planar_scenes.apply(matrix, moved) - truth) / step
                error = np.abs(self.scene.jacobian(view, points)[:, :, axis] - slope).max()
                self.assertLess(error, 0.1 * np.abs(slope).max())

    def test_what_another_surface_covers_is_not_visible(self):
        tensors, metadata = tensor_file.load(self.path)
        tensors = {name: array.copy() for name, array in tensors.items()}
        tensors["chart"][1, :, :planar_scenes.SIZE // 2] = 255
        covered = Path(self.folder.name) / "covered.safetensors"
        tensor_file.save(covered, tensors, metadata)
        points, scene = self.points(), Scene(covered)
        xy = scene.project(1, points)
        np.testing.assert_array_equal(scene.visible(1, points, xy, 2.0), np.rint(xy[:, 0]) >= planar_scenes.SIZE // 2)

    def test_wrong_layout_is_an_error_that_names_the_tensor(self):
        path = Path(self.folder.name) / "bad.safetensors"
        tensors, _ = tensor_file.load(self.path)
        tensor_file.save(path, {name: tensors[name] for name in tensors if name != "uv"})
        with self.assertRaisesRegex(tensor_file.TensorFileError, "bad.safetensors.*'uv'"):
            Scene(path)

    def test_true_warp_of_a_turned_and_stretched_plane(self):
        # X(p) = x0 + A p with A = S Q: the warp is e -> (S / sqrt(det) - 1) e whatever Q is.
        stretch = np.array([[1.3, 0.2], [0.2, 0.8]])
        unit = geometry.unit_polar_grid()[[37, 500, 1000]]
        expected = unit @ (stretch / np.sqrt(np.linalg.det(stretch))).T - unit
        for angle in (0.0, 1.1, 2.9):
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            scene = self.affine_scene(100 * stretch @ turn)
            point = SurfacePoints(np.zeros(1, np.uint8), np.array([[0.5, 0.5]], np.float32))
            keypoint = np.array([[*scene.project(0, point)[0], 2.0]], np.float32)
            warp, known = true_warp(scene, 0, point, keypoint, 9.0, np.array([37, 500, 1000]))
            self.assertTrue(known.all())
            np.testing.assert_allclose(warp[0], expected, atol=2e-3)
        mirrored = self.affine_scene(100 * stretch @ np.diag([-1.0, 1.0]))
        self.assertFalse(true_warp(mirrored, 0, point, keypoint, 9.0)[1].any())

    def affine_scene(self, matrix):
        tensors, metadata = tensor_file.load(self.path)
        tensors = {name: array.copy() for name, array in tensors.items()}
        ramp = np.linspace(-0.5, 0.5, planar_scenes.GRID)
        vertices = np.stack(np.meshgrid(ramp, ramp), -1) @ matrix.T + planar_scenes.SIZE / 2
        tensors["grid_xy"][:] = vertices
        path = Path(self.folder.name) / "affine.safetensors"
        tensor_file.save(path, tensors, metadata)
        return Scene(path)


class FeaturesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        planar_scenes.write_scenes(cls.folder.name, 3)
        cls.paths = sorted(Path(cls.folder.name).glob("scene_*.safetensors"))

    def test_correspondences_are_near_mutual_and_of_one_scale(self):
        scene = Scene(self.paths[0])
        found = features.compute(scene)
        for (a, b), rows in found.pairs.items():
            self.assertGreater(len(rows), 10)
            first, second = found.views[a], found.views[b]
            truth = scene.project(b, first.points)[rows[:, 0]]
            distance = np.linalg.norm(truth - second.keypoints[rows[:, 1], :2], axis=1)
            self.assertLessEqual(distance.max(), features.POSITION_TOLERANCE_PX)
            area = [abs(np.linalg.det(scene.jacobian(view, first.points)))[rows[:, 0]] for view in (a, b)]
            sizes = second.keypoints[rows[:, 1], 2] / first.keypoints[rows[:, 0], 2]
            mismatch = np.abs(np.log2(sizes) - 0.5 * np.log2(area[1] / area[0]))
            self.assertLessEqual(mismatch.max(), features.SCALE_TOLERANCE_LOG2)
            self.assertEqual(len(set(rows[:, 0])), len(rows))
            self.assertEqual(len(set(rows[:, 1])), len(rows))

    def test_one_keypoint_a_place(self):
        table = features.detect(Scene(self.paths[0]).images[0])
        everything = features.detect(Scene(self.paths[0]).images[0], one_per_place=False)
        self.assertEqual(len(np.unique(table[:, :3], axis=0)), len(table))
        self.assertGreater(len(everything), len(table))
        self.assertTrue((np.diff(table[:, 4]) <= 0).all())

    def test_cache_is_read_back_and_a_stale_one_is_not(self):
        scene = Scene(self.paths[1])
        first = features.load_features(scene)
        cache = features.cache_path(scene.path)
        again = features.load_features(scene)
        for key, rows in first.pairs.items():
            np.testing.assert_array_equal(rows, again.pairs[key])
        tensors, metadata = tensor_file.load(cache)
        emptied = {name: array[:0] for name, array in tensors.items()}
        tensor_file.save(cache, emptied, metadata)
        self.assertEqual(len(features.load_features(scene).pairs[0, 1]), 0)  # the cache is really used
        tensor_file.save(cache, emptied, {**metadata, "version": "0"})
        self.assertEqual(len(features.load_features(scene).pairs[0, 1]), len(first.pairs[0, 1]))

    def test_batches_keep_their_promises_and_repeat(self):
        data = SceneSet([Path(self.folder.name)], min_pairs=8)
        options = BatchOptions(correspondences=40, per_pair=16, crop_px=120, extra_keypoints=5)
        batch, same = draw_batch(data, options, 7, 3), draw_batch(data, options, 7, 3)
        np.testing.assert_array_equal(batch.keypoints, same.keypoints)
        np.testing.assert_array_equal(batch.warp, same.warp)
        self.assertFalse(np.array_equal(batch.keypoints, draw_batch(data, options, 7, 4).keypoints))
        count = len(batch.surface)
        self.assertEqual(batch.keypoints.shape, (2 * count, 4))
        self.assertEqual(len(batch.warp), 2 * count + len(batch.extra_index))
        for image in range(len(batch.images)):
            xy = batch.keypoints[batch.index == image, :2]
            self.assertLessEqual(len(xy), options.per_pair)
            gaps = np.linalg.norm(xy[:, None] - xy[None], axis=2) + np.eye(len(xy)) * 99
            self.assertGreaterEqual(gaps.min(), 3.0)
            local = xy - batch.windows[image]
            self.assertTrue(((local >= 0) & (local < options.crop_px)).all())
        self.assertTrue((np.abs(batch.gamma) > 0).all())

    def test_sizes_err_within_the_jitter(self):
        data = SceneSet([Path(self.folder.name)], min_pairs=8)
        detected = {(x, y): size for found in data.features for view in found.views
                    for x, y, size, _ in view.keypoints}

        def octaves(jitter):
            options = BatchOptions(correspondences=60, crop_px=120, extra_keypoints=5, size_jitter=jitter)
            batch = draw_batch(data, options, 7, 3)
            points = np.concatenate([batch.keypoints, batch.extra_keypoints])
            return np.log2([size / detected[x, y] for x, y, size, _ in points])

        np.testing.assert_array_equal(octaves(0.0), 0)
        self.assertLessEqual(np.abs(octaves(0.25)).max(), 0.2501)
        self.assertGreater(np.std(octaves(0.25)), 0.25 / 3**0.5 * 0.7)


class ValidationTest(unittest.TestCase):
    def test_one_to_one_takes_the_nearest_first(self):
        distance = np.array([[2.0, 1.0, 9.0], [0.5, 0.7, 9.0], [9.0, 9.0, 3.5]])
        np.testing.assert_array_equal(one_to_one(distance, 3.0), [[1, 0], [0, 1]])

    def test_sift_beats_chance_and_the_truth_is_perfect(self):
        with tempfile.TemporaryDirectory() as folder:
            planar_scenes.write_scenes(folder, 2)
            pairs = development_pairs(Path(folder), 3, 200)
            self.assertEqual(len(pairs), 3)
            sift = evaluate(sift_describer(root=False), pairs)
            rng = np.random.default_rng(3)
            chance = evaluate(lambda image, table: rng.normal(size=(len(table), 16)), pairs)
        self.assertGreater(sift["mma"], 0.5)
        self.assertLess(chance["mma"], 0.2)
        self.assertLessEqual(sift["ms"], 1.0)


if __name__ == "__main__":
    unittest.main()
