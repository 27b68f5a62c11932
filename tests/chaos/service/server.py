# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The server as a process group of its own, and connections to it."""
import contextlib
import http.client
import json
import os
import re
import select
import signal
import subprocess
import time

START_S = 120  # a start takes no longer, however busy the machine


class Wrong(Exception):
    """Something that must not be, whatever was killed."""


class Server:
    """Starts at once; `wait_ready` before it is asked."""

    def __init__(self, command, log):
        self.log = log
        with open(log, "a", encoding="utf-8") as errors:
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, start_new_session=True)
        self.begun = time.monotonic()
        self.address = None

    def wait_ready(self):
        """Seconds that the start took."""
        readable, _, _ = select.select([self.process.stdout], [], [], START_S)
        said = self.process.stdout.readline().decode() if readable else "nothing"
        found = re.search(r"http://([\d.]+):(\d+)", said)
        if not found:
            raise Wrong(f"the server did not start, it said: {said!r}\n{self.log.read_text()[-2000:]}")
        self.address = found.group(1), int(found.group(2))
        return time.monotonic() - self.begun

    def kill(self):
        """False when it had ended already."""
        alive = self.process.poll() is None
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self.process.stdout.close()
        return alive and self.process.returncode == -signal.SIGKILL

    def terminate(self):
        self.process.terminate()

    def ended(self, timeout_s):
        """Exit status, or None when it is still running after the time."""
        try:
            status = self.process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None
        self.process.stdout.close()
        return status


class Connection:
    """One client's; with or without keep-alive."""

    def __init__(self, address, keep_alive=True):
        self.address, self.keep_alive, self.connection = address, keep_alive, None
        self.headers = {}  # of the last answer

    def ask(self, method, path, body=None, kind="application/octet-stream"):
        """(status, body); raises OSError or HTTPException when no whole answer came."""
        if self.connection is None:
            self.connection = http.client.HTTPConnection(*self.address, timeout=120)
        headers = {} if self.keep_alive else {"Connection": "close"}
        if body is not None:
            headers["Content-Type"] = kind
        try:
            self.connection.request(method, path, body, headers)
            answer = self.connection.getresponse()
            data = answer.read()
            closes, self.headers = answer.will_close, answer.headers
        except BaseException:
            self.close()
            raise
        if closes:
            self.close()
        return answer.status, data

    def json(self, method, path, document=None):
        """(status, document) of a request with a JSON body, or none."""
        body = None if document is None else json.dumps(document)
        status, data = self.ask(method, path, body, "application/json")
        return status, json.loads(data) if data else None

    def get(self, path):
        status, document = self.json("GET", path)
        if status != 200:
            raise Wrong(f"GET {path} was answered {status} {document}")
        return document

    def close(self):
        if self.connection is not None:
            self.connection.close()
        self.connection = None
