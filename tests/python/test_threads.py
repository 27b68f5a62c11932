#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Threads: the GIL is free while the library works, results do not depend on who else works, and closing waits."""
import os
import signal
import subprocess
import sys
import threading
import time
import unittest
from concurrent.futures import ThreadPoolExecutor

import numpy as np

import pliant
from support import FolderCase, other_view, pattern


class Threads(FolderCase):
    def test_describe(self):
        images = [pattern(seed) for seed in range(4)]
        for descriptor in ("deal", "rootsift"):
            expected = [pliant.describe(image, descriptor=descriptor, threads=1) for image in images]
            with ThreadPoolExecutor(4) as pool:
                got = list(pool.map(lambda image: pliant.describe(image, descriptor=descriptor, threads=1), images * 2))
            for one, other in zip(got, expected * 2):
                np.testing.assert_array_equal(one.keypoints, other.keypoints)
                np.testing.assert_array_equal(one.descriptors, other.descriptors)

    def test_gil_is_free(self):
        """A thread of Python's goes on while another is inside of one long call."""
        image = pattern(1, 1200, 900)
        extractor = pliant.Extractor("deal", max_keypoints=4096, max_side=0)
        inside, ended = threading.Event(), threading.Event()

        def work():
            inside.set()
            extractor.describe(image, threads=1)
            ended.set()

        worker = threading.Thread(target=work)
        worker.start()
        inside.wait()
        turns = 0
        while not ended.is_set():
            time.sleep(0.005)
            turns += 1
        worker.join()
        self.assertGreater(turns, 10)

    def test_one_index(self):
        with pliant.Index(self.folder / "x.db", descriptor="rootsift") as index:
            with ThreadPoolExecutor(4) as pool:
                added = list(pool.map(lambda seed: index.add(pattern(seed), object=f"o{seed}", threads=1), range(8)))
            self.assertEqual(len({image.id for image in added}), 8)
            index.train(words=60)
            with ThreadPoolExecutor(4) as pool:
                hits = list(pool.map(lambda seed: index.search(other_view(seed), top=1, threads=1)[0], range(8)))
            self.assertEqual([hit.object for hit in hits], [f"o{seed}" for seed in range(8)])
            self.assertEqual(index.check(), [])

    def test_close_while_others_work(self):
        index = pliant.Index(self.folder / "x.db", descriptor="rootsift")
        ended, begun = [], [threading.Event(), threading.Event()]

        def work(number):
            try:
                for seed in range(1000 * number, 1000 * number + 200):
                    index.add(pattern(seed % 5, 320, 240), id=f"p{seed}", threads=1)
                    begun[number].set()
            except pliant.InvalidArgumentError as error:
                ended.append(error.code)

        workers = [threading.Thread(target=work, args=(number,)) for number in range(2)]
        for worker in workers:
            worker.start()
        for event in begun:
            self.assertTrue(event.wait(120))
        index.close()
        for worker in workers:
            worker.join()
        self.assertEqual(ended, ["closed", "closed"])
        with pliant.Index(self.folder / "x.db") as again:
            self.assertEqual(again.check(), [])


class Interrupts(FolderCase):
    def test_ctrl_c(self):
        """SIGINT in the middle of a long simulation: KeyboardInterrupt, and whole scenes stay."""
        self.write("textures/a.png", pattern(1, 256, 256))
        script = ("import pliant, sys\n"
                  "try:\n"
                  "    pliant.simulate(sys.argv[1], sys.argv[2], scenes=100000, width=64, height=48, jobs=1,\n"
                  "                    progress=lambda done, total: print(done, flush=True))\n"
                  "except KeyboardInterrupt:\n"
                  "    print('interrupted', flush=True)\n")
        process = subprocess.Popen([sys.executable, "-c", script, self.folder / "textures", self.folder / "out"],
                                   stdout=subprocess.PIPE, text=True)
        self.assertEqual(process.stdout.readline(), "1\n")
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 0)
        self.assertTrue(said.endswith("interrupted\n"), said[-200:])
        self.assertGreater(len(os.listdir(self.folder / "out")), 0)


if __name__ == "__main__":
    unittest.main()
