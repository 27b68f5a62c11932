# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import json
import struct
import tempfile
import unittest
from pathlib import Path

import numpy as np

from descriptor.training import tensor_file


class TensorFileTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = Path(self.folder.name) / "t.safetensors"

    def test_round_trip_of_every_type_and_shape(self):
        rng = np.random.default_rng(5)
        tensors = {code: rng.integers(0, 2, (3, 4)).astype(dtype)
                   for code, dtype in tensor_file._DTYPES.items()}
        tensors |= {"scalar": np.float32(2.5), "empty": np.zeros((0, 7), np.float32),
                    "strided": np.arange(12, dtype=np.float32).reshape(3, 4).T}
        tensor_file.save(self.path, tensors, {"key": "value"})
        found, metadata = tensor_file.load(self.path)
        self.assertEqual(metadata, {"key": "value"})
        self.assertEqual(list(found), list(tensors))
        for name, array in tensors.items():
            np.testing.assert_array_equal(found[name], array, err_msg=name)
            self.assertEqual(found[name].dtype, np.asarray(array).dtype, name)

    def test_truncation_anywhere_is_an_error(self):
        tensor_file.save(self.path, {"a": np.arange(6, dtype=np.float32)})
        whole = self.path.read_bytes()
        for size in (0, 4, 8, 20, len(whole) - 1):
            self.path.write_bytes(whole[:size])
            with self.assertRaisesRegex(tensor_file.TensorFileError, "t.safetensors"):
                tensor_file.load(self.path)

    def test_lying_headers_are_errors(self):
        lies = [
            {"a": {"dtype": "F32", "shape": [2**40], "data_offsets": [0, 8]}},
            {"a": {"dtype": "F32", "shape": [2], "data_offsets": [-8, 0]}},
            {"a": {"dtype": "F32", "shape": [-2, -1], "data_offsets": [0, 8]}},
            {"a": {"dtype": "X9", "shape": [2], "data_offsets": [0, 8]}},
            {"a": {"dtype": "F32", "shape": [2]}},
            {"a": 3},
            [1, 2],
        ]
        for lie in lies:
            raw = json.dumps(lie).encode()
            self.path.write_bytes(struct.pack("<Q", len(raw)) + raw + bytes(8))
            with self.assertRaises(tensor_file.TensorFileError, msg=str(lie)):
                tensor_file.load(self.path)
        self.path.write_bytes(struct.pack("<Q", 2**63) + bytes(100))
        with self.assertRaises(tensor_file.TensorFileError):
            tensor_file.load(self.path)

    def test_failed_write_leaves_the_old_file(self):
        tensor_file.save(self.path, {"a": np.zeros(3, np.float32)})
        before = self.path.read_bytes()
        with self.assertRaises(tensor_file.TensorFileError):
            tensor_file.save(self.path, {"a": np.zeros(3, np.complex64)})
        self.assertEqual(self.path.read_bytes(), before)


if __name__ == "__main__":
    unittest.main()
