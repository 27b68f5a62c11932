#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""`pliant cluster` against two shards of two replicas on this machine (docker/cluster_local.sh).

    tests/cluster/cluster_test.py --pliant build/release/bin/pliant

Exit status 77 where Debian's clickhouse-server or libzookeeper-java is not installed.
"""
import argparse
import contextlib
import json
import os
import pathlib
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import urllib.error
import urllib.request

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "chaos"))
from service.pictures import write_folder  # noqa: E402  (needs the path above)

SCRIPT = HERE.parent.parent / "docker" / "cluster_local.sh"
OPTIONS = argparse.Namespace()
NODES = ("s1r1", "s1r2", "s2r1", "s2r2")


def local(action, folder, *more):
    return subprocess.run(["bash", SCRIPT, action, folder, *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True, check=False, timeout=180)


class Listener:
    """Passes connections on to `port` and remembers what goes there."""

    def __init__(self, port):
        self.heard = []
        self.target = ("127.0.0.1", port)
        self.socket = socket.create_server(("127.0.0.1", 0))
        self.port = self.socket.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            try:
                client, _ = self.socket.accept()
                server = socket.create_connection(self.target)
            except OSError:
                return
            threading.Thread(target=self.pump, args=(client, server, self.heard.append), daemon=True).start()
            threading.Thread(target=self.pump, args=(server, client, lambda data: None), daemon=True).start()

    @staticmethod
    def pump(source, target, look):
        try:
            with source:
                while data := source.recv(65536):
                    look(data)
                    target.sendall(data)
            target.shutdown(socket.SHUT_WR)
        except OSError:
            pass


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

    def give_password(self):
        """A user with a password, on all nodes, which read their users' file again by themselves."""
        for node in NODES:
            file = pathlib.Path(self.folder.name) / node / "users.xml"
            text = file.read_text(encoding="utf-8")
            user = text[text.index("<default><password>"):text.index("</users>")]
            keyed = user.replace("<default><password></password>", "<keyed><password>opensesame</password>")
            keyed = keyed.replace("</default>", "</keyed>")
            file.write_text(text.replace("</users>", keyed + "</users>"), encoding="utf-8")
        deadline = time.monotonic() + 60
        for node in NODES:
            request = urllib.request.Request(f"http://127.0.0.1:{self.ports[node]}/?query=SELECT%201",
                                             headers={"X-ClickHouse-User": "keyed", "X-ClickHouse-Key": "opensesame"})
            while time.monotonic() < deadline:
                try:
                    urllib.request.urlopen(request, timeout=10).close()
                    break
                except urllib.error.HTTPError:
                    time.sleep(0.2)

    def test_3b_a_password_is_in_no_statement(self):
        self.give_password()
        listeners = [Listener(int(self.ports[node])) for node in NODES]
        for listener in listeners:
            self.addCleanup(listener.socket.close)
        self.addCleanup(os.environ.pop, "PLIANT_DB_PASSWORD")
        os.environ["PLIANT_DB_PASSWORD"] = "opensesame"
        rest = self.url[self.url.index("/pliant?"):]

        def url(some):
            return "clickhouse://keyed@" + ",".join(f"127.0.0.1:{listener.port}" for listener in some) + rest

        self.assertEqual(self.cluster("check", url=url(listeners)), {"ok": True, "problems": []})
        for listener in listeners:
            heard = b"".join(listener.heard)
            self.assertTrue(b"opensesame" in heard)
            self.assertTrue(b"cityHash64" in heard, "each node is asked by itself")
            self.assertFalse(b"opensesame" in re.sub(rb"X-ClickHouse-Key: [^\r\n]*\r\n", b"", heard))
        # The others are not in the URL, and the password must not be sent through the first.
        few = self.cluster("check", status=1, url=url(listeners[:1]))["problems"]
        self.assertEqual(len([problem for problem in few if "name that of each node in the URL" in problem]), 3, few)
        os.environ["PLIANT_DB_PASSWORD"] = "wrong"
        self.assertIn("assword",
                      self.pliant("cluster", "check", "--db", url(listeners), status=1).stderr)

    def count_pictures(self, database):
        return sum(int(self.on_node(node, f"SELECT count() FROM {database}.pictures")) for node in ("s1r1", "s2r1"))

    def copy(self, source, target):
        done = json.loads(self.pliant("db", "copy", target, "--db", source, "--compare", "10", "--json").stdout)
        self.assertEqual(done["differences"], [])
        return done

    def kill_copy(self, source, target, written):
        """Kills a copy as soon as written() says that some of it is there."""
        command = [OPTIONS.pliant, "db", "copy", target, "--db", source, "--commit-every", "1"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as copying:
            while copying.poll() is None and not written():
                time.sleep(0.01)
            copying.kill()

    def test_3c_a_copy_into_a_cluster_and_back(self):
        """Killed in both directions, gone on with, and with the rankings of the original at the end."""
        folder = pathlib.Path(self.folder.name) / "copies"
        pictures = 90
        write_folder(folder / "shelf", "thing", pictures // 3, 3)
        first, last = str(folder / "first.db"), str(folder / "last.db")
        url = self.url.replace("/pliant?", "/copies?")
        self.cluster("init", url=url)
        self.pliant("index", str(folder / "shelf"), "--db", first, "--descriptor", "rootsift", "--json")
        self.kill_copy(first, url, lambda: self.count_pictures("copies") > 20)
        there = self.count_pictures("copies")
        self.assertLess(there, pictures, "it was killed too late: nothing is tested")
        done = self.copy(first, url)
        self.assertEqual(done["copied"] + done["unchanged"], pictures)
        self.assertGreater(done["unchanged"], 0)
        self.assertEqual(done["rankings_compared"], 10)

        def count_last():
            with contextlib.suppress(sqlite3.Error), sqlite3.connect(f"file:{last}?mode=ro", uri=True) as database:
                return database.execute("SELECT count(*) FROM pictures").fetchone()[0]
            return 0

        self.kill_copy(url, last, lambda: count_last() > 20)
        self.assertLess(count_last(), pictures, "it was killed too late: nothing is tested")
        done = self.copy(url, last)
        self.assertGreater(done["unchanged"], 20)
        self.assertEqual(done["copied"] + done["unchanged"], pictures)
        done = self.copy(first, last)
        self.assertEqual((done["copied"], done["unchanged"], done["extra"]), (0, pictures, 0))

    def quorum(self, *more, status=0):
        url = self.url.replace("/pliant?", "/quorum?")
        return json.loads(self.pliant("cluster", "quorum", *more, "--db", url, "--json", status=status).stdout)

    def test_3d_one_replica_acknowledges_while_the_other_is_down(self):
        folder = pathlib.Path(self.folder.name) / "quorum"
        url = self.url.replace("/pliant?", "/quorum?")
        self.cluster("init", url=url)
        shown = self.quorum()
        self.assertEqual((shown["quorum"], shown["acknowledge"], shown["replicas"]), ("auto", 2, 2))
        self.assertEqual([shard["active"] for shard in shown["shards"]], [2, 2])
        for wrong, code in (("3", "quorum_too_large"), ("0", "quorum_invalid"), ("many", "quorum_invalid")):
            self.assertEqual(self.quorum(wrong, status=2)["error"]["code"], code)

        def add(name, status=0):
            write_folder(folder / name, name, 2, 2)
            return self.pliant("index", str(folder / name), "--db", url, "--descriptor", "rootsift", "--json", status=status)

        add("before")
        os.kill(self.process("s1r2"), signal.SIGKILL)
        self.assertIn("error", json.loads(add("refused", status=1).stdout))
        self.assertEqual(self.quorum("1")["acknowledge"], 1)
        self.assertEqual(json.loads(add("meanwhile").stdout)["indexed"], 4)
        self.assertIn("one replica alone", "\n".join(self.cluster("check", status=1, url=url)["problems"]))
        self.assertEqual(self.quorum("auto", "--wait", "1", status=1)["error"]["code"], "replica_behind")
        self.assertEqual(self.quorum()["quorum"], 1)
        self.assertEqual(local("up", self.folder.name).returncode, 0)
        self.assertEqual(self.quorum("auto")["quorum"], "auto")
        for pair in (("s1r1", "s1r2"), ("s2r1", "s2r2")):
            counts = {self.on_node(node, "SELECT count() FROM quorum.pictures") for node in pair}
            self.assertEqual(len(counts), 1, counts)
        self.assertEqual(self.cluster("check", url=url), {"ok": True, "problems": []})
        self.assertEqual(json.loads(add("after").stdout)["indexed"], 4)

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

    def test_6_what_is_no_cluster_and_an_empty_one(self):
        self.assertIn("pliant db", self.pliant("cluster", "check", "--db", "a.db", status=2).stderr)
        self.assertIn("cannot be reached", self.pliant("cluster", "check", "--db", "clickhouse://127.0.0.1:1/p",
                                                       status=1).stderr)
        self.assertIn("is empty", self.pliant("db", "stats", "--db", self.url, status=1).stderr)
        self.assertIn("names no Keeper", self.pliant("db", "stats", "--db", self.url.split("?")[0], status=2).stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pliant", required=True)
    OPTIONS.pliant = parser.parse_args().pliant
    with tempfile.TemporaryDirectory() as empty:
        status = local("status", empty)
        if status.returncode == 77:
            print(status.stderr.strip() or "clickhouse-server or libzookeeper-java is not installed")
            sys.exit(77)
    unittest.main(argv=sys.argv[:1], verbosity=2)


if __name__ == "__main__":
    main()
