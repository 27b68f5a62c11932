#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""install_dir.py PREFIX: the folder, relative to PREFIX, into which packages for this Python go. One that Python
searches of itself (Debian: lib/python3/dist-packages of /usr, lib/python3.N/dist-packages of /usr/local; that of a
virtual environment), else the usual one, for PYTHONPATH."""
import os
import pathlib
import site
import sys
import sysconfig


def install_dir(prefix):
    for folder in site.getsitepackages():
        path = pathlib.PurePath(folder)
        if path.is_relative_to(prefix) and path.relative_to(prefix).parts[:1] in (("lib",), ("lib64",)):
            return path.relative_to(prefix)
    scheme = sysconfig.get_path("platlib", "posix_prefix", vars={"base": prefix, "platbase": prefix})
    return pathlib.PurePath(scheme).relative_to(prefix)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: install_dir.py PREFIX")
    print(install_dir(os.path.abspath(sys.argv[1])))
