#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What the client does when a server is busy, slow, broken or hostile: a server that says what the test wants."""
import http.client
import http.server
import json
import pathlib
import tempfile
import threading
import time
import unittest
from email.utils import formatdate

import pliant

BUSY = (503, {"Retry-After": "0", "Content-Type": "application/problem+json"},
        json.dumps({"code": "busy", "title": "Service Unavailable", "status": 503, "detail": "too much to do"}).encode())
GOOD = (200, {"Content-Type": "application/json"}, b'{"collections": [{"name": "default"}]}')
RECORD = (201, {"Content-Type": "application/json"}, b'{"id": "x"}')
CUT = None  # the connection ends without an answer


class Scripted(unittest.TestCase):
    """`self.answers` are given in turn; `self.seen` is what was asked: (method, path, headers, body)."""

    def setUp(self):
        self.answers, self.seen = [], []
        test = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def answer(self):
                body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
                test.seen.append((self.command, self.path, dict(self.headers), body))
                said = test.answers.pop(0)
                if said is CUT:
                    self.close_connection = True
                    return
                status, headers, data = said
                self.send_response(status)
                for name, value in {"Content-Length": str(len(data)), **headers}.items():
                    self.send_header(name, value)
                self.end_headers()
                self.wfile.write(data)

            do_GET = do_POST = do_PUT = do_PATCH = do_DELETE = answer

            def log_message(self, *_):
                pass

        self.handler = Handler
        self.serve()
        self.addCleanup(lambda: self.stop())
        self.address = f"http://127.0.0.1:{self.server.server_port}"
        self.client = pliant.Client(self.address, "secret")

    def serve(self, port=0):
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", port), self.handler)
        self.thread = threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.01})
        self.thread.start()

    def stop(self):
        self.server.shutdown()
        self.server.server_close()
        self.thread.join()

    def test_a_download_is_whole_or_not_there(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            whole = (200, {"Content-Type": "application/vnd.numpy.npz"}, b"0123456789")
            cut = (200, {"Content-Type": "application/vnd.numpy.npz", "Content-Length": "10"}, b"0123")
            self.answers = [BUSY, cut, whole]
            self.client.save_features(folder / "x.npz")
            self.assertEqual((folder / "x.npz").read_bytes(), b"0123456789")
            self.answers = [cut] * 3
            with self.assertRaises(pliant.ConnectionFailedError):
                pliant.Client(self.address, retries=2, max_wait=0.01).save_features(folder / "x.npz")
            self.assertEqual((folder / "x.npz").read_bytes(), b"0123456789")
            with self.assertRaises(OSError):
                self.client.save_features(folder)
            with self.assertRaises(TypeError):
                self.client.save_features(None)
            self.assertEqual([file.name for file in folder.iterdir()], ["x.npz"])

    def methods(self):
        return [method for method, *_ in self.seen]

    def test_busy(self):
        self.answers = [BUSY, BUSY, GOOD]
        self.assertEqual(self.client.collections(), [{"name": "default"}])
        self.answers = [BUSY, RECORD]
        self.assertEqual(self.client.add(b"bytes"), {"id": "x"})  # POST: it was not begun
        self.assertEqual(self.methods(), ["GET"] * 3 + ["POST"] * 2)
        self.assertEqual({body for *_, body in self.seen[3:]}, {b"bytes"})
        self.answers = [BUSY] * 3
        with self.assertRaises(pliant.UnavailableError) as caught:
            pliant.Client(self.address, retries=2).collections()
        error = caught.exception
        self.assertEqual((error.code, error.status, error.title, error.detail, error.retry_after),
                         ("busy", 503, "Service Unavailable", "too much to do", 0.0))
        self.assertEqual(self.answers, [])

    def test_waits_as_told(self):
        for value in ("1", formatdate(time.time() + 4, usegmt=True)):
            self.answers = [(429, {"Retry-After": value}, b""), GOOD]
            start = time.monotonic()
            self.client.collections()
            self.assertGreater(time.monotonic() - start, 0.9)
        self.answers = [(429, {"Retry-After": "3600"}, b"")]
        start = time.monotonic()
        with self.assertRaises(pliant.UnavailableError) as caught:
            self.client.collections()
        self.assertEqual(caught.exception.retry_after, 3600)
        self.assertLess(time.monotonic() - start, 30)

    def test_connections_that_end(self):
        self.answers = [CUT, CUT, GOOD]
        self.client.collections()
        self.answers = [CUT, RECORD]
        self.client.add(b"bytes", id="x")  # PUT: the same twice
        self.answers = [CUT, (200, {"Content-Type": "application/json"}, b'{"hits": []}')]
        self.client.search(b"bytes")  # POST, but it changes nothing
        self.assertEqual(self.methods(), ["GET"] * 3 + ["PUT"] * 2 + ["POST"] * 2)
        self.assertTrue(all(headers.get("Idempotency-Key") is None for _, _, headers, _ in self.seen))

    def test_what_may_have_been_done_is_done_once(self):
        """By a key that is the same each time, and another for the next request."""
        running = (409, {"Content-Type": "application/problem+json", "Retry-After": "0"},
                   b'{"code": "idempotency_running", "detail": "still being done"}')
        self.answers = [CUT, running, RECORD, RECORD]
        self.assertEqual(self.client.add(b"bytes"), {"id": "x"})
        self.client.add(b"bytes")
        keys = [headers["Idempotency-Key"] for _, _, headers, _ in self.seen]
        self.assertEqual(len(keys), 4)
        self.assertEqual(len(set(keys[:3])), 1)
        self.assertEqual(len(set(keys)), 2)
        self.assertGreater(len(keys[0]), 30)

    def test_nothing_else_is_repeated(self):
        for status, kind in ((400, pliant.InvalidArgumentError), (401, pliant.UnauthorizedError), (409, pliant.ConflictError),
                             (404, pliant.NotFoundError), (500, pliant.InternalError), (507, pliant.NoSpaceError),
                             (418, pliant.Error)):
            self.answers = [(status, {"Retry-After": "0"}, b"")]
            with self.assertRaises(kind) as caught:
                self.client.collections()
            self.assertEqual(caught.exception.status, status)
        self.assertEqual(len(self.seen), 7)

    def test_answers_that_are_none(self):
        """From something between the server and here."""
        for kind in ("text/html", "application/problem+json", "application/json"):
            for body in (b"<html>Bad Gateway", b"[1]", b"\xff\xfe", b'{"code": 5, "detail": null}', b""):
                self.answers = [(502, {"Content-Type": kind}, body)]
                with self.assertRaises(pliant.Error) as caught:
                    self.client.collections()
                self.assertEqual((caught.exception.code, caught.exception.status), ("http_502", 502))
        self.answers = [(200, {"Content-Type": "application/json"}, b"{") for _ in range(5)]
        with self.assertRaises(pliant.ConnectionFailedError):
            self.client.collections()

    def test_no_redirects(self):
        """The key goes nowhere else."""
        self.answers = [(302, {"Location": self.address + "/elsewhere"}, b"")]
        with self.assertRaises(pliant.Error) as caught:
            self.client.collections()
        self.assertEqual(caught.exception.status, 302)
        self.assertEqual(len(self.seen), 1)
        self.assertEqual(self.seen[0][2]["Authorization"], "Bearer secret")

    def test_requests(self):
        self.answers = [GOOD, RECORD, RECORD]
        pliant.Client(self.address + "/behind/").collections()
        self.assertEqual(self.seen[0][1], "/behind/v1/collections")
        self.assertNotIn("Authorization", self.seen[0][2])
        self.client.add(b"b", id="a b", object="ü&x", metadata={"a": [1]})
        self.assertEqual(self.seen[1][1], "/v1/collections/default/images/a%20b?object=%C3%BC%26x&"
                                          "metadata=%7B%22a%22%3A+%5B1%5D%7D")
        self.client.collection("a/b").add(b"b")
        self.assertEqual(self.seen[2][1], "/v1/collections/a%2Fb/images")
        for url in ("127.0.0.1:8080", "ftp://host", "http://", "http://user:secret@host", "http://host?x=1", "http://host:x",
                    ""):
            with self.assertRaises(ValueError):
                pliant.Client(url)

    def test_jobs(self):
        def job(state, **more):
            return (200, {"Content-Type": "application/json"}, json.dumps({"id": "7", "state": state, **more}).encode())

        self.answers = [job("queued"), job("done")]
        self.assertEqual(self.client.wait("7")["state"], "done")
        self.assertEqual([path for _, path, *_ in self.seen], ["/v1/jobs/7?wait=0.000", "/v1/jobs/7?wait=30.000"])
        self.answers = [job("queued"), job("running"), job("done")]
        states = []
        self.assertEqual(self.client.wait("7", progress=lambda one: states.append(one["state"]))["state"], "done")
        self.assertEqual(states, ["queued", "running", "done"])
        self.answers = [job("failed", problem={"code": "no_images", "detail": "none"})]
        with self.assertRaises(pliant.Error) as caught:
            self.client.wait("7")
        self.assertEqual((caught.exception.code, str(caught.exception)), ("no_images", "none"))
        self.answers = [job("cancelled")]
        with self.assertRaises(pliant.CancelledError):
            self.client.wait("7")
        self.answers = [job("running")] * 100
        with self.assertRaises(pliant.UnavailableError) as caught:
            self.client.wait("7", timeout=0.2)
        self.assertEqual(caught.exception.code, "timeout")

    def test_a_restart_of_the_server_does_not_end_waiting(self):
        def job(state):
            return (200, {"Content-Type": "application/json"}, json.dumps({"id": "7", "state": state}).encode())

        starting = (503, {"Retry-After": "0", "Content-Type": "application/problem+json"}, b'{"code": "starting"}')
        port = self.server.server_port
        refused = threading.Event()
        once = self.client._transport._once

        def watched(*request):
            try:
                return once(*request)
            except ConnectionRefusedError:
                if not refused.is_set():
                    refused.set()
                    self.serve(port)
                raise

        def heard(_):
            if not refused.is_set():
                self.stop()

        self.client._transport._once = watched
        self.answers = [job("running"), starting, CUT, BUSY, job("running"), job("done")]
        client = self.client
        self.assertEqual(client.wait("7", progress=heard)["state"], "done")
        self.assertTrue(refused.is_set())
        self.assertEqual(self.answers, [])
        self.stop()
        for patience, timeout in ((0.1, None), (60, 0.1)):
            with self.assertRaises(pliant.ConnectionFailedError):
                pliant.Client(self.address, max_wait=patience).wait("7", timeout=timeout)
        self.serve(port)

    def test_a_file_is_sent_from_its_beginning_each_time(self):
        with tempfile.TemporaryDirectory() as name:
            lines = pathlib.Path(name) / "x.ndjson"
            lines.write_bytes(b"0123456789" * 100000)
            self.answers = [BUSY, CUT, (202, {"Content-Type": "application/json"}, b'{"id": "7"}')]
            self.assertEqual(self.client.import_archive(lines, wait=False, object_from="stem")["id"], "7")
            self.assertEqual({(path, body) for _, path, _, body in self.seen},
                             {("/v1/collections/default/images:import?object_from=stem", lines.read_bytes())})
            self.assertEqual(len({headers["Idempotency-Key"] for _, _, headers, _ in self.seen}), 1)
            self.assertEqual({headers["Content-Type"] for _, _, headers, _ in self.seen}, {"application/x-ndjson"})

    def test_changes(self):
        self.answers = [CUT, RECORD, RECORD]
        self.client.update("a b", metadata={"x": None}, if_match='"tag"')
        self.client.rename_object("a/b", "c", merge=True)
        method, path, headers, body = self.seen[1]
        self.assertEqual((method, path, headers["If-Match"], body),
                         ("PATCH", "/v1/collections/default/images/a%20b", '"tag"', b'{"metadata": {"x": null}}'))
        self.assertEqual(self.seen[0][2]["Idempotency-Key"], headers["Idempotency-Key"])
        self.assertEqual(self.seen[2][1], "/v1/collections/default/objects/a%2Fb?merge=true")

    def test_ready(self):
        self.answers = [(503, {**BUSY[1], "Retry-After": "30"}, BUSY[2]), GOOD]
        begin = time.monotonic()
        self.assertEqual((self.client.ready(), self.client.ready()), (False, True))
        self.assertLess(time.monotonic() - begin, 10, "it waits for nothing")

    def test_addresses(self):
        """The key goes to the host that was named."""
        asked = []
        connect = http.client.HTTPConnection.connect

        def note(connection):
            asked.append((connection.host, connection.port))
            raise ConnectionRefusedError

        http.client.HTTPConnection.connect = note
        self.addCleanup(setattr, http.client.HTTPConnection, "connect", connect)
        for url, wanted in (("http://[2001:db8::7:443]", ("2001:db8::7:443", 80)), ("http://[::1]", ("::1", 80)),
                            ("http://[::1]:8080", ("::1", 8080)), ("http://shop.example", ("shop.example", 80))):
            with self.assertRaises(pliant.ConnectionFailedError):
                pliant.Client(url, "secret", retries=0).collections()
            self.assertEqual(asked.pop(), wanted)

    def test_silence(self):
        with self.assertRaises(pliant.ConnectionFailedError):
            pliant.Client("http://127.0.0.1:9", retries=0).collections()
        self.assertFalse(issubclass(pliant.ConnectionFailedError, pliant.UnavailableError))


if __name__ == "__main__":
    unittest.main()
