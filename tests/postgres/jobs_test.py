#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Jobs of two servers on one database, whose server is killed or stopped, or whose database restarts.

    PLIANT_TEST_DATABASE_SLOW=1 tests/postgres/on_postgres.sh tests/postgres/jobs_test.py --bin build/release/bin
"""
import argparse
import contextlib
import io
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "chaos"))
from service.images import texture  # noqa: E402  (needs the path above)
from service.server import Connection, Server, Wrong  # noqa: E402

IMAGES = 300
COLLECTION = "/v1/collections/default"
PATIENCE_S = 180


def archive(name):
    """A TAR of the images."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as tar:
        for i in range(IMAGES):
            data = texture(f"{name} {i}")
            entry = tarfile.TarInfo(f"{name}/{i}.png")
            entry.size = len(data)
            tar.addfile(entry, io.BytesIO(data))
    return buffer.getvalue()


def until(holds, what):
    end = time.monotonic() + PATIENCE_S
    while not (found := holds()):
        if time.monotonic() > end:
            raise Wrong(f"this did not happen in {PATIENCE_S} s: {what}")
        time.sleep(0.02)
    return found


class Case:
    """Two servers, A and B, on a database of their own."""

    def __init__(self, options, name):
        base = os.environ["PLIANT_TEST_DATABASE"]
        subprocess.run(["psql", "-q", base, "-c", f"CREATE SCHEMA {name}"], check=True)
        self.command = [options.bin / "pliant-server", "--db", f"{base}?options=-csearch_path%3D{name}", "--descriptor", "rootsift",
                        "--listen", "127.0.0.1:0", "--auto-train", "false", "--cores", "1"]
        self.logs, self.servers, self.name = options.logs, {}, name
        for server in "AB":
            self.start(server)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        for server in self.servers.values():
            server.kill()

    def start(self, server):
        self.servers[server] = Server(self.command, self.logs / f"{self.name}-{server}.log")
        self.servers[server].wait_ready()

    def ask(self, server, method, path, body=None, kind="application/json"):
        connection = Connection(self.servers[server].address, keep_alive=False)
        try:
            status, data = connection.ask(method, path, body, kind)
        finally:
            connection.close()
        if status >= 400:
            raise Wrong(f"{method} {path} at {server}: {status} {data[:300]}")
        return json.loads(data)

    def lacks_database(self, server):
        with contextlib.closing(Connection(self.servers[server].address, keep_alive=False)) as connection:
            return connection.ask("GET", "/v1/jobs")[0] == 503

    def job(self, server, number):
        return self.ask(server, "GET", f"/v1/jobs/{number}")

    def begin(self, path, body, kind="application/json"):
        """At A; its id, when a part of it is done."""
        number = self.ask("A", "POST", f"{COLLECTION}{path}", body, kind)["id"]

        def goes_on():
            job = self.job("A", number)
            if job["state"] not in ("queued", "running"):
                raise Wrong(f"the job was too quick for this test: {job}")
            return job["done"] > 0
        until(goes_on, "progress")
        return number

    def ended(self, server, number):
        return until(lambda: (job := self.job(server, number))["finished_at"] and job, f"the end of the job at {server}")

    def check_import(self, number, name, attempts):
        """Every image is there once, and has one result."""
        job = self.ended("B", number)
        if (job["state"], job["done"], job["failed"], job["attempts"]) != ("done", IMAGES, 0, attempts):
            raise Wrong(f"the import ended so: {job}")
        items = self.pages(f"/v1/jobs/{number}/items", "items")
        if [item["index"] for item in items] != list(range(IMAGES)):
            raise Wrong(f"the items of the import: {items}")
        objects = [image["object"] for image in self.pages(f"{COLLECTION}/images", "images")]
        if objects != [name] * IMAGES:
            raise Wrong(f"{len(objects)} images of {set(objects)}")
        return job

    def pages(self, path, what):
        found, after = [], ""
        while after is not None:
            page = self.ask("B", "GET", f"{path}?limit=500{after}")
            found += page[what]
            after = f"&cursor={page['next']}" if page.get("next") else None
        return found


def killed_during_import(options):
    with Case(options, "killed") as case:
        number = case.begin("/images:import", archive("killed"), "application/x-tar")
        case.servers["A"].kill()
        case.check_import(number, "killed", attempts=2)


def killed_during_training(options):
    with Case(options, "training") as case:
        case.ended("A", case.ask("A", "POST", f"{COLLECTION}/images:import", archive("training"), "application/x-tar")["id"])
        number = case.begin("/vocabularies", b'{"words": 5000}')
        case.servers["A"].kill()
        job = case.ended("B", number)
        if (job["state"], job["attempts"]) != ("done", 2):
            raise Wrong(f"the training ended so: {job}")
        vocabularies = case.ask("B", "GET", f"{COLLECTION}/vocabularies")["vocabularies"]
        if [one["active"] for one in vocabularies] != [True]:
            raise Wrong(f"the vocabularies: {vocabularies}")


def stopped_during_import(options):
    """B takes the job; A, which goes on with it when B is done, must not end it again."""
    with Case(options, "stopped") as case:
        number = case.begin("/images:import", archive("stopped"), "application/x-tar")
        case.servers["A"].process.send_signal(signal.SIGSTOP)
        begun = time.monotonic()
        job = case.check_import(number, "stopped", attempts=2)
        print(f"  B was done after {time.monotonic() - begun:.0f} s")
        case.servers["A"].process.send_signal(signal.SIGCONT)
        # When it has ended another job of the same kind, it has left the old one.
        after = case.ask("A", "POST", f"{COLLECTION}/images:import", archive("stopped"), "application/x-tar")["id"]
        if case.ended("A", after)["state"] != "done":
            raise Wrong("A does no jobs any more")
        for server in "AB":
            if case.job(server, number) != job:
                raise Wrong(f"{server} says of the job {case.job(server, number)}, B has ended it so: {job}")
        case.check_import(number, "stopped", attempts=2)


def runs(process):
    """Not so where only its parent has not heard of its end."""
    with contextlib.suppress(OSError):
        return bool(pathlib.Path(f"/proc/{process}/cmdline").read_bytes())
    return False


def restart_database(case):
    home, database = pathlib.Path(os.environ["PLIANT_TEST_DATABASE_HOME"]), os.environ["PLIANT_TEST_DATABASE"]
    postmaster = int((home / "data" / "postmaster.pid").read_text(encoding="utf-8").splitlines()[0])
    os.kill(postmaster, signal.SIGQUIT)
    until(lambda: not runs(postmaster), "the end of PostgreSQL")
    until(lambda: all(case.lacks_database(server) for server in "AB"), "an error of both servers")
    subprocess.Popen([home / "start"])  # it ends with this test
    until(lambda: subprocess.run(["psql", "-q", database, "-c", ""], check=False, stderr=subprocess.DEVNULL).returncode == 0,
          "the start of PostgreSQL")


def database_restarts(options):
    """The jobs go on."""
    with Case(options, "restarts") as case:
        number = case.begin("/images:import", archive("restarts"), "application/x-tar")
        restart_database(case)
        case.check_import(number, "restarts", case.ended("A", number)["attempts"])
        number = case.begin("/vocabularies", b'{"words": 5000}')
        restart_database(case)
        if case.ended("A", number)["state"] != "done":
            raise Wrong(f"the training ended so: {case.job('A', number)}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    options = parser.parse_args()
    options.logs = pathlib.Path(tempfile.mkdtemp(prefix="pliant-jobs-"))
    for case in (killed_during_import, killed_during_training, stopped_during_import, database_restarts):
        begun = time.monotonic()
        try:
            case(options)
        except Wrong as wrong:
            print(f"WRONG: {case.__name__}: {wrong}; the servers' logs are in {options.logs}")
            return 1
        print(f"{case.__name__.replace('_', ' ')}: {time.monotonic() - begun:.0f} s", flush=True)
    shutil.rmtree(options.logs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
