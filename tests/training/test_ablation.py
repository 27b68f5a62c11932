# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import tempfile
import unittest
from pathlib import Path

import numpy as np
import torch

import planar_scenes
from descriptor.training import ablation, geometry, runtime
from descriptor.training.cartesian import CartesianDeal, displacement_at, turned, unit_square_grid
from descriptor.training.model import Deal, Shape, load_model, save_model
from descriptor.training.tensor_file import TensorFileError
from descriptor.training.validation import development_pairs


class CartesianGridTest(unittest.TestCase):
    def test_a_linear_field_is_read_at_any_point_of_the_disc(self):
        polar = torch.from_numpy(geometry.unit_polar_grid()).float()
        matrix = torch.tensor([[0.3, -0.1], [0.2, 0.4]])
        field = (polar @ matrix.t())[None].expand(3, -1, -1)
        square = turned(unit_square_grid(), torch.tensor([0.0, 37.0, 250.0]))
        inside = (square.norm(dim=-1) < 0.98) & (square.norm(dim=-1) > 0.02)
        error = (displacement_at(field, square) - square @ matrix.t()).norm(dim=-1)
        self.assertLess(error[inside].max().item(), 5e-3)

    def test_per_image_turned_with_its_key_point_gives_the_same_patch(self):
        torch.manual_seed(1)
        image = torch.rand(1, 61, 61)
        network, index = CartesianDeal(Shape(hidden=(16, 16, 16))), torch.zeros(1, dtype=torch.long)
        upright = network.patches(image, index, torch.tensor([[30.0, 30.0, 2.0, 20.0]]), 9.0)
        quarter = torch.rot90(image, -1, (1, 2))  # x towards y, as angles count
        again = network.patches(quarter, index, torch.tensor([[30.0, 30.0, 2.0, 110.0]]), 9.0)
        torch.testing.assert_close(upright, again, atol=1e-4, rtol=0)
        unturned = network.patches(quarter, index, torch.tensor([[30.0, 30.0, 2.0, 20.0]]), 9.0)
        self.assertGreater((upright - unturned).abs().max().item(), 0.1)

    def test_a_weight_file_is_of_one_grid(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "square.safetensors"
            save_model(path, CartesianDeal(Shape(hidden=(16, 16, 16))), {"radius_per_size": "9"})
            with self.assertRaisesRegex(TensorFileError, "square.safetensors.*'pliant-deal'"):
                load_model(path)
            self.assertIsInstance(load_model(path, CartesianDeal)[0], CartesianDeal)


class AblationTest(unittest.TestCase):
    def test_all_setups_learn_and_are_measured(self):
        device = runtime.configure(1)
        budget = ablation.Budget(steps=25, correspondences=32, crop_px=120, fit_scenes=4, fit_per_view=20,
                                 fit_steps=5)
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder)
            (root / "nothing").mkdir()
            with self.assertRaisesRegex(ValueError, "no usable scene.*nothing"):
                ablation.ablate(root / "nothing", root, root / "any", root / "none", budget, device)
            planar_scenes.write_scenes(root / "scenes", 5)
            planar_scenes.write_scenes(root / "planar", 4)
            torch.manual_seed(2)
            save_model(root / "start.safetensors", Deal(), {"radius_per_size": "9"})
            arguments = (root / "scenes", root / "planar", root / "start.safetensors", root / "run", budget, device)
            models = ablation.ablate(*arguments)
            again = ablation.ablate(*arguments)  # everything is there: nothing is trained
            for name, model in models.items():
                for key, value in model.state_dict().items():
                    self.assertTrue(torch.equal(value, again[name].state_dict()[key]), f"{name} {key}")
            rows = ablation.measure(models, {"small": development_pairs(root / "scenes", 2, 80)}, device)
            ablation.draw(rows, root / "ablation.png")
            self.assertGreater((root / "ablation.png").stat().st_size, 1000)
        self.assertEqual([row["setup"] for row in rows], ["SIFT", *(setup.title for setup in ablation.SETUPS)])
        chance = 3 / 80
        for row in rows:
            self.assertGreater(float(row["mma"]), 3 * chance, row["setup"])
        start = {name: value for name, value in models["fixed"].state_dict().items() if "backbone" in name}
        for name, value in start.items():
            self.assertTrue(torch.equal(value, models["full"].state_dict()[name]), name)
        self.assertFalse(np.array_equal(*(models[name].localization.fc1.weight for name in ("full", "planar"))))


if __name__ == "__main__":
    unittest.main()
