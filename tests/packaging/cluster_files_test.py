#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The files that start a cluster say what they mean: names that exist, ports and folders that fit, units that systemd takes.

No container is started: whether the images do what is expected of them is not tried here.
"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as xml

import yaml

DOCKER = pathlib.Path(__file__).resolve().parent.parent.parent / "docker"
SERVICE_KEYS = {"image", "build", "command", "entrypoint", "environment", "depends_on", "ports", "volumes", "restart", "hostname",
                "stop_grace_period", "ulimits", "read_only", "tmpfs", "cap_drop", "security_opt"}
CONDITIONS = {"service_started", "service_healthy", "service_completed_successfully"}


class ComposeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.document = yaml.safe_load((DOCKER / "cluster.compose.yaml").read_text(encoding="utf-8"))
        cls.services = cls.document["services"]

    def test_every_name_is_known(self):
        self.assertEqual({key for key in self.document if not key.startswith("x-")}, {"services", "volumes"})
        for name, service in self.services.items():
            self.assertLessEqual(set(service), SERVICE_KEYS, name)
            self.assertTrue("image" in service or "build" in service, name)
            waits = service.get("depends_on", [])
            self.assertLessEqual(set(waits), set(self.services), name)
            if isinstance(waits, dict):
                for each in waits.values():
                    self.assertIn(each["condition"], CONDITIONS)
            for volume in service.get("volumes", []):
                source = volume.split(":")[0]
                if source.startswith("."):
                    self.assertTrue((DOCKER / source).is_file(), volume)
                else:
                    self.assertIn(source, self.document["volumes"])
            if "build" in service:
                self.assertTrue((DOCKER / service["build"]["context"] / service["build"]["dockerfile"]).is_file())

    def test_no_two_services_share_a_folder(self):
        own = [volume for service in self.services.values() for volume in service.get("volumes", []) if not volume.startswith(".")]
        self.assertEqual(len(own), len({volume.split(":")[0] for volume in own}))

    def test_the_url_names_all_nodes_and_keepers(self):
        url = self.services["pliant1"]["environment"]["PLIANT_DB"]
        hosts, keepers = re.fullmatch(r"clickhouse://pliant@(.*)/pliant[?]keeper=(.*)&cluster=pliant", url).groups()
        nodes = [name for name, service in self.services.items() if "SHARD" in service.get("environment", {})]
        self.assertEqual(hosts.split(","), [f"{node}:8123" for node in nodes])
        self.assertEqual(keepers.split(","), [f"keeper{i}:2181" for i in (1, 2, 3)])
        self.assertEqual([self.services[f"keeper{i}"]["environment"]["ZOO_MY_ID"] for i in (1, 2, 3)], ["1", "2", "3"])

    def test_clickhouse_knows_the_same_nodes(self):
        config = xml.parse(DOCKER / "cluster" / "clickhouse.xml").getroot()
        shards = [[host.text for host in shard.iter("host")] for shard in config.iter("shard") if list(shard)]
        self.assertEqual(shards, [["s1r1", "s1r2"], ["s2r1", "s2r2"]])
        for number, shard in enumerate(shards, 1):
            for node in shard:
                environment = self.services[node]["environment"]
                self.assertEqual((environment["SHARD"], environment["REPLICA"]), (str(number), node))
        self.assertEqual([node.find("host").text for node in config.iter("node")], ["keeper1", "keeper2", "keeper3"])
        needed = {each.get("from_env") for each in config.iter() if each.get("from_env")}
        self.assertLessEqual(needed, set(self.services["s1r1"]["environment"]))

    def test_the_proxy_knows_both_servers(self):
        config = (DOCKER / "cluster" / "nginx.conf").read_text(encoding="utf-8")
        named = re.findall(r"server (pliant\d):8080", config)
        self.assertEqual(named, [name for name in self.services if re.fullmatch(r"pliant\d", name)])
        self.assertEqual(config.count("{"), config.count("}"))

    def test_no_password_stands_in_a_file(self):
        text = (DOCKER / "cluster.compose.yaml").read_text(encoding="utf-8")
        for line in re.findall(r"PASSWORD: (.*)", text):
            self.assertTrue(line.startswith("${PLIANT_DB_PASSWORD:?"), line)


@unittest.skipUnless(shutil.which("systemd-analyze"), "systemd-analyze is not installed")
class UnitsTest(unittest.TestCase):
    def test_systemd_takes_the_units(self):
        with tempfile.TemporaryDirectory() as folder:
            for unit in DOCKER.glob("pliant-*.*"):
                text = unit.read_text(encoding="utf-8")
                (pathlib.Path(folder) / unit.name).write_text(re.sub(r"/usr/bin/pliant(-server)?", "/bin/true", text), encoding="utf-8")
            units = sorted(str(file) for file in pathlib.Path(folder).iterdir())
            self.assertEqual(len(units), 3)
            done = subprocess.run(["systemd-analyze", "verify", *units], capture_output=True, text=True, check=False)
            about = [line for line in done.stderr.splitlines() if "pliant-" in line]
            self.assertEqual(about, [])
            self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    sys.exit(unittest.main())
