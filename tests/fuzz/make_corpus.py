#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Writes the corpora's own files, seed_*, into tests/fuzz/corpus: small valid inputs of every kind, and the
small ones of the hostile images. Files with other names stay: fuzzing found them, or heif-enc wrote them (.heic, .avif).

    /usr/bin/python3 tests/fuzz/make_corpus.py

Needs python3-opencv, whose encoders write some of the images.
"""
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "chaos"))

from seeds import blobs, http, images, texts  # noqa: E402  pylint: disable=wrong-import-position

MOST_BYTES = 12_000  # of a file


def main():
    total = 0
    for room in (blobs, http, images, texts):
        for target, files in room.SEEDS.items():
            folder = HERE / "corpus" / target
            folder.mkdir(parents=True, exist_ok=True)
            for old in folder.glob("seed_*"):
                old.unlink()
            for name, data in files().items():
                if len(data) > MOST_BYTES:
                    sys.exit(f"{target}/{name} has {len(data)} bytes")
                (folder / f"seed_{name}").write_bytes(data)
                total += len(data)
            print(f"{len(list(folder.iterdir())):>3} files {target}")
    print(f"{total} bytes of seeds")


if __name__ == "__main__":
    main()
