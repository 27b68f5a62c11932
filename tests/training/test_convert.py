# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""A checkpoint in the layout of the paper's code, made here, becomes weights of Pliant that compute the same."""

import contextlib
import io
import os
import sys
import tarfile
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import torch
from torch.nn import functional as F

from descriptor.training import convert
from descriptor.training.model import load_model

# (outputs, inputs, kernel rows, kernel columns) of HardNet's convolutions, at every place of its torch.nn.Sequential.
HARDNET = {2: (32, 1, 3, 3), 6: (32, 32, 3, 3), 10: (64, 32, 3, 3), 14: (64, 64, 3, 3), 18: (128, 64, 3, 3), 22: (128, 128, 3, 3),
           27: (128, 128, 1, 3), 29: (128, 128, 1, 3), 31: (128, 128, 1, 3), 33: (128, 128, 1, 2)}
HALVING = (10, 18)


def published_shapes(control_points):
    """Names and shapes of the state_dict of the paper's code."""
    shapes = {}

    def convolution(name, bn, *extents, affine=True):
        shapes[f"{name}.weight"] = extents
        if affine:
            shapes[f"{bn}.weight"] = shapes[f"{bn}.bias"] = extents[:1]
        shapes[f"{bn}.running_mean"] = shapes[f"{bn}.running_var"] = extents[:1]
        shapes[f"{bn}.num_batches_tracked"] = ()

    sizes = (3200, 512, 256, 256, 2 * (control_points + 2))
    for i, place in enumerate((2, 5, 8, 11)):
        shapes[f"tps_transform.loc.{place}.weight"] = (sizes[i + 1], sizes[i])
        shapes[f"tps_transform.loc.{place}.bias"] = (sizes[i + 1],)
    for place, extents in HARDNET.items():
        convolution(f"hardnet.features.{place}", f"hardnet.features.{place + 1}", *extents, affine=False)
    convolution("resnet.0", "resnet.1", 64, 3, 7, 7)
    for stage, blocks, width in ((4, 3, 64), (5, 4, 128)):
        for block in range(blocks):
            start = f"resnet.{stage}.{block}"
            inputs = 64 if block == 0 else width
            convolution(f"{start}.conv1", f"{start}.bn1", width, inputs, 3, 3)
            convolution(f"{start}.conv2", f"{start}.bn2", width, width, 3, 3)
            if inputs != width:
                convolution(f"{start}.downsample.0", f"{start}.downsample.1", width, inputs, 1, 1)
    return shapes


def made_checkpoint(control_points=32):
    generator = torch.Generator().manual_seed(control_points)
    tensors = {}
    for name, shape in published_shapes(control_points).items():
        if name.endswith("num_batches_tracked"):
            tensors[name] = torch.tensor(7)
        elif name.endswith("running_var") or (name.endswith("weight") and len(shape) == 1):
            tensors[name] = 0.5 + torch.rand(shape, generator=generator)
        else:
            inputs = torch.Size(shape[1:]).numel() if len(shape) > 1 else 100
            tensors[name] = torch.randn(shape, generator=generator) / inputs**0.5
    tensors["tps_transform.loc.11.weight"] *= 0.05  # a warp that leaves a patch in one piece
    tensors["tps_transform.loc.11.bias"] *= 0.05
    return tensors


class Published:
    """What the paper's code computes from its checkpoint, in evaluation mode and double precision."""

    def __init__(self, tensors):
        self.tensors = {name: value.double() for name, value in tensors.items()}

    def normed(self, x, bn):
        read = self.tensors.get
        return F.batch_norm(x, read(f"{bn}.running_mean"), read(f"{bn}.running_var"), read(f"{bn}.weight"), read(f"{bn}.bias"))

    def backbone(self, image):
        """[H, W] -> [1, 128, h, w]"""
        x = F.conv2d(image.double().expand(1, 3, -1, -1), self.tensors["resnet.0.weight"], stride=2, padding=3)
        x = F.max_pool2d(F.relu(self.normed(x, "resnet.1")), 3, 2, 1)
        for start in [f"resnet.4.{i}" for i in range(3)] + [f"resnet.5.{i}" for i in range(4)]:
            stride = 2 if start == "resnet.5.0" else 1
            y = F.conv2d(x, self.tensors[f"{start}.conv1.weight"], stride=stride, padding=1)
            y = F.conv2d(F.relu(self.normed(y, f"{start}.bn1")), self.tensors[f"{start}.conv2.weight"], padding=1)
            if stride == 2:
                x = self.normed(F.conv2d(x, self.tensors[f"{start}.downsample.0.weight"], stride=2), f"{start}.downsample.1")
            x = F.relu(self.normed(y, f"{start}.bn2") + x)
        return x

    def theta(self, features):
        """[N, 128, 5, 5] -> [N, control points + 2, 2]"""
        x = features.double().flatten(1)
        for place in (2, 5, 8, 11):
            x = F.linear(x, *(self.tensors[f"tps_transform.loc.{place}.{kind}"] for kind in ("weight", "bias")))
            x = x.tanh() if place == 11 else F.relu(x)
        return x.unflatten(1, (-1, 2))

    def features(self, maps, image_size, point):
        """25 samples at x, y = -1, -0.5, ..., 1 times 5 / (8 W) of the unit square of the map (5 / (8 H) down): [1, 128, 5, 5]"""
        height, width = image_size
        centre = point / torch.tensor([width - 1, height - 1]) * 2 - 1
        steps = torch.linspace(-1, 1, 5, dtype=torch.float64) * 5 / 8
        y, x = torch.meshgrid(steps / height, steps / width, indexing="ij")
        return F.grid_sample(maps, (centre + torch.stack([x, y], -1))[None], padding_mode="border", align_corners=True)

    @staticmethod
    def polar_grid():
        """[32, 32, 2], angle by radius, in radii"""
        ramp = (torch.arange(32, dtype=torch.float64) + 0.5) / 32
        angle = 2 * torch.pi * ramp[:, None]
        return torch.stack([ramp * angle.cos(), ramp * angle.sin()], -1)

    def warped_grid(self, theta):
        """theta [P + 2, 2] -> [32, 32, 2] in radii"""
        grid = self.polar_grid()
        low, high = grid.amin((0, 1)), grid.amax((0, 1))
        box = (grid - low) / (high - low) * 0.3 + 0.35
        columns = (len(theta) - 2) // 8
        control = F.interpolate(box.permute(2, 0, 1)[None], (8, columns))[0].permute(1, 2, 0).reshape(-1, 2)
        distance = (box[:, :, None] - control).norm(dim=-1)
        weights = torch.cat([-theta[:-3].sum(0, keepdim=True), theta[:-3]])
        moved = box + (distance**2 * torch.log(distance + 1e-6)) @ weights
        moved = moved + torch.cat([torch.ones(32, 32, 1), box], -1) @ theta[-3:]
        return (moved - 0.35) / 0.3 * (high - low) + low

    def hardnet(self, patches):
        """[N, 32, 32] -> [N, 128]"""
        x = F.instance_norm(patches.double()[:, None])
        for place in HARDNET:
            if place == 27:
                x = x.mean(2, keepdim=True)
            x = F.pad(x, (1, 1)) if place < 27 else x
            x = F.pad(x, (0, 0, 1, 1), mode="circular") if place < 27 else x
            x = F.conv2d(x, self.tensors[f"hardnet.features.{place}.weight"], stride=2 if place in HALVING else 1)
            x = self.normed(x, f"hardnet.features.{place + 1}")
            x = F.relu(x) if place < 27 else x
        return F.normalize(x.flatten(1))

    def describe(self, image, point, size):
        height, width = image.shape
        theta = self.theta(self.features(self.backbone(image), image.shape, point))[0]
        centre = point / torch.tensor([width - 1, height - 1]) * 2 - 1
        grid = centre + self.warped_grid(theta) * size * 24 * 2 / torch.tensor([width, height])
        patch = F.grid_sample(image.double()[None, None], grid[None], padding_mode="border", align_corners=False)
        return theta, self.hardnet(patch[:, 0])


class Converted(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.checkpoint, self.out = self.folder / "published.pth", self.folder / "out.safetensors"

    def run_program(self, state):
        """Returns (what it printed, why it stopped)."""
        if state is not None:
            torch.save(state, self.checkpoint)
        printed = io.StringIO()
        with mock.patch.object(sys, "argv", ["convert", str(self.checkpoint), "--out", str(self.out)]):
            with contextlib.redirect_stdout(printed):
                try:
                    convert.main()
                except SystemExit as stop:
                    return printed.getvalue(), stop.code
        return printed.getvalue(), None


class NetworkTest(Converted):
    def converted(self, tensors):
        printed, stop = self.run_program(tensors)
        self.assertIsNone(stop)
        network, metadata = load_model(self.out)
        self.assertEqual((metadata["radius_per_size"], metadata["radial_spacing"]), ("24.0", "linear"))
        return network, printed

    @torch.no_grad()
    def test_every_part_computes_what_the_published_one_does(self):
        generator = torch.Generator().manual_seed(2)
        for points in (32, 64):
            tensors = made_checkpoint(points)
            published = Published(tensors)
            network, printed = self.converted(tensors)
            self.assertIn(f"the {points} control points", printed)

            image = torch.rand(64, 88, generator=generator)
            first = F.conv2d(image[None, None], network.backbone.conv1.weight.sum(1, keepdim=True), stride=2, padding=3)
            expected = F.conv2d(image.double().expand(1, 3, -1, -1), published.tensors["resnet.0.weight"], stride=2, padding=3)
            torch.testing.assert_close(network.backbone.bn1(first).double(), published.normed(expected, "resnet.1"), atol=1e-5, rtol=1e-5)
            torch.testing.assert_close(network.backbone(image[None]).double(), published.backbone(image), atol=1e-3, rtol=1e-4)

            # Features that change evenly across the 5 x 5 places: the code's are 5 / 256 of a cell apart.
            middle, down, right = torch.randn(3, 4, 128, 1, 1, generator=generator)
            places = torch.arange(-2.0, 3.0)
            cells = middle + down * places[:, None] + right * places
            code = middle + (down * places[:, None] + right * places) * 5 / 256
            theta = network.localization(cells.permute(0, 2, 3, 1).flatten(1))
            expected = published.theta(code)
            torch.testing.assert_close(theta[:, -3:].double(), expected[:, -3:], atol=1e-5, rtol=1e-5)
            for found, parameters in zip(network.displacement(theta), expected):
                warp = published.warped_grid(parameters) - published.polar_grid()
                torch.testing.assert_close(found.double(), warp.reshape(-1, 2), atol=1e-4, rtol=1e-4)

            patches = torch.rand(3, 32, 32, generator=generator)
            torch.testing.assert_close(network.hardnet(patches).double(), published.hardnet(patches), atol=1e-5, rtol=1e-4)

    @torch.no_grad()
    def test_describes_as_the_published_code_in_the_middle_of_an_image(self):
        # There the code places its patches at the keypoint.
        tensors = made_checkpoint()
        network, _ = self.converted(tensors)
        image = torch.rand(1, 1, 12, 15, generator=torch.Generator().manual_seed(3))
        image = F.interpolate(image, (161, 201), mode="bicubic", align_corners=True)[0, 0].clamp(0, 1)
        middle, size = torch.tensor([100.0, 80.0], dtype=torch.float64), 2.5
        theta, expected = Published(tensors).describe(image, middle, size)
        keypoint = torch.tensor([[*middle, size]], dtype=torch.float32)
        found_theta, found = network.describe(image, keypoint, convert.RADIUS_PER_SIZE)
        torch.testing.assert_close(found_theta[0, -3:].double(), theta[-3:], atol=1e-3, rtol=0)
        self.assertGreater(theta.abs().max(), 0.05)
        self.assertGreater((found.double() * expected).sum().item(), 0.9999)


class RefusalTest(Converted):
    def refusal(self, state):
        _, stop = self.run_program(state)
        self.assertFalse(self.out.exists())
        self.assertIn(str(self.checkpoint), stop)
        return stop

    def test_names_missing_unknown_and_wrongly_shaped_tensors(self):
        tensors = made_checkpoint()
        del tensors["resnet.5.0.downsample.0.weight"]
        tensors["resnet.6.0.conv1.weight"] = torch.zeros(1)
        tensors["tps_transform.loc.2.weight"] = torch.zeros(512, 1152)
        stop = self.refusal(tensors)
        self.assertIn("missing: resnet.5.0.downsample.0.weight; unknown: resnet.6.0.conv1.weight; "
                      "of the wrong shape: tps_transform.loc.2.weight (512, 1152) instead of (512, 3200)", stop)

    def test_weight_and_bias_of_the_last_layer_disagree(self):
        tensors = made_checkpoint()
        tensors["tps_transform.loc.11.bias"] = torch.zeros(132)
        self.assertIn("tps_transform.loc.11.bias (132,) instead of (68,)", self.refusal(tensors))

    def test_a_long_list_is_cut(self):
        self.assertIn("and 111 more", self.refusal({"hardnet.features.2.weight": torch.zeros(32, 1, 3, 3)}))

    def test_code_is_refused_and_not_run(self):
        mark = self.folder / "ran"

        class Code:
            def __reduce__(self):
                return os.mkdir, (str(mark),)

        for zipped in (True, False):
            torch.save({**made_checkpoint(), "resnet.0.weight": Code()}, self.checkpoint, _use_new_zipfile_serialization=zipped)
            self.assertIn("could run code. Nothing of it was run", self.refusal(None))
            self.assertFalse(mark.exists())

    def test_other_files(self):
        for data in (b"", b"no checkpoint", b"\1" * 1000, b"PK\x03\x04" + bytes(100)):
            self.checkpoint.write_bytes(data)
            self.assertIn("damaged", self.refusal(None))
        torch.save(made_checkpoint(), self.checkpoint)
        self.checkpoint.write_bytes(self.checkpoint.read_bytes()[:100_000])
        self.assertIn("damaged", self.refusal(None))
        with tarfile.open(self.checkpoint, "w") as archive:
            archive.add(__file__, "storages")
        self.assertIn("is a tar file", self.refusal(None))
        torch.jit.save(torch.jit.script(torch.nn.ReLU()), str(self.checkpoint))
        self.assertIn("is a TorchScript archive", self.refusal(None))
        for state in ([torch.zeros(1)], {"epoch": 3, "state_dict": {}}, torch.zeros(2)):
            self.assertIn("holds no tensors by name", self.refusal(state))
        self.checkpoint.unlink()
        self.assertIn("No such file", self.refusal(None))


if __name__ == "__main__":
    unittest.main()
