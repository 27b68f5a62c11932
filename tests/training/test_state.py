# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
import tempfile
import unittest
from pathlib import Path

from descriptor.training import state


class StateTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = Path(folder.name)
        self.runs, self.out = self.root / "runs", self.root / "out"

    def begin(self, stage):
        (self.runs / stage).mkdir(parents=True)
        for name in ("checkpoint.pt", "last.safetensors", "log.csv", "unrelated"):
            (self.runs / stage / name).write_bytes(f"{stage} {name} ".encode() * 300)

    def restored(self):
        target = self.root / f"back{len(list(self.root.iterdir()))}"
        self.assertTrue(state.unpack(self.out, target))
        return {p.relative_to(target).as_posix(): p.read_bytes() for p in target.rglob("*") if p.is_file()}

    def test_what_travels_is_what_the_next_slice_needs(self):
        self.begin("hardnet")
        self.begin("warp")
        written = state.pack(self.runs, self.out, piece_bytes=5000)
        self.assertLessEqual(max(p.stat().st_size for p in written), 5000)
        found = self.restored()
        self.assertEqual(set(found), {"hardnet/last.safetensors", "hardnet/log.csv", "warp/checkpoint.pt",
                                      "warp/log.csv"})
        for name, data in found.items():
            self.assertEqual(data, (self.runs / name).read_bytes())
        self.begin("joint")
        written = state.pack(self.runs, self.out)
        self.assertEqual(set(written), set(self.out.iterdir()))  # no piece of the state before
        self.assertEqual(set(self.restored()), {"hardnet/log.csv", "warp/log.csv", "joint/log.csv",
                                                "joint/checkpoint.pt"})

    def test_a_finished_stage_travels_as_its_weights(self):
        self.begin("hardnet")
        (self.runs / "hardnet" / "finished").touch()
        state.pack(self.runs, self.out)
        expected = {"hardnet/last.safetensors", "hardnet/log.csv", "hardnet/finished"}
        self.assertEqual(set(self.restored()), expected)
        further = self.root / "further"
        state.unpack(self.out, further)
        state.pack(further, self.out)  # the machine after that one
        self.assertEqual(set(self.restored()), expected)

    def test_damage_is_noticed_and_newer_work_is_kept(self):
        self.begin("hardnet")
        state.pack(self.runs, self.out, piece_bytes=5000)
        self.assertFalse(state.unpack(self.out, self.runs))
        piece = self.out / "state.001"
        piece.write_bytes(b"x" + piece.read_bytes()[1:])
        with self.assertRaisesRegex(ValueError, "checksum"):
            state.unpack(self.out, self.root / "new")
        piece.unlink()
        with self.assertRaisesRegex(ValueError, "missing"):
            state.unpack(self.out, self.root / "new")


if __name__ == "__main__":
    unittest.main()
