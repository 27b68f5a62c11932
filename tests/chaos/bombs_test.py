#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Sends every hostile image of `hostile` to a running server, to be added and as thumbnail of what was added, and
prints what each cost.

    tests/chaos/bombs_test.py --bin build/release/bin [--only NAME]

Fails when an answer is none of those that are documented, when an image takes more processor time or
memory than the limits below, when a good client beside has to wait, or when the server is gone.
"""
import argparse
import contextlib
import http.client
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import threading
import time

from hostile import BOMBS, png

ANSWERS = {200, 201, 400, 413, 415, 422}
IMAGES = "/v1/collections/default/images"


class Server:
    """A pliant-server in a folder of its own."""

    def __init__(self, binaries, folder):
        self.log = open(folder / "log", "w+", encoding="utf-8")
        self.process = subprocess.Popen(
            [binaries / "pliant-server", "--db", folder / "db", "--listen", "127.0.0.1:0", "--descriptor",
             "rootsift", "--auto-train", "false"], stdout=subprocess.PIPE, stderr=self.log, text=True)
        said = self.process.stdout.readline()
        found = re.search(r"http://([\d.]+):(\d+)", said)
        if not found:
            self.log.seek(0)
            sys.exit(f"the server did not start: {said}{self.log.read()}")
        self.address = found.group(1), int(found.group(2))

    def ask(self, method, path, body=None):
        connection = http.client.HTTPConnection(*self.address, timeout=120)
        with contextlib.closing(connection):
            connection.request(method, path, body, {"Content-Type": "application/octet-stream"} if body is not None else {})
            answer = connection.getresponse()
            return answer.status, answer.read()

    def processes(self):
        """Folders below /proc of the server and its decoders."""
        server = pathlib.Path(f"/proc/{self.process.pid}")
        children = " ".join(path.read_text() for path in server.glob("task/*/children")).split()
        return [server] + [pathlib.Path("/proc") / child for child in children]

    def cpu_s(self):
        """Of the server, its decoders, and those that are no more."""
        ticks = 0
        for number, process in enumerate(self.processes()):
            fields = (process / "stat").read_text().rpartition(")")[2].split()
            ticks += sum(int(field) for field in fields[11:(13 if number else 15)])
        return ticks / os.sysconf("SC_CLK_TCK")

    def memory_mb(self, key):
        """Of each process."""
        texts = []
        for process in self.processes():
            with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # a decoder that was replaced just now
                texts.append((process / "status").read_text())
        return [int(found.group(1)) / 1024 for text in texts if (found := re.search(rf"{key}:\s+(\d+)", text))]

    def forget_peak(self):
        for process in self.processes():
            try:
                (process / "clear_refs").write_text("5")
            except PermissionError:  # a decoder's files are root's; then its peak is that since its start
                pass

    def ended_decoders(self):
        _, text = self.ask("GET", "/metrics")
        found = re.findall(r'^pliant_decoders_ended_total\{cause="(\w+)"\} (\d+)$', text.decode(), re.MULTILINE)
        return {cause: int(count) for cause, count in found}


class Peak(threading.Thread):
    """The most memory that all processes had together. The sum of their own peaks would be too much: the server
    describes an image when the decoder is done with it."""

    def __init__(self, server):
        super().__init__(daemon=True)
        self.server, self.mb, self.done = server, 0.0, threading.Event()

    def run(self):
        while not self.done.wait(0.005):
            self.mb = max(self.mb, sum(self.server.memory_mb("VmRSS")))

    def __enter__(self):
        self.mb = sum(self.server.memory_mb("VmRSS"))
        self.start()
        return self

    def __exit__(self, *_):
        self.done.set()
        self.join()


class GoodClient(threading.Thread):
    """Replaces a small image again and again, and keeps the longest wait."""

    def __init__(self, server):
        super().__init__(daemon=True)
        self.server, self.longest_s, self.failures, self.stopped = server, 0.0, [], False

    def run(self):
        count = 0
        while not self.stopped:
            count += 1  # other bytes, so that the image is decoded and described again
            image = png.small_png(png.chunk(b"tEXt", b"Count\0%d" % count))
            begin = time.monotonic()
            status, _ = self.server.ask("PUT", IMAGES + "/good", image)
            self.longest_s = max(self.longest_s, time.monotonic() - begin)
            if status not in (200, 201):
                self.failures.append(status)
            time.sleep(0.05)


def attack(server, name, data):
    """(row of the table, what is wrong)"""
    server.forget_peak()
    before_cpu, before_memory = server.cpu_s(), sum(server.memory_mb("VmRSS"))
    path = f"{IMAGES}/bomb"
    with Peak(server) as peak:
        status, body = server.ask("PUT", path, data)
        if status in (200, 201):
            status, body = server.ask("GET", path + "/thumbnail")
            server.ask("DELETE", path)
    # What was missed between two looks is at least in the peak of one process.
    memory = max(peak.mb, *server.memory_mb("VmHWM")) - before_memory
    cpu = server.cpu_s() - before_cpu
    code = json.loads(body)["code"] if status >= 400 else "accepted"
    wrong = []
    if status not in ANSWERS:
        wrong.append(f"{name}: answered {status} {code}")
    return (name, len(data), status, code, cpu, memory), wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n", maxsplit=1)[0])
    parser.add_argument("--bin", required=True, type=pathlib.Path, metavar="DIR")
    parser.add_argument("--only", help="images whose names hold this text")
    parser.add_argument("--cpu", type=float, default=2, help="most seconds of processor time for an image and its thumbnail")
    parser.add_argument("--wait", type=float, default=2, help="most seconds that a good client waits")
    parser.add_argument("--memory", type=float, default=300, help="most MB above the size before the image came")
    options = parser.parse_args()
    wrong, slowest = [], 0.0
    with tempfile.TemporaryDirectory() as folder:
        server = Server(options.bin.resolve(), pathlib.Path(folder))
        server.ask("PUT", IMAGES + "/good", png.small_png())
        print("| image | bytes | status | code | CPU s | MB | longest wait of another s |\n|---|---|---|---|---|---|---|")
        for name, make in BOMBS.items():
            if options.only and options.only not in name:
                continue
            data = make()
            good = GoodClient(server)
            good.start()
            try:
                row, found = attack(server, name, data)
            except (OSError, http.client.HTTPException) as error:
                sys.exit(f"{name}: {error!r}; the server {'runs' if server.process.poll() is None else 'is gone'}")
            good.stopped = True
            good.join()
            if row[4] > options.cpu:
                found.append(f"{name}: took {row[4]:.1f} s of processor time")
            if row[5] > options.memory:
                found.append(f"{name}: took {row[5]:.0f} MB")
            found += [f"{name}: a good client was answered {status}" for status in good.failures]
            if good.longest_s > options.wait:
                found.append(f"{name}: a good client waited {good.longest_s:.1f} s")
            wrong += found
            slowest = max(slowest, good.longest_s)
            print("| {} | {} | {} | {} | {:.2f} | {:.0f} | {:.2f} |".format(*row, good.longest_s), flush=True)
        # No defect of a decoder is known: one that ends is a find, or is not allowed what it needs.
        ended = server.ended_decoders()
        wrong += [f"{count} decoders ended: {cause}" for cause, count in ended.items() if count]
        if "forbidden" not in ended:
            wrong.append("the metrics do not say how many decoders ended")
        server.process.terminate()
        if server.process.wait(60) != 0:
            wrong.append(f"the server ended with {server.process.returncode}")
    print("\n".join(wrong) or f"{len(BOMBS)} images, nothing wrong; longest wait of a good client {slowest:.2f} s")
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
