# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import unittest
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

import planar_scenes
from descriptor.training import losses, runtime, trainer
from descriptor.training.batches import SceneSet, draw_batch
from descriptor.training.checkpoint import read_csv
from descriptor.training.model import SHAPES, Deal, Shape, load_model
from descriptor.training.narrow import narrowed
from descriptor.training.presets import preset
from descriptor.training.scenes import Scene
from descriptor.training.teacher import Teacher, shared_components
from descriptor.training.train import resumed_model, starting_model

WEIGHTS = Path(__file__).resolve().parents[2] / "descriptor/model/deal.safetensors"


class ShapeTest(unittest.TestCase):
    def test_is_read_from_the_tensors(self):
        for shape in (*SHAPES.values(), Shape(16, (2, 1), (8, 9, 10), (16, 16, 32, 32, 64, 64), ((1, 5), (1, 4)))):
            self.assertEqual(Shape.of(Deal(shape).state_dict()), shape)

    def test_every_shape_gives_descriptors_of_unit_length(self):
        for shape in SHAPES.values():
            network = starting_model(None, None, 1, shape=next(n for n, s in SHAPES.items() if s == shape)).eval()
            points = torch.tensor([[20.0, 30.0, 4.0], [60.0, 10.0, 7.0]])
            with torch.no_grad():
                rows = network(torch.rand(1, 64, 80), torch.zeros(2, dtype=torch.long), points, 9.0)
            self.assertEqual(rows.shape, (2, shape.dim))
            torch.testing.assert_close(rows.norm(dim=1), torch.ones(2))


class LossTest(unittest.TestCase):
    def test_is_zero_for_the_teachers_descriptors_and_falls_towards_them(self):
        torch.manual_seed(1)
        teacher = [F.normalize(torch.randn(12, 16)) for _ in range(2)]
        other = [F.normalize(torch.randn(12, 16)) for _ in range(2)]
        halfway = [F.normalize(t + o) for t, o in zip(teacher, other)]
        found = [losses.distillation(*rows, *teacher, 0.07).item() for rows in (teacher, halfway, other)]
        self.assertAlmostEqual(found[0], 0, places=5)
        self.assertLess(found[1], 0.7 * found[2])


class ComponentsTest(unittest.TestCase):
    def test_keep_what_varies_and_share_it_equally(self):
        rng = np.random.default_rng(1)
        spread = np.linalg.qr(rng.normal(size=(32, 32)))[0] * np.r_[np.linspace(2, 1, 8), np.full(24, 0.01)]
        descriptors = rng.normal(size=(4000, 32)) @ spread.T
        components = shared_components(descriptors, 8)
        np.testing.assert_allclose(components.T @ components, np.eye(8), atol=1e-9)
        kept = descriptors @ components
        np.testing.assert_allclose((kept**2).mean(0), (descriptors**2).sum(1).mean() / 8, rtol=0.01)
        np.testing.assert_array_equal(components, shared_components(descriptors, 8))


class NarrowTest(unittest.TestCase):
    def test_descriptors_are_projected_on_the_components(self):
        network, _ = load_model(WEIGHTS)
        components = np.linalg.qr(np.random.default_rng(1).normal(size=(network.dim, 16)))[0]
        patches = torch.rand(20, 32, 32, generator=torch.Generator().manual_seed(5))
        with torch.no_grad():
            expected = F.normalize(network.hardnet(patches) @ torch.from_numpy(components).float())
            narrow = narrowed(network, components)
            torch.testing.assert_close(narrow.hardnet(patches), expected, atol=1e-5, rtol=0)
        self.assertEqual(narrow.dim, 16)
        torch.testing.assert_close(narrow.backbone.conv1.weight, network.backbone.conv1.weight)


class DistillationTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.device = runtime.configure(1)
        cls.root = planar_scenes.folder_of_scenes(cls, 3)
        cls.teacher = Teacher(WEIGHTS)
        cls.data = SceneSet([cls.root / "scenes"], min_pairs=8, teacher=cls.teacher)

    def test_targets_are_the_teachers_and_come_from_the_cache_of_the_same_weights(self):
        scene, found = self.data.scenes[0], self.data.features[0].views[0]
        targets = self.data.targets[0][0]
        image = torch.from_numpy(np.array(scene.images[0])).float()[None] / 255
        index, points = torch.zeros(len(found.keypoints), dtype=torch.long), torch.from_numpy(np.array(found.keypoints))
        with torch.no_grad():
            rows = F.normalize(sum(self.teacher.model(image, index, points, self.teacher.radius_per_size * support)
                                   for support in (0.72, 1.0, 1.39)))
        np.testing.assert_allclose(targets.descriptors.astype(np.float32), rows, atol=2e-3)
        cached = Teacher(WEIGHTS)
        cached.describe = None  # would be called without a cache
        again = cached.targets(Scene(scene.path))
        np.testing.assert_array_equal(again[0].theta, targets.theta)
        cached.sha256 = "other weights"
        with self.assertRaises(TypeError):
            cached.targets(Scene(scene.path))

    def test_a_batch_has_the_targets_of_its_keypoints(self):
        options = dataclasses.replace(preset("tiny").stage("distill-warp").batch, size_jitter=0.0)
        batch = draw_batch(self.data, options, seed=1, step=0)
        self.assertEqual(len(batch.theta), len(batch.keypoints) + len(batch.extra_keypoints))
        without_windows = draw_batch(self.data, dataclasses.replace(options, crop_px=0), seed=1, step=0)
        self.assertEqual(len(without_windows.theta), len(without_windows.keypoints))
        self.assertEqual(len(batch.descriptors), len(batch.keypoints))
        known = {}
        for which, scene in enumerate(self.data.scenes):
            for view in range(scene.views):
                for row, target in zip(self.data.features[which].views[view].keypoints,
                                       self.data.targets[which][view].descriptors):
                    known[row.astype(np.float32).tobytes()] = target
        for row, target in zip(batch.keypoints, batch.descriptors):
            np.testing.assert_array_equal(known[row.tobytes()].astype(np.float32), target)

    def test_a_smaller_network_comes_nearer_to_its_teacher(self):
        recipe = preset("tiny")
        network = starting_model(None, None, 3, self.teacher.model.spacing, "deal-small")
        network.localization = self.teacher.model.localization.adapted(32)
        for name, figure in (("distill-head", "distillation"), ("distill-warp", "hint")):
            run = trainer.Run(self.root / name, dataclasses.replace(recipe.stage(name), steps=40), recipe, seed=3)
            self.assertTrue(trainer.Trainer(run, network, self.data, list, self.device, self.teacher.model).train())
            rows = read_csv(self.root / name / "log.csv")
            self.assertLess(float(rows[-1][figure]), 0.9 * float(rows[0][figure]))
        small, _ = load_model(self.root / "distill-warp/last.safetensors")
        self.assertEqual(Shape.of(small.state_dict()), SHAPES["deal-small"])
        features = torch.rand(5, 25 * 32)
        with torch.no_grad():
            torch.testing.assert_close(small.localization(features), network.eval().localization(features), atol=1e-4, rtol=0)
        again = resumed_model(self.root / "distill-warp")
        self.assertEqual(again.localization.state_dict().keys(), network.localization.state_dict().keys())


if __name__ == "__main__":
    unittest.main()
