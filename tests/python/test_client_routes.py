#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The client has a method for every operation of the HTTP interface, and one version has one number everywhere."""
import http.server
import json
import pathlib
import re
import subprocess
import threading
import unittest
import urllib.parse
import urllib.request

import pliant
from support import BIN, FolderCase, server

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]

# operationId: a call that asks for it. `file`: where a download goes.
CALLS = {
    "aliases.list": lambda client, file: client.aliases(),
    "aliases.patch": lambda client, file: client.set_aliases({"live": "default"}),
    "backups.content": lambda client, file: client.save_backup("a.db", file),
    "backups.create": lambda client, file: client.backup("a.db", wait=False),
    "backups.delete": lambda client, file: client.delete_backup("a.db"),
    "backups.list": lambda client, file: client.backups(),
    "collections.delete": lambda client, file: client.drop(),
    "collections.export": lambda client, file: client.save_records(file, q="mug"),
    "collections.features": lambda client, file: client.save_features(file, q="mug"),
    "collections.get": lambda client, file: client.info(),
    "collections.list": lambda client, file: client.collections(),
    "collections.patch": lambda client, file: client.set_display_name("Shelf"),
    "collections.put": lambda client, file: client.create(),
    "collections.test": lambda client, file: client.self_test(pictures=2, wait=False),
    "collections.tested": lambda client, file: client.self_test_report(),
    "compare": lambda client, file: client.compare(b"a", b"b"),
    "images.content": lambda client, file: client.content("a"),
    "images.create": lambda client, file: client.add(b"a"),
    "images.delete": lambda client, file: client.delete("a"),
    "images.delete_where": lambda client, file: client.delete_where({"year": 2024}, q="mug"),
    "images.features": lambda client, file: client.features("a"),
    "images.get": lambda client, file: client.get("a"),
    "images.import": lambda client, file: client.import_archive(file.with_suffix(".tar"), wait=False),
    "images.list": lambda client, file: client.facets("shop"),
    "images.patch": lambda client, file: client.update("a", object="mug"),
    "images.put": lambda client, file: client.add(b"a", id="a"),
    "images.thumbnail": lambda client, file: client.thumbnail("a"),
    "imports.create": lambda client, file: client.import_folder("shelf", wait=False),
    "jobs.cancel": lambda client, file: client.cancel("a"),
    "jobs.get": lambda client, file: client.job("a"),
    "jobs.items": lambda client, file: list(client.job_items("a")),
    "jobs.list": lambda client, file: client.jobs(),
    "keys.create": lambda client, file: client.create_key("shop", "read"),
    "keys.list": lambda client, file: client.keys(),
    "keys.revoke": lambda client, file: client.revoke_key("a"),
    "me": lambda client, file: client.me(),
    "objects.delete": lambda client, file: client.delete_object("mug"),
    "objects.get": lambda client, file: client.object_info("mug"),
    "objects.list": lambda client, file: list(client.objects(q="mug")),
    "objects.locate": lambda client, file: client.locate(b"a", "mug"),
    "objects.patch": lambda client, file: client.rename_object("mug", "cup"),
    "preview": lambda client, file: client.preview(b"a"),
    "qr": lambda client, file: client.qr("https://shop.example"),
    "readyz": lambda client, file: client.ready(),
    "search": lambda client, file: client.search(b"a", limit=3),
    "search.batch": lambda client, file: client.search_batch([{"image_id": "a"}]),
    "vocabularies.activate": lambda client, file: client.use(1, wait=False),
    "vocabularies.list": lambda client, file: client.vocabularies(),
    "vocabularies.train": lambda client, file: client.train(words=50, wait=False),
}
WITHOUT = {
    "aliases.delete": "set_aliases does it",
    "aliases.get": "aliases does it",
    "aliases.put": "set_aliases does it",
    "backups.get": "backups does it",
    "demo.get": "of the web page",
    "demo.load": "of the web page",
    "livez": "for supervisors; ready says more",
    "metrics": "for Prometheus",
    "openapi": "this document itself",
    "page": "of the web page",
}


class Recorder(http.server.BaseHTTPRequestHandler):
    """Answers everything with all fields that a method reads, and keeps what was asked in `server.seen`."""

    ANSWER = json.dumps({**{name: [] for name in ("aliases", "backups", "collections", "images", "items", "jobs", "keys", "objects",
                                                  "results", "vocabularies")},
                         "id": "a", "deleted": 0, "next": None, "report": None, "total": 0}).encode()

    def answer(self):
        self.rfile.read(int(self.headers.get("Content-Length", 0)))
        self.server.seen.append((self.command, self.path.partition("?")[0], dict(
            urllib.parse.parse_qsl(self.path.partition("?")[2]))))
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(self.ANSWER)))
        self.end_headers()
        self.wfile.write(self.ANSWER)

    do_GET = do_POST = do_PUT = do_PATCH = do_DELETE = answer

    def log_message(self, *_):
        pass


class Routes(FolderCase):
    def setUp(self):
        super().setUp()
        with server(self.folder) as (address, _):
            with urllib.request.urlopen(f"{address}/v1/openapi.json", timeout=60) as answer:
                self.document = json.load(answer)
            with urllib.request.urlopen(f"{address}/metrics", timeout=60) as answer:  # where the page takes the version from
                self.metrics = answer.read().decode()
        self.operations = {operation["operationId"]: (method.upper(), path, operation)
                           for path, item in self.document["paths"].items() for method, operation in item.items()
                           if "operationId" in operation}

    def test_every_operation_has_a_method_or_a_reason(self):
        self.assertEqual(sorted([*CALLS, *WITHOUT]), sorted(self.operations))
        recorder = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Recorder)
        recorder.seen = []
        thread = threading.Thread(target=recorder.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        self.addCleanup(thread.join)
        self.addCleanup(recorder.server_close)
        self.addCleanup(recorder.shutdown)
        client = pliant.Client(f"http://127.0.0.1:{recorder.server_port}")
        file = self.folder / "download"
        file.with_suffix(".tar").write_bytes(b"archive")
        for name, call in CALLS.items():
            with self.subTest(name):
                recorder.seen.clear()
                call(client, file)
                (method, path, query), = recorder.seen
                expected_method, template, operation = self.operations[name]
                self.assertEqual(method, expected_method)
                self.assertRegex(path, "^" + re.sub(r"\\\{\w+\\\}", "[^/]+", re.escape(template)) + "$")
                known = {one["name"] for one in operation.get("parameters", []) if one.get("in") == "query"}
                self.assertLessEqual(set(query), known)

    def test_one_version(self):
        def said(program):
            return subprocess.run([BIN / program, "--version"], stdout=subprocess.PIPE, text=True, check=True, timeout=60).stdout.split()[1]

        def written(file, expression):
            return re.search(expression, (REPOSITORY / file).read_text(), re.MULTILINE)[1]

        versions = {said("pliant"), said("pliant-server"), self.document["info"]["version"],
                    re.search(r'^pliant_info\{.*version="([^"]+)"', self.metrics, re.MULTILINE)[1],
                    written("CMakeLists.txt", r"^project\(Pliant VERSION (\S+)"), written("CITATION.cff", r"^version: (\S+)$"),
                    written("CHANGELOG.md", r"^## ([\d.]+)")}
        self.assertEqual(versions, {pliant.__version__})


if __name__ == "__main__":
    unittest.main()
