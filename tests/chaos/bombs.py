#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Makes a folder of hostile images, those of tests/chaos/hostile.

    tests/chaos/bombs.py FOLDER
"""
import argparse
import pathlib

from hostile import BOMBS


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("folder", type=pathlib.Path)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, make in BOMBS.items():
        data = make()
        (folder / name).write_bytes(data)
        print(f"{len(data):>9} {name}: {make.__doc__.strip()}")


if __name__ == "__main__":
    main()
