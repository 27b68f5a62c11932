# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of the Python package share. PLIANT_BIN is the folder of the programs."""
import contextlib
import json
import os
import pathlib
import re
import subprocess
import tempfile
import time
import unittest

import numpy as np

import pliant

BIN = pathlib.Path(os.environ["PLIANT_BIN"])


def pattern(seed, width=160, height=120):
    """Grey discs, unlike those of any other seed: full of keypoints."""
    random = np.random.default_rng(seed)
    image = np.full((height, width), 128, np.uint8)
    y, x = np.mgrid[:height, :width]
    for _ in range(90):
        cx, cy, radius = random.integers(width), random.integers(height), random.integers(2, 11)
        image[(x - cx) ** 2 + (y - cy) ** 2 < radius**2] = random.integers(256)
    return image


def other_view(seed, width=160, height=120):
    """The same scene, bent a little and brighter."""
    image = pattern(seed, width, height)
    y, x = np.mgrid[:image.shape[0], :image.shape[1]].astype(np.float64)
    rows = np.clip(np.rint(y + 2 * np.sin(x / 40)), 0, image.shape[0] - 1).astype(int)
    columns = np.clip(np.rint(x + 3 + 2 * np.sin(y / 30)), 0, image.shape[1] - 1).astype(int)
    return np.clip(image[rows, columns] * 0.9 + 20, 0, 255).astype(np.uint8)


def png(image):
    from pliant import images
    return images.encoded(image)


def run(*arguments):
    """What the command line says."""
    done = subprocess.run([BIN / "pliant", *map(os.fsdecode, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True, timeout=250)
    if done.returncode != 0:
        raise AssertionError(f"pliant {arguments} ended with {done.returncode}: {done.stderr}")
    return json.loads(done.stdout)


def eventually(check, patience=60):
    """Waits until `check` raises no more: for what a server does in the background."""
    end = time.monotonic() + patience
    while True:
        try:
            return check()
        except (AssertionError, pliant.Error):
            if time.monotonic() > end:
                raise
            time.sleep(0.05)


class FolderCase(unittest.TestCase):
    """A folder that is gone with the test."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def write(self, name, image):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(png(image))
        return path

    @contextlib.contextmanager
    def fails(self, kind, code=None, words=""):
        with self.assertRaises(kind) as caught:
            yield caught
        error = caught.exception
        if code is not None:
            self.assertEqual(error.code, code)
        self.assertIn(words, str(error))


@contextlib.contextmanager
def server(folder, *flags):
    """The address of a fresh server and the path of its database."""
    database = pathlib.Path(folder) / "served.db"
    with open(pathlib.Path(folder) / "server.log", "w+") as log:
        process = subprocess.Popen([BIN / "pliant-server", "--db", database, "--listen", "127.0.0.1:0", "--descriptor",
                                    "rootsift", *flags], stdout=subprocess.PIPE, stderr=log, text=True)
        try:
            said = process.stdout.readline()
            address = re.search(r"http://\S+", said)
            if not address:
                log.seek(0)
                raise AssertionError(f"the server did not start: {said}{log.read()}")
            yield address.group(), database
        finally:
            process.terminate()
            process.stdout.close()
            status = process.wait(60)
        log.seek(0)
        assert status == 0, f"the server ended with {status}: {log.read()[-2000:]}"


def needs_module():
    """The compiled module was built: the tests that follow are not about another copy of the package."""
    from pliant import _native
    return pathlib.Path(_native.__file__), pathlib.Path(pliant.__file__)
