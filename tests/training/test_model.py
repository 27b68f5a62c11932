# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import itertools
import tempfile
import unittest
from pathlib import Path

import cv2
import numpy as np
import torch
from torch.nn import functional as F

from descriptor.training import geometry, goldens, model, tensor_file
from descriptor.training.sampling import sample_features, sample_images

ROOT = Path(__file__).resolve().parents[2]
WEIGHTS = ROOT / "descriptor/model/deal.safetensors"


def fresh_model(seed):
    """Weights whose every part matters: a warp that is not zero, statistics that are not 0 and 1."""
    torch.manual_seed(seed)
    network = model.Deal(model.Shape(hidden=(48, 40, 32)))
    torch.nn.init.normal_(network.localization.fc4.weight, std=0.02)
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean.normal_(0, 0.1)
            module.running_var.uniform_(0.5, 1.5)
    return network.eval()


class GoldenTest(unittest.TestCase):
    def test_float32_network_meets_the_goldens(self):
        for name, (width, height) in itertools.product(("deal", "deal-small"), goldens.SIZES):
            weights, stem = WEIGHTS.with_stem(name), f"{name}_{width}x{height}"
            network, metadata = model.load_model(weights)
            expected, about = tensor_file.load(ROOT / f"tests/data/golden_{stem}.safetensors")
            self.assertEqual(about["model_sha256"], tensor_file.sha256(weights),
                             "stale goldens: run python3 -m descriptor.training.goldens")
            self.assertEqual(float(about["radius_per_size"]), float(metadata["radius_per_size"]))
            image = cv2.imread(str(ROOT / f"tests/data/golden_{width}x{height}.png"), cv2.IMREAD_GRAYSCALE)
            image = torch.from_numpy(image).float()[None] / 255
            points = torch.from_numpy(expected["keypoints_x_y_size"].copy())
            index = torch.zeros(len(points), dtype=torch.long)
            radius = float(about["radius_per_size"])
            with torch.no_grad():
                theta = network.localization(network.features_at(image, index, points))
                found = {
                    "backbone": network.backbone(image)[0], "theta": theta,
                    "descriptors": network(image, index, points, radius),
                    "descriptors_fixed": network(image, index, points, radius, warp=False),
                }
            for name, value in found.items():
                np.testing.assert_allclose(value, expected[name], atol=3e-4, err_msg=f"{stem} {name}")


class GeometryTest(unittest.TestCase):
    def test_affine_rows_reproduce_affine_maps(self):
        theta = np.zeros((66, 1))
        theta[63:, 0] = [0.5, -2.0, 3.0]
        for spacing in geometry.SPACINGS:
            basis = geometry.tps_basis(spacing)
            np.testing.assert_allclose(basis @ theta, basis[:, 64:] @ [[-2.0], [3.0]] + 0.5, atol=1e-12)

    def test_on_logarithmic_rings_another_size_is_a_shift_along_the_radius(self):
        torch.manual_seed(3)
        image = torch.nn.functional.interpolate(torch.rand(1, 1, 12, 14), (120, 140), mode="bicubic")[0]
        network, index = model.Deal(model.Shape(hidden=(8, 8, 8)), geometry.LOGARITHMIC), torch.zeros(2, dtype=torch.long)
        rings = 6
        sizes = 4 * float(geometry.GRID) ** (np.array([0, rings]) / geometry.GRID)
        points = torch.tensor([[70.0, 60.0, size] for size in sizes], dtype=torch.float32)
        small, large = network.patches(image, index, points, 6.0)
        torch.testing.assert_close(small[:, rings:], large[:, :-rings], atol=1e-4, rtol=0)
        network.set_spacing(geometry.LINEAR)
        small, large = network.patches(image, index, points, 6.0)
        self.assertGreater((small[:, rings:] - large[:, :-rings]).abs().max().item(), 0.1)

    def test_the_supervised_warp_is_read_on_linear_rings_whatever_the_spacing(self):
        torch.manual_seed(4)
        theta, points = torch.rand(2, 66, 2), torch.tensor([0, 37, 1000])
        fields = []
        for spacing in geometry.SPACINGS:
            fields.append(model.Deal(model.Shape(hidden=(8, 8, 8)), spacing).displacement(theta, points))
        torch.testing.assert_close(*fields)

    def test_spacing_is_one_of_two(self):
        with self.assertRaisesRegex(ValueError, "linear or logarithmic, not 'log'"):
            geometry.unit_polar_grid("log")

    def test_preconditioner_is_invertible_and_evens_the_basis(self):
        singular = np.linalg.svd(geometry.tps_basis() @ geometry.tps_preconditioner(), compute_uv=False)
        raw = np.linalg.svd(geometry.tps_basis(), compute_uv=False)
        self.assertGreater(raw[0] / raw[5], 100)
        np.testing.assert_allclose(singular[:6], singular[0], rtol=1e-9)
        self.assertLess(np.linalg.cond(geometry.tps_preconditioner()), 1e4)


class ExportTest(unittest.TestCase):
    def test_folding_the_preconditioner_changes_nothing(self):
        network = fresh_model(3)
        plain = [p.detach().clone() for p in (network.localization.fc4.weight, network.localization.fc4.bias)]
        sampled = torch.randn(9, 3200, generator=torch.Generator().manual_seed(1))
        with torch.no_grad():
            before = network.localization(sampled)
            network.localization.fc4.precondition()
            after = network.localization(sampled)
        self.assertFalse(torch.equal(plain[0], network.localization.fc4.weight))
        torch.testing.assert_close(before, after, atol=2e-5, rtol=0)
        folded = model.export_tensors(network)
        np.testing.assert_allclose(folded["localization.fc4.weight"], plain[0], atol=1e-6)
        np.testing.assert_allclose(folded["localization.fc4.bias"], plain[1], atol=1e-6)

    def test_half_precision_halves_the_file_and_rounds_matrices_alone(self):
        network = fresh_model(4)
        with tempfile.TemporaryDirectory() as folder:
            whole, half = Path(folder) / "w.safetensors", Path(folder) / "h.safetensors"
            model.save_model(whole, network, {"radius_per_size": "7"})
            model.save_model(half, network, {"radius_per_size": "7"}, half=True)
            self.assertLess(half.stat().st_size, 0.55 * whole.stat().st_size)
            back, _ = model.load_model(half)
            for name, value in network.state_dict().items():
                found = back.state_dict()[name]
                self.assertEqual(found.dtype, value.dtype, name)
                rounded = value.half().to(value.dtype) if value.ndim > 1 else value
                self.assertTrue(torch.equal(rounded, found), name)

    def test_saved_model_comes_back_with_its_widths(self):
        network = fresh_model(4)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "m.safetensors"
            model.save_model(path, network, {"radius_per_size": "7"})
            back, metadata = model.load_model(path)
            self.assertEqual((metadata["radius_per_size"], metadata["radial_spacing"]), ("7", "linear"))
            for name, value in network.state_dict().items():
                self.assertTrue(torch.equal(value, back.state_dict()[name]), name)
            tensors, about = tensor_file.load(path)
            tensors = dict(tensors)
            del tensors["hardnet.conv3.weight"]
            tensor_file.save(path, tensors, about)
            with self.assertRaisesRegex(tensor_file.TensorFileError, "hardnet.conv3.weight"):
                model.load_model(path)


class NetworkTest(unittest.TestCase):
    def test_descriptor_ignores_the_start_of_the_angle_axis(self):
        network = fresh_model(5).hardnet
        patches = torch.rand(6, 32, 32, generator=torch.Generator().manual_seed(2))
        with torch.no_grad():
            turned = network(torch.roll(patches, 4, 1))  # a multiple of the strides: exact
            other = network(torch.roll(patches, 4, 2))
            torch.testing.assert_close(network(patches), turned, atol=1e-5, rtol=0)
        self.assertGreater((network(patches) - other).abs().max(), 2e-4)

    def test_grey_backbone_equals_three_equal_channels(self):
        network = fresh_model(6).backbone
        image = torch.rand(1, 40, 56, generator=torch.Generator().manual_seed(3))
        with torch.no_grad():
            x = network.conv1(image[:, None].expand(-1, 3, -1, -1))
            x = F.max_pool2d(F.relu(network.bn1(x)), 3, 2, 1)
            torch.testing.assert_close(network(image), network.layer2(network.layer1(x)), atol=2e-4, rtol=1e-4)


class SamplingTest(unittest.TestCase):
    def setUp(self):
        self.generator = torch.Generator().manual_seed(7)

    def random(self, *shape):
        return torch.rand(*shape, generator=self.generator, dtype=torch.float64)

    @staticmethod
    def reference(maps, xy):
        """grid_sample with border clamp: maps [N, C, h, w], xy [N, M, 2] -> [N, C, M]."""
        height, width = maps.shape[2:]
        unit = xy * 2 / torch.tensor([width - 1, height - 1]) - 1
        return F.grid_sample(maps, unit[:, None], padding_mode="border", align_corners=True)[:, :, 0]

    def test_images_inside_and_outside(self):
        images = self.random(2, 13, 17)
        xy = self.random(5, 40, 2) * torch.tensor([25.0, 21.0]) - 4
        index = torch.tensor([0, 1, 1, 0, 1])
        found = sample_images(images, index, xy)
        torch.testing.assert_close(found, self.reference(images[index][:, None], xy)[:, 0])

    def test_gradient_of_image_sampling(self):
        images = self.random(2, 9, 9)
        xy = (self.random(2, 12, 2) * 10 - 1).requires_grad_()
        index = torch.tensor([0, 1])
        self.assertTrue(torch.autograd.gradcheck(lambda q: sample_images(images, index, q), (xy,)))

    def test_features_are_25_bilinear_samples(self):
        maps = self.random(2, 6, 11, 9)
        xy = self.random(7, 2) * torch.tensor([10.0, 12.0]) - 1
        index = torch.tensor([0, 1, 0, 1, 1, 0, 0])
        found = sample_features(maps, index, xy).view(7, 25, 6)
        steps = torch.arange(-2.0, 3.0, dtype=torch.float64)
        offsets = torch.stack(torch.meshgrid(steps, steps, indexing="ij")[::-1], -1).reshape(25, 2)
        expected = self.reference(maps[index], xy[:, None] + offsets)
        torch.testing.assert_close(found, expected.transpose(1, 2))

    def test_gradient_of_feature_sampling(self):
        maps = self.random(2, 2, 4, 5).requires_grad_()
        xy = self.random(3, 2) * torch.tensor([4.0, 3.0])
        index = torch.tensor([1, 0, 1])
        self.assertTrue(torch.autograd.gradcheck(lambda m: sample_features(m, index, xy), (maps,)))


if __name__ == "__main__":
    unittest.main()
