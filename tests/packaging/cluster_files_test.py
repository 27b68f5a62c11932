#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The files of docker/ about PostgreSQL fit each other: services, hosts, names of standbys, folders, settings that PostgreSQL has, units.

No container, Patroni or service is started: compose_scripts_test.sh runs the scripts of the containers.
"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import urllib.parse

import yaml

DOCKER = pathlib.Path(__file__).resolve().parent.parent.parent / "docker"
LOCAL = DOCKER / "cluster_local.sh"
SERVICE_KEYS = {"image", "build", "command", "entrypoint", "environment", "depends_on", "ports", "volumes", "restart", "stop_grace_period",
                "healthcheck", "user", "shm_size", "read_only", "tmpfs", "cap_drop", "security_opt"}
CONDITIONS = {"service_started", "service_healthy", "service_completed_successfully"}


def read(name):
    return (DOCKER / name).read_text(encoding="utf-8")


def hosts(url):
    return urllib.parse.urlsplit(url).netloc.split("@")[1].split(",")


def settings(command):
    """The settings of `postgres -c NAME=VALUE ...`."""
    return dict(setting.split("=") for option, setting in zip(command, command[1:]) if option == "-c")


class ComposeTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.document = yaml.safe_load(read("cluster.compose.yaml"))
        cls.services = cls.document["services"]

    def test_every_name_is_known(self):
        self.assertEqual({key for key in self.document if not key.startswith("x-")}, {"services", "volumes"})
        for name, service in self.services.items():
            self.assertLessEqual(set(service), SERVICE_KEYS, name)
            self.assertTrue("image" in service or "build" in service, name)
            waits = service.get("depends_on", [])
            self.assertLessEqual(set(waits), set(self.services), name)
            if isinstance(waits, dict):
                for other, each in waits.items():
                    self.assertIn(each["condition"], CONDITIONS)
                    self.assertIn("healthcheck", self.services[other])
            for volume in service.get("volumes", []):
                source = volume.split(":")[0]
                if source.startswith("."):
                    self.assertTrue((DOCKER / source).is_file(), volume)
                    self.assertTrue(not source.endswith(".sh") or (DOCKER / source).stat().st_mode & 0o111, f"{source} is not executable")
                else:
                    self.assertIn(source, self.document["volumes"])
            if "build" in service:
                self.assertTrue((DOCKER / service["build"]["context"] / service["build"]["dockerfile"]).is_file())

    def test_no_two_services_share_a_folder(self):
        own = [volume for service in self.services.values() for volume in service.get("volumes", []) if not volume.startswith(".")]
        self.assertEqual(len(own), len({volume.split(":")[0] for volume in own}))

    def test_the_servers_know_both_databases(self):
        databases = [name for name, service in self.services.items() if service["image"].startswith("postgres:")]
        servers = [name for name, service in self.services.items() if "PLIANT_DB" in service.get("environment", {})]
        self.assertEqual((len(databases), len(servers)), (2, 2))
        for name in servers:
            self.assertEqual(hosts(self.services[name]["environment"]["PLIANT_DB"]), databases)
            self.assertEqual(set(databases), set(self.services[name]["depends_on"]))

    def test_the_primary_waits_for_the_standby(self):
        primary, standby = self.services["primary"], self.services["standby"]
        self.assertEqual(settings(primary["command"])["synchronous_standby_names"], settings(standby["command"])["cluster_name"])
        environment = standby["environment"]
        self.assertEqual(environment["PGHOST"], "primary")
        self.assertEqual(environment["PGPASSWORD"], primary["environment"]["POSTGRES_PASSWORD"])
        # A folder below the volume, which standby.sh can rename another one to.
        self.assertEqual(str(pathlib.PurePath(environment["PGDATA"]).parent), standby["volumes"][0].split(":")[1])

    def test_the_scripts_have_their_variables(self):
        given = {"HOME", "PGDATA"}  # by the image
        for name in ("primary", "standby"):
            used = set(re.findall(r"\$\{?([A-Z_]+)", read(f"cluster/{name}.sh")))
            self.assertLessEqual(used, given | set(self.services[name]["environment"]), name)

    def test_the_proxy_knows_both_servers(self):
        config = read("cluster/nginx.conf")
        self.assertEqual(re.findall(r"server (pliant\d):8080", config), [name for name in self.services if re.fullmatch(r"pliant\d", name)])
        self.assertEqual(config.count("{"), config.count("}"))

    def test_no_password_stands_in_a_file(self):
        lines = re.findall(r"PASSWORD: (.*)", read("cluster.compose.yaml"))
        self.assertTrue(lines)
        for line in lines:
            self.assertRegex(line, r"^\$\{(POSTGRES|PLIANT_DB)_PASSWORD:\?set \1_PASSWORD\}$")
        self.assertNotIn("password:", read("patroni.example.yml"))


class PatroniTest(unittest.TestCase):
    def test_its_machines_fit(self):
        text = read("patroni.example.yml")
        config = yaml.safe_load(text)
        members = [member.split(":")[0] for member in config["etcd3"]["hosts"]]
        self.assertEqual(len(members), 3)
        self.assertEqual(hosts(re.search(r"--db '(.*)'", text).group(1)), members)
        for part in ("restapi", "postgresql"):
            own, listen = config[part]["connect_address"], config[part]["listen"]
            self.assertEqual(own.split(":"), [config["name"], listen.split(":")[1]])
        allowed = [line.split() for line in config["postgresql"]["pg_hba"]]
        self.assertIn(["replication", config["postgresql"]["authentication"]["replication"]["username"]], [line[1:3] for line in allowed])
        self.assertEqual({line[-1] for line in allowed}, {"peer", "scram-sha-256"})
        dcs = config["bootstrap"]["dcs"]
        self.assertTrue(dcs["synchronous_mode"])
        self.assertTrue(not dcs["postgresql"]["use_pg_rewind"] or "data-checksums" in config["bootstrap"]["initdb"])


class SettingsTest(unittest.TestCase):
    def test_postgresql_has_them(self):
        programs = sorted(pathlib.Path("/usr/lib/postgresql").glob("*/bin/postgres"))
        if not programs:
            self.skipTest("PostgreSQL is not installed")
        described = subprocess.run([programs[-1], "--describe-config"], capture_output=True, text=True, check=True).stdout
        known = {line.split("\t")[0] for line in described.splitlines()}
        services = yaml.safe_load(read("cluster.compose.yaml"))["services"]
        used = {name for service in ("primary", "standby") for name in settings(services[service]["command"])}
        used |= set(yaml.safe_load(read("patroni.example.yml"))["bootstrap"]["dcs"]["postgresql"]["parameters"])
        used |= set(re.findall(r"^(?: {4})?([a-z_]+) = ", read("POSTGRESQL.md") + read(LOCAL), re.MULTILINE))
        used |= set(re.findall(r" -c ([a-z_]+)=", read(LOCAL)))
        self.assertGreater(len(used), 10)
        self.assertLessEqual(used, known)


class PageTest(unittest.TestCase):
    def test_what_it_names_exists(self):
        page = read("POSTGRESQL.md")
        for link in re.findall(r"\]\((?!https:)([^)#]*)", page):
            self.assertTrue((DOCKER / link).is_file(), link)
        self.assertIn("(POSTGRESQL.md)", read("README.md"))
        self.assertLessEqual(set(re.findall(r"cluster_local.sh ([a-z]+) ", page)), set(re.findall(r"^  ([a-z]+)\)", read(LOCAL), re.MULTILINE)))
        for file in ("POSTGRESQL.md", "pliant-server.service", "server.toml"):
            self.assertIn("/etc/pliant/database.env", read(file))

    def test_it_is_short(self):
        lines = read("POSTGRESQL.md").splitlines()
        self.assertLessEqual(len(lines), 150)
        self.assertLessEqual(max(map(len, lines)), 160)


@unittest.skipUnless(shutil.which("systemd-analyze"), "systemd-analyze is not installed")
class UnitsTest(unittest.TestCase):
    def test_systemd_takes_the_units(self):
        with tempfile.TemporaryDirectory() as folder:
            units = [pathlib.Path(folder) / unit.name for unit in DOCKER.glob("pliant-*.*")]
            self.assertTrue(units)
            for unit in units:
                unit.write_text(re.sub(r"/usr/bin/pliant(-server)?", "/bin/true", read(unit.name)), encoding="utf-8")
            done = subprocess.run(["systemd-analyze", "verify", *map(str, units)], capture_output=True, text=True, check=False)
            about = [line for line in done.stderr.splitlines() if "pliant-" in line]
            self.assertEqual(about, [])
            self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    sys.exit(unittest.main())
