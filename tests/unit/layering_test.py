#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The house's walls: a folder includes only what stands below it, and so does each room of a folder;
a third-party library stays in the folders that own it, the database in its room, and the public
headers of a folder show none of them; a library's messages name options, never flags of a program."""
import pathlib
import re
import sys

LAYERS = ["descriptor", "vocab", "index", "server", "python"]  # bottom to top
APART = ("server", "python")  # both stand on index, and know nothing of each other
# The rooms of a folder, bottom to top; those of one floor (a tuple) do not know each other. A room
# that is not named here is a problem, too.
ROOMS = {
    "descriptor": ["base", "image", "warp", "simulation", "features", "match", "drawing", "deal",
                   "evaluation", "training"],
    "index": ["files", "records", "store", "store/sql", "store/sqlite", "store/postgres", "rank", "verify", "engine", "json",
              "selftest", "import", "tracking", "evaluation", "usage", "cli"],
    "server": [("decoder", "http", "web"), ("fetch", "peers"), ("auth", "jobs", "openapi"), "routes", "app"],
    "python": ["native"],
}
FLOORS = {folder: {room: floor for floor, rooms in enumerate(order)
                   for room in ((rooms,) if isinstance(rooms, str) else rooms)}
          for folder, order in ROOMS.items()}
# Rooms that only some include: what is in them is made by a factory that stands below.
CLOSED = {"index/store/sql": {"store/sqlite", "store/postgres"}, "index/store/sqlite": (), "index/store/postgres": ()}
# The word, in code and comments, and the one room that may say it.
DATABASE = (re.compile(r"sqlite", re.IGNORECASE), {"index", "server", "python"}, "index/store/sqlite")
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)
# Library header prefix -> folders that may include it.
OWNERS = {
    "opencv2/": {"descriptor"},
    "dnnl": {"descriptor"},
    "torch/": set(),
    "SQLiteCpp/": {"index/store/sqlite"},
    "sqlite3": {"index/store/sqlite"},
    "libpq-fe.h": {"index/store/postgres"},
    "httplib": {"server"},
    "curl/": {"server/fetch", "server/peers"},
    "pango/": {"descriptor/drawing"},
    "prometheus/": {"server"},
    "pybind11/": {"python"},
}
# Where flags may be named: the programs and what parses their command lines.
PROGRAMS = re.compile(r"^(index/cli/|index/usage/|server/|descriptor/.*_main\.cc)")
FLAG = re.compile(r'"(?:[^"\\\n]|\\.)*?(?<![\w-])--[a-z](?:[^"\\\n]|\\.)*"')
# The simulator's core must build where there is only a compiler, Eigen and nlohmann-json (headers).
SIMULATION_FORBIDDEN = ("opencv2/", "dnnl", "openssl/")
SIMULATION = pathlib.Path("descriptor/simulation")


def sources(root):
    """Every C++ file of the folders, tracked or not; build folders are not below them."""
    return sorted(p for layer in LAYERS for p in (root / layer).rglob("*")
                  if p.suffix in {".h", ".cc", ".inl"})


def room_of(path):
    """("index", "store/sqlite") of index/store/sqlite/schema.h."""
    folder, *rest = pathlib.PurePosixPath(path).parts[:-1]
    return folder, "/".join(rest)


def room_problems(relative, header):
    folder, room = room_of(relative)
    target_folder, target = room_of(header) if "/" in header else ("", "")
    if target_folder != folder or folder not in ROOMS or target == room:
        return []
    floors = FLOORS[folder]
    if target not in floors:
        return [f"{relative} includes {header}: there is no room {target}"]
    if room not in CLOSED.get(f"{folder}/{target}", {room}):
        return [f"{relative} includes {header}: {target} is closed to other rooms"]
    if floors[target] >= floors[room]:
        return [f"{relative} includes {header}: {target} does not stand below {room}"]
    return []


def problems(root):
    found = []
    for path in sources(root):
        relative = path.relative_to(root)
        layer, room = room_of(relative)
        text = path.read_text(encoding="utf-8")
        if layer in FLOORS and room not in FLOORS[layer]:
            found.append(f"{relative} lies in {room or 'no room'}, which is no room of {layer}")
            continue
        word, folders, home = DATABASE
        if layer in folders and f"{layer}/{room}" != home and word.search(text):
            found.append(f"{relative} names the database, which only {home} knows")
        for line in text.splitlines():
            if not PROGRAMS.match(relative.as_posix()) and FLAG.search(line.split("//")[0]):
                found.append(f"{relative} names a flag of a program: {line.strip()}")
        for header in INCLUDE.findall(text):
            found += room_problems(relative, header)
            target = header.split("/")[0]
            if target in LAYERS and LAYERS.index(target) > LAYERS.index(layer):
                found.append(f"{relative} includes {header}: {target} stands above {layer}")
            if target != layer and {target, layer} == set(APART):
                found.append(f"{relative} includes {header}: {target} and {layer} stand side by side")
            for prefix, owners in OWNERS.items():
                if header.startswith(prefix) and not {layer, f"{layer}/{room}"} & owners:
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
