#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""A server whose replica has shown what no other one has, and ends: reads and searches go on with what was acknowledged.

    tests/cluster/on_cluster.sh tests/cluster/behind_test.py --bin build/release/bin
"""
import sys
import time

from servers_test import run_case
from troubles import Troubles, ask, local
from model_client import IMAGES, SEARCH
from service.pictures import texture
from service.server import Connection, Wrong

FAR_AHEAD = 4 * 10**15  # a version of the year 2096


def on_node(port, statement):
    status, answer = Connection(("127.0.0.1", port), keep_alive=False).ask("POST", "/", statement.encode())
    if status != 200:
        raise Wrong(f"{statement}: {answer}")


def try_it(test):
    nodes = test.home / "nodes"
    lines = nodes.read_text(encoding="ascii").splitlines()
    first = int(lines[0].split()[2])
    troubles = Troubles(test)
    server = test.servers[0]
    troubles.kill("s1r2", "ClickHouse")
    on_node(first, f"INSERT INTO pliant.log VALUES ({FAR_AHEAD}, 0, 999, 'x', 1, 0, '')")
    for method, path, body in (("GET", f"{IMAGES}/kept-1", None), ("POST", SEARCH, texture("kept 1"))):
        if ask(server, method, path, body)[0] != 200:
            raise Wrong(f"{method} is not answered with one replica down")
    troubles.kill("s1r1", "ClickHouse")
    nodes.write_text("\n".join(lines[1:]) + "\n", encoding="ascii")
    local("up", test.home)
    end = time.monotonic() + 20
    while ask(server, "GET", f"{IMAGES}/kept-1")[0] != 200 and time.monotonic() < end:
        time.sleep(0.5)  # until the server has found it
    for i in range(10):
        for method, path, body in (("GET", f"{IMAGES}/kept-{i}", None), ("POST", SEARCH, texture(f"kept {i}"))):
            status = ask(server, method, path, body)[0]
            if status != 200:
                raise Wrong(f"{method} {path}, where the replica that is left has less: {status}")
    status, _ = ask(server, "PUT", f"{IMAGES}/new", texture("new"))
    if status != 503:
        raise Wrong(f"it writes, with one of two replicas: {status}")
    nodes.write_text("\n".join(lines) + "\n", encoding="ascii")
    local("up", test.home)
    troubles.wait_calm()


if __name__ == "__main__":
    sys.exit(run_case(__doc__, 1, try_it))
