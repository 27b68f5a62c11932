#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The house's walls: a folder includes only what stands below it, a third-party library stays in
the folders that own it, and the public headers of a folder show none of them."""
import pathlib
import re
import sys

LAYERS = ["descriptor", "vocab", "index", "server"]  # bottom to top
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)
# Library header prefix -> folders that may include it.
OWNERS = {
    "opencv2/": {"descriptor"},
    "dnnl": {"descriptor"},
    "torch/": set(),
    "SQLiteCpp/": {"index"},
    "sqlite3": {"index"},
    "httplib": {"server"},
    "prometheus/": {"server"},
}
# The simulator's core must build where there is only a compiler, Eigen and nlohmann-json (headers).
SIMULATION_FORBIDDEN = ("opencv2/", "dnnl", "openssl/")
SIMULATION = pathlib.Path("descriptor/simulation")


def sources(root):
    """Every C++ file of the folders, tracked or not; build folders are not below them."""
    return sorted(p for layer in LAYERS for p in (root / layer).rglob("*")
                  if p.suffix in {".h", ".cc", ".inl"})


def problems(root):
    found = []
    for path in sources(root):
        relative = path.relative_to(root)
        layer = relative.parts[0]
        for header in INCLUDE.findall(path.read_text(encoding="utf-8")):
            target = header.split("/")[0]
            if target in LAYERS and LAYERS.index(target) > LAYERS.index(layer):
                found.append(f"{relative} includes {header}: {target} stands above {layer}")
            for prefix, owners in OWNERS.items():
                if header.startswith(prefix) and layer not in owners:
                    found.append(f"{relative} includes {header}, which belongs to {sorted(owners)}")
    found += simulation_problems(root)
    installed = (root / "cmake" / "PliantInstall.cmake").read_text(encoding="utf-8")
    for public in re.findall(r"\b(?:descriptor|vocab|index)/[\w/]+\.h\b", installed):
        path = root / public
        for header in INCLUDE.findall(path.read_text(encoding="utf-8")):
            if "/" in header and header not in installed:
                found.append(f"public header {public} includes {header}, which is not installed")
    return found


def simulation_problems(root):
    """The core's sources, and every header of ours that they reach, name no library but those two."""
    lists = (root / SIMULATION / "CMakeLists.txt").read_text(encoding="utf-8")
    waiting = [(root / SIMULATION / name).resolve()
               for name in re.findall(r"^  ([\w./]+\.cc)\b", lists, re.MULTILINE)]
    found, seen = [], set()
    if not waiting:
        found.append(f"{SIMULATION}/CMakeLists.txt lists no sources")
    while waiting:
        path = waiting.pop()
        if path in seen:
            continue
        seen.add(path)
        for header in INCLUDE.findall(path.read_text(encoding="utf-8")):
            if header.startswith(SIMULATION_FORBIDDEN):
                found.append(f"{path.relative_to(root.resolve())}, part of the simulator's core, includes {header}")
            elif header.startswith("descriptor/"):
                waiting.append((root / header).resolve())
    return found


def main():
    root = pathlib.Path(sys.argv[1])
    checked = sources(root)
    if not checked:
        sys.exit(f"no sources found below {root}")
    found = problems(root)
    print("\n".join(found))
    print(f"{len(checked)} files, {len(found)} problems")
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
