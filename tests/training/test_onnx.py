# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The network as ONNX meets the goldens: node by node everywhere, and in ONNX Runtime where it is installed."""
import contextlib
import io
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import cv2
import numpy as np
import torch

from descriptor.training import export, goldens, onnx_model, tensor_file

try:
    import onnx
except ImportError:
    onnx = None
try:
    import onnxruntime
except ImportError:
    onnxruntime = None

ROOT = Path(__file__).resolve().parents[2]
WEIGHTS = ROOT / "descriptor/model/deal.safetensors"
TOLERANCE = 3e-4  # as of the network in PyTorch


def golden(width, height, name):
    expected, _ = tensor_file.load(ROOT / f"tests/data/golden_{name}_{width}x{height}.safetensors")
    image = cv2.imread(str(ROOT / f"tests/data/golden_{width}x{height}.png"), cv2.IMREAD_GRAYSCALE)
    inputs = {"image": image[None, None].astype(np.float32) / 255,
              "keypoints": expected["keypoints_x_y_size"].astype(np.float32)}
    return inputs, expected["descriptors"]


@unittest.skipUnless(onnx, "python3-onnx is not installed")
class OnnxTest(unittest.TestCase):
    name, weights, more = "deal", WEIGHTS, []

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = Path(cls.folder.name) / f"{cls.name}.onnx"
        with contextlib.redirect_stdout(io.StringIO()), \
                mock.patch.object(sys, "argv", ["export", "--onnx", str(cls.path), *cls.more]):
            export.main()
        cls.model = onnx.load(str(cls.path))

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def test_says_what_it_is(self):
        onnx.checker.check_model(self.model)
        metadata = {item.key: item.value for item in self.model.metadata_props}
        self.assertEqual(metadata["sha256"], tensor_file.sha256(self.weights))
        self.assertEqual(metadata["model_id"], f"{self.name}:{metadata['sha256'][:16]}")
        self.assertEqual(metadata["radius_per_size"], tensor_file.load(self.weights)[1]["radius_per_size"])
        self.assertEqual([item.version for item in self.model.opset_import if not item.domain], [onnx_model.OPSET])
        sides = {value.name: [d.dim_param or d.dim_value for d in value.type.tensor_type.shape.dim]
                 for value in self.model.graph.input}
        self.assertEqual(sides, {"image": [1, 1, "height", "width"], "keypoints": ["keypoints", 3]})
        self.assertEqual(list(self.path.parent.iterdir()), [self.path])

    def test_graph_meets_the_goldens_at_any_size(self):
        from tests.training import onnx_numpy
        for size in goldens.SIZES:  # neither number of keypoints is the one it was traced with
            inputs, expected = golden(*size, self.name)
            found, = onnx_numpy.run(self.model, inputs)
            np.testing.assert_allclose(found, expected, atol=TOLERANCE, err_msg=str(size))
            one = dict(inputs, keypoints=inputs["keypoints"][:1])
            np.testing.assert_allclose(onnx_numpy.run(self.model, one)[0], expected[:1], atol=TOLERANCE)

    @unittest.skipUnless(onnxruntime, "ONNX Runtime is not installed (Debian 13: python3-onnxruntime)")
    def test_onnx_runtime_meets_the_goldens(self):
        session = onnxruntime.InferenceSession(str(self.path), providers=["CPUExecutionProvider"])
        for size in goldens.SIZES:
            inputs, expected = golden(*size, self.name)
            found, = session.run(None, inputs)
            np.testing.assert_allclose(found, expected, atol=TOLERANCE, err_msg=str(size))


class SmallOnnxTest(OnnxTest):
    name, weights = "deal-small", WEIGHTS.with_stem("deal-small")
    more = ["--weights", str(weights)]


class ModuleTest(unittest.TestCase):
    def test_is_the_network(self):
        model, metadata = onnx_model.load_model(WEIGHTS)
        network = onnx_model.OnnxDeal(model, float(metadata["radius_per_size"]))
        image = torch.rand(1, 1, 9, 300, generator=torch.Generator().manual_seed(4))  # one row of features
        points = torch.tensor([[0.0, 0.0, 9.0], [299.0, 8.0, 30.0], [-3.0, 12.0, 2.0], [150.2, 4.4, 1.5]])
        with torch.no_grad():
            expected = model(image[:, 0], torch.zeros(len(points), dtype=torch.long), points,
                             float(metadata["radius_per_size"]))
            np.testing.assert_allclose(network(image, points), expected, atol=1e-4)

    def test_says_what_is_missing(self):
        with tempfile.TemporaryDirectory() as folder, mock.patch.dict(sys.modules, {"onnx": None}):
            with self.assertRaisesRegex(onnx_model.OnnxError, "python3-onnx"):
                onnx_model.write_onnx(WEIGHTS, Path(folder) / "x.onnx")
            self.assertEqual(list(Path(folder).iterdir()), [])

    def test_needs_weights_and_folders_without_onnx(self):
        with mock.patch.object(sys, "argv", ["export", "--weights", str(WEIGHTS)]), \
                contextlib.redirect_stderr(io.StringIO()) as said, self.assertRaises(SystemExit) as ended:
            export.main()
        self.assertEqual(ended.exception.code, 2)
        self.assertIn("--dev", said.getvalue())


if __name__ == "__main__":
    unittest.main()
