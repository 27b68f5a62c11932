# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import dataclasses
import sys
import unittest
from unittest import mock

import torch

import planar_scenes
from descriptor.training import geometry, runtime, train, trainer
from descriptor.training.batches import SceneSet
from descriptor.training.checkpoint import read_csv
from descriptor.training.model import Deal, Shape, load_model, save_model
from descriptor.training.presets import preset
from descriptor.training.train import starting_model
from descriptor.training.validation import development_pairs


class TrainerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.device = runtime.configure(1)
        cls.root = planar_scenes.folder_of_scenes(cls, 4)
        cls.data = SceneSet([cls.root / "scenes"], min_pairs=8)
        cls.pairs = development_pairs(cls.root / "scenes", 2, 64)

    def run_stage(self, name, stage_name, init=None, steps=None, model=None, **changes):
        recipe = preset("tiny")
        stage = dataclasses.replace(recipe.stage(stage_name), **changes)
        if steps is not None:
            stage = dataclasses.replace(stage, steps=steps)
        network = model or starting_model(init, None, seed=3)
        run = trainer.Run(self.root / name, stage, recipe, seed=3)
        work = trainer.Trainer(run, network, self.data, lambda: self.pairs, self.device)
        return work

    def test_resumed_run_equals_the_uninterrupted_one(self):
        whole = self.run_stage("whole", "joint")
        self.assertTrue(whole.train())
        self.assertEqual(whole.model.spacing, geometry.LOGARITHMIC)
        broken = self.run_stage("broken", "joint")
        broken.run = dataclasses.replace(broken.run, stop_after_seconds=1e-9)  # leaves after one step
        self.assertFalse(broken.train())
        self.assertEqual(broken.step, 1)
        resumed = self.run_stage("broken", "joint", model=starting_model(None, None, 3, geometry.LINEAR))
        self.assertEqual((resumed.step, resumed.model.spacing), (1, geometry.LOGARITHMIC))
        self.assertTrue(resumed.train())
        for name, value in whole.model.state_dict().items():
            self.assertTrue(torch.equal(value, resumed.model.state_dict()[name]), name)
        first, second = (load_model(self.root / name / "last.safetensors")[0].state_dict()
                         for name in ("whole", "broken"))
        for name, value in first.items():
            self.assertTrue(torch.equal(value, second[name]), name)

    def test_hardnet_stage_learns_and_touches_nothing_else(self):
        work = self.run_stage("learn", "hardnet", steps=40)
        before = {n: v.clone() for n, v in work.model.state_dict().items()}
        self.assertTrue(work.train())
        rows = read_csv(self.root / "learn/log.csv")
        self.assertLess(float(rows[-1]["loss"]), 0.8 * float(rows[0]["loss"]))
        changed = {n.split(".")[0] for n, v in work.model.state_dict().items() if not torch.equal(v, before[n])}
        self.assertEqual(changed, {"hardnet"})
        self.assertEqual(len(read_csv(self.root / "learn/validation.csv")), 1)

    def test_warp_stage_moves_the_warp_and_nothing_else(self):
        work = self.run_stage("warp", "warp", steps=3)
        before = {n: v.clone() for n, v in work.model.state_dict().items()}
        self.assertTrue(work.train())
        changed = {n.split(".")[0] for n, v in work.model.state_dict().items() if not torch.equal(v, before[n])}
        self.assertEqual(changed, {"backbone", "localization"})
        exported, metadata = load_model(self.root / "warp/last.safetensors")
        self.assertGreater(exported.localization.fc4.weight.abs().max().item(), 0)
        self.assertEqual(metadata["stage"], "warp")

    def test_late_backbone_keeps_its_first_half(self):
        work = self.run_stage("late", "joint", steps=2, train_backbone="late")
        before = {n: v.clone() for n, v in work.model.state_dict().items()}
        self.assertTrue(work.train())
        changed = {".".join(n.split(".")[:2]) for n, v in work.model.state_dict().items()
                   if n.startswith("backbone") and not torch.equal(v, before[n])}
        self.assertEqual(changed, {"backbone.layer2"})
        with self.assertRaisesRegex(ValueError, "sometimes"):
            self.run_stage("odd", "joint", train_backbone="sometimes")

    def test_rings_are_the_presets_unless_weights_or_the_user_say_otherwise(self):
        files = {}
        for spacing in geometry.SPACINGS:
            files[spacing] = str(self.root / f"{spacing}.safetensors")
            save_model(files[spacing], Deal(Shape(hidden=(8, 8, 8)), spacing), {"radius_per_size": "9"})
        for recipe, options, expected in (
                ("paper", (), geometry.LINEAR), ("gpu", (), geometry.LOGARITHMIC), ("cpu", (), geometry.LOGARITHMIC),
                ("paper", ("--spacing", "logarithmic"), geometry.LOGARITHMIC),
                ("paper", ("--init", files["logarithmic"]), geometry.LOGARITHMIC),
                ("paper", ("--init-warp", files["logarithmic"]), geometry.LOGARITHMIC), ("cpu", ("--init", files["linear"]), geometry.LINEAR)):
            command = ["train", "--preset", recipe, "--stage", "joint", "--scenes", str(self.root / "scenes"),
                       "--run", str(self.root / "never"), *options]
            with mock.patch.object(sys, "argv", command), mock.patch.object(train, "Trainer") as begun:
                train.main()
            self.assertEqual(begun.call_args.args[1].spacing, expected, command)

    def test_a_run_folder_belongs_to_one_stage(self):
        self.run_stage("mine", "hardnet", steps=1).train()
        with self.assertRaisesRegex(ValueError, "hardnet"):
            self.run_stage("mine", "joint")


if __name__ == "__main__":
    unittest.main()
