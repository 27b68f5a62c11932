#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The steps of docker/PARTS.md, by docker/cluster_local.sh: an index in two parts becomes one in three while searches go on. None
may fail, and all give the same answer. Exit status 77 where PostgreSQL is not installed.

    tests/postgres/switch_parts_test.py --bin build/release/bin
"""
import argparse
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "chaos"))
from service.images import texture  # noqa: E402  (needs the path above)

LOCAL = HERE.parents[1] / "docker" / "cluster_local.sh"
COLLECTION = "collections/default"
IMAGES = 12


class Cluster:
    def __init__(self, binaries, home):
        self.environment, self.home = {**os.environ, "PLIANT_BIN": str(binaries)}, home

    def call(self, *arguments):
        """The addresses of the servers that answer afterwards, by part."""
        done = subprocess.run(["bash", LOCAL, arguments[0], self.home, *arguments[1:]], capture_output=True, text=True, check=False, timeout=600,
                              env=self.environment)
        if done.returncode == 77:
            sys.exit(77)
        if done.returncode != 0:
            sys.exit(f"cluster_local.sh {arguments}: {done.stdout}{done.stderr}")
        return {part: address for address, part in re.findall(r"(http://\S+)  ready  (\d+/\d+)", done.stdout)}


def ask(address, method, path, body=None, kind="image/png"):
    request = urllib.request.Request(f"{address}/v1/{path}", body, {"Content-Type": kind}, method=method)
    with urllib.request.urlopen(request, timeout=60) as answer:
        return json.loads(answer.read())


def search(address):
    answer = ask(address, "POST", f"{COLLECTION}/search?limit=0&group_by=image&verify=none", texture("3"))
    return answer["total"], [(hit["image_id"], hit["score"]) for hit in answer["hits"]]


def search_on(addresses, expected, stop, failures, counts):
    while not stop.is_set():
        for address in list(addresses):
            try:
                if search(address) != expected:
                    failures.append(f"{address} answers otherwise")
                counts.append(address)
            except OSError as error:
                if address in addresses:  # nobody asks servers that are about to end
                    failures.append(f"{address}: {error}")


def check_answers(cluster):
    before = cluster.call("up", "--parts", "2", "--copies", "1")
    first = before["1/2"]
    for i in range(IMAGES):
        ask(first, "PUT", f"{COLLECTION}/images/p{i}?object=o{i // 2}", texture(str(i)))
    job = ask(first, "POST", f"{COLLECTION}/vocabularies", b'{"words": 200}', "application/json")
    while ask(first, "GET", f"jobs/{job['id']}")["state"] not in ("done", "failed"):
        time.sleep(0.2)
    expected = search(first)
    assert expected[1][0][0] == "p3" and expected == search(before["2/2"]), expected
    peers = pathlib.Path(cluster.home) / "peers.toml"
    peers.write_text("timeout_ms = 30000\n" + peers.read_text(encoding="ascii"), encoding="ascii")
    addresses, stop, failures, counts = [*before.values()], threading.Event(), [], []
    searching = threading.Thread(target=search_on, args=(addresses, expected, stop, failures, counts))
    searching.start()
    switching = subprocess.Popen(["bash", LOCAL, "up", cluster.home, "--parts", "3", "--copies", "1"], env=cluster.environment, stdout=subprocess.DEVNULL)
    while "3 = " not in peers.read_text(encoding="ascii") and switching.poll() is None:
        time.sleep(0.01)
    addresses.clear()  # as a proxy that takes the old servers out
    assert switching.wait() == 0
    after = cluster.call("status")
    assert sorted(after) == ["1/3", "2/3", "3/3"], after
    addresses.extend(after.values())
    done = len(counts)
    while len(counts) < done + 9 and not failures:
        time.sleep(0.05)
    stop.set()
    searching.join()
    assert not failures, failures[:5]
    assert peers.read_text(encoding="ascii").startswith("timeout_ms = 30000\n[parts]\n"), "the script dropped an entry of peers.toml"
    for log in pathlib.Path(cluster.home).glob("server*/log"):
        assert "GET /v1/peer 200" not in log.read_text(encoding="utf-8"), "asking for states fills the log"
    print(f"{len(counts)} searches, the same answer each time")
    check_missing_part(cluster, after, expected)


def silent_parts(address):
    with urllib.request.urlopen(f"{address}/readyz", timeout=60) as answer:
        return [part["part"] for part in json.loads(answer.read())["parts"] if not part["answers"]]


def check_missing_part(cluster, addresses, expected):
    number = next(path for path in pathlib.Path(cluster.home).glob("server*") if (path / "part").read_text(encoding="ascii").strip() == "2/3")
    os.kill(int((number / "pid").read_text(encoding="ascii")), signal.SIGKILL)
    try:
        search(addresses["1/3"])
        raise AssertionError("a part is missing, and the search does not say so")
    except urllib.error.HTTPError as error:
        assert error.code == 503 and error.headers["Retry-After"] and json.loads(error.read())["code"] == "part_unavailable"
    some = ask(addresses["1/3"], "POST", f"{COLLECTION}/search?limit=0&group_by=image&verify=none&partial=true", texture("3"))
    assert abs(some["searched"] - 2 / 3) < 1e-9 and some["total"] < expected[0], some
    while silent_parts(addresses["1/3"]) != [2]:
        time.sleep(0.1)
    with urllib.request.urlopen(f"{addresses['1/3']}/metrics", timeout=60) as answer:
        assert 'pliant_part_requests_total{outcome="failed",part="2"}' in answer.read().decode()
    cluster.call("up")
    assert search(addresses["1/3"]) == expected


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="pliant-parts-") as home:
        os.chmod(home, 0o755)
        cluster = Cluster(options.bin.resolve(), home)
        try:
            check_answers(cluster)
        finally:
            cluster.call("remove")
            os.makedirs(home, exist_ok=True)  # which the script may have removed


if __name__ == "__main__":
    main()
