#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""`pliant cluster` against two shards of two replicas on this machine (docker/cluster_local.sh).

    tests/cluster/cluster_test.py --pliant build/release/bin/pliant

Exit status 77 where Debian's clickhouse-server or zookeeper is not installed.
"""
import argparse
import json
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request

HERE = pathlib.Path(__file__).resolve().parent
SCRIPT = HERE.parent.parent / "docker" / "cluster_local.sh"
OPTIONS = argparse.Namespace()
NODES = ("s1r1", "s1r2", "s2r1", "s2r2")


def local(action, folder, *more):
    return subprocess.run(["bash", SCRIPT, action, folder, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True, check=False, timeout=180)


class ClusterTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="pliant-cluster-", ignore_cleanup_errors=True)
        cls.addClassCleanup(cls.folder.cleanup)
        cls.addClassCleanup(local, "down", cls.folder.name)
        up = local("up", cls.folder.name)
        if up.returncode != 0:
            raise RuntimeError(f"{up.stdout}{up.stderr}")
        cls.url = up.stdout.split()[-1]
        cls.ports = dict(zip(NODES, re.findall(r"127[.]0[.]0[.]1:(\d+)", cls.url)))

    def pliant(self, *command, status=0):
        done = subprocess.run([OPTIONS.pliant, *command], capture_output=True, text=True, check=False, timeout=180)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done

    def cluster(self, action, status=0, url=None):
        done = self.pliant("cluster", action, "--db", url or self.url, "--json", status=status)
        return json.loads(done.stdout) if done.stdout else done.stderr

    def on_node(self, node, statement):
        address = f"http://127.0.0.1:{self.ports[node]}/"
        with urllib.request.urlopen(address, statement.encode(), timeout=60) as answer:
            return answer.read().decode()

    def process(self, node):
        return int((pathlib.Path(self.folder.name) / node / "pid").read_text(encoding="ascii"))

    def problems(self):
        return "\n".join(self.cluster("check", status=1)["problems"])

    def test_1_tables_are_made_once(self):
        made = self.cluster("init")
        self.assertGreaterEqual(len(made["made"]), 10, made)
        again = self.cluster("init")
        self.assertEqual(again["made"], [])
        self.assertEqual(sorted(again["present"]), sorted(made["made"]))
        for node in NODES:
            self.assertIn("words", self.on_node(node, "SHOW TABLES FROM pliant").split())

    def test_2_every_table_of_every_node_is_listed(self):
        nodes = self.cluster("status")["nodes"]
        self.assertEqual([node["name"] for node in nodes], list(NODES))
        self.assertEqual([(node["shard"], node["replica"]) for node in nodes], [(1, 1), (1, 2), (2, 1), (2, 2)])
        for node in nodes:
            self.assertTrue(node["answers"], node)
            self.assertIn("pictures", [table["table"] for table in node["tables"]])

    def test_3_a_sound_cluster_has_no_problems(self):
        self.assertEqual(self.cluster("check"), {"ok": True, "problems": []})

    def test_4_a_table_that_one_node_lost(self):
        self.on_node("s2r1", "DROP TABLE pliant.features")
        self.assertRegex(self.problems(), r"s2r1.*features|features.*s2r1")

    def test_5_a_node_that_does_not_answer(self):
        subprocess.run(["kill", f"-{int(signal.SIGKILL)}", str(self.process("s1r2"))], check=True)
        deadline = time.monotonic() + 60
        while "shard 1 replica 2" not in self.problems() and time.monotonic() < deadline:
            time.sleep(0.5)
        self.assertIn("shard 1 replica 2", self.problems())
        refused = self.pliant("cluster", "init", "--db", self.url, status=1)
        self.assertIn("does not answer", refused.stderr)
        self.assertEqual(local("up", self.folder.name).returncode, 0)

    def test_6_what_is_no_cluster_and_what_clusters_cannot_do_yet(self):
        self.assertIn("pliant db", self.pliant("cluster", "check", "--db", "a.db", status=2).stderr)
        self.assertIn("cannot be reached", self.pliant("cluster", "check", "--db", "clickhouse://127.0.0.1:1/p",
                                                       status=1).stderr)
        self.assertIn("pliant cluster", self.pliant("db", "stats", "--db", self.url, status=2).stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pliant", required=True)
    OPTIONS.pliant = parser.parse_args().pliant
    with tempfile.TemporaryDirectory() as empty:
        status = local("status", empty)
        if status.returncode == 77:
            print(status.stderr.strip() or "clickhouse-server or zookeeper is not installed")
            sys.exit(77)
    unittest.main(argv=sys.argv[:1], verbosity=2)


if __name__ == "__main__":
    main()
