#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What `cmake --install` lays down, the files of the package, their types, and the example."""
import ast
import importlib.util
import os
import pathlib
import subprocess
import sys
import unittest

import cv2
import numpy as np

import pliant
from support import FolderCase, other_view, pattern

BUILD = pathlib.Path(os.environ["PLIANT_BINARY_DIR"])
SOURCE = pathlib.Path(__file__).resolve().parents[2] / "python"


def install(prefix, **environment):
    subprocess.run(["cmake", "--install", BUILD, "--prefix", prefix, "--component", "python"], check=True,
                   stdout=subprocess.DEVNULL, timeout=120, env={**os.environ, **environment})


class Installed(FolderCase):
    def test_prefix(self):
        prefix = self.folder / "prefix"
        install(prefix)
        found = list(prefix.rglob("pliant/__init__.py"))
        self.assertEqual(len(found), 1)
        folder = found[0].parent.parent
        names = {path.name for path in found[0].parent.iterdir()}
        self.assertEqual({path.name for path in (SOURCE / "pliant").iterdir()} - names - {"__pycache__"}, set())
        self.assertTrue(any(name.startswith("_native.") and name.endswith(".so") for name in names))
        self.assertFalse(any(path.is_symlink() for path in found[0].parent.iterdir()))
        weights = prefix / "share" / "pliant"
        weights.parent.mkdir(parents=True, exist_ok=True)
        weights.symlink_to(BUILD.resolve() / "share" / "pliant")
        script = ("import os, sys, pliant\nfrom pliant.features import default_model\n"
                  "assert pliant.__file__.startswith(sys.argv[1])\n"
                  "print(os.fsdecode(default_model()))\nprint(pliant.Extractor('deal').model_id)")
        environment = {name: value for name, value in os.environ.items() if name != "PLIANT_MODEL"}
        done = subprocess.run([sys.executable, "-c", script, str(folder)], cwd=self.folder, text=True, check=True,
                              env={**environment, "PYTHONPATH": str(folder)}, stdout=subprocess.PIPE, timeout=100)
        where, model = done.stdout.split()
        self.assertEqual(pathlib.Path(where), weights)
        self.assertEqual(model, pliant.Extractor("deal").model_id)

    def test_debian(self):
        """Below /usr it goes where Debian's Python looks of itself."""
        install("/usr", DESTDIR=str(self.folder / "root"))
        found = list((self.folder / "root").rglob("pliant/__init__.py"))
        self.assertEqual(len(found), 1)
        self.assertIn("/" + str(found[0].parents[1].relative_to(self.folder / "root")), sys.path)


class Package(FolderCase):
    def test_native_types(self):
        """Every name of the compiled module is in _native.pyi, and no other."""
        from pliant import _native

        tree = ast.parse((SOURCE / "pliant" / "_native.pyi").read_text())
        said = {}
        for node in tree.body:
            if isinstance(node, ast.ClassDef):
                said[node.name] = {part.name for part in node.body if isinstance(part, ast.FunctionDef)}
            elif isinstance(node, ast.FunctionDef):
                said[node.name] = None
        public = {name for name in dir(_native) if not name.startswith("__")}
        self.assertEqual(set(said), public)
        for name, methods in said.items():
            if methods is not None:
                # Debian 13's pybind11 adds _pybind11_conduit_v1_.
                there = {method for method in vars(getattr(_native, name)) if not method.startswith(("__", "_pybind11"))}
                self.assertEqual(methods - {"__init__"}, there, name)

    def test_docstrings(self):
        for name in pliant.__all__:
            value = getattr(pliant, name)
            self.assertTrue(value.__doc__, name)
            if isinstance(value, type):
                for method in dir(value):
                    function = getattr(value, method)
                    if not method.startswith("_") and callable(function) and not issubclass(value, Exception):
                        self.assertTrue(function.__doc__, f"{name}.{method}")

    def test_example(self):
        if importlib.util.find_spec("matplotlib") is None:
            self.skipTest("the example needs Matplotlib (python3-matplotlib)")
        for seed in range(4):
            self.write(f"shop/o{seed}/a.png", pattern(seed, 320, 240))
        query = self.write("query.png", other_view(2))
        self.write("shop/o2/a.png", pattern(2))
        script = SOURCE / "examples" / "find_in_folder.py"
        subprocess.run([sys.executable, script, self.folder / "shop", query, self.folder / "out.png"],
                       env={name: value for name, value in os.environ.items() if name != "DISPLAY"}, check=True, timeout=300)
        drawn = (self.folder / "out.png").read_bytes()
        self.assertIn(f"Title\0{self.folder / 'shop' / 'o2' / 'a.png'}".encode(), drawn)
        image = cv2.imdecode(np.frombuffer(drawn, np.uint8), cv2.IMREAD_COLOR).astype(int)
        self.assertGreater((np.ptp(image, axis=2) > 60).sum(), 2000)  # coloured lines over grey images
        code = script.read_text().split('"""')[2].strip().splitlines()
        self.assertEqual(len([line for line in code if line]), 15)


if __name__ == "__main__":
    unittest.main()
