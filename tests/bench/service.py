# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""What the measurements of a running server share: images, a server, requests."""

import json
import re
import shutil
import subprocess
import urllib.request

KINDS = {".jpg", ".jpeg", ".png"}


def images_below(parser, folder, wanted):
    """All images below the folder, sorted; fewer than `wanted` are an error of the parser's."""
    images = sorted(p for p in folder.rglob("*") if p.suffix.lower() in KINDS)
    if len(images) < wanted:
        parser.error(f"{folder} has {len(images)} images, {wanted} are wanted")
    return images


def percentile(times, share):
    ordered = sorted(times)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def copy_numbered(images, folder):
    """Into a new folder, under names that cannot collide."""
    folder.mkdir()
    for i, image in enumerate(images):
        shutil.copy(image, folder / f"{i}{image.suffix.lower()}")


def request(address, method="GET", body=None, content_type=None):
    headers = {"Content-Type": content_type} if content_type else {}
    asked = urllib.request.Request(address, data=body, method=method, headers=headers)
    with urllib.request.urlopen(asked, timeout=600) as answer:
        return json.load(answer)


class Server:
    """pliant-server on a free port, as long as the context lasts."""

    def __init__(self, binaries, database, *flags):
        self.process = subprocess.Popen(
            [binaries / "pliant-server", "--db", database, "--listen", "127.0.0.1:0",
             "--auto-train", "false", "--log-level", "warn", *flags],
            stdout=subprocess.PIPE, text=True)
        self.address = re.search(r"http://\S+", self.process.stdout.readline()).group()
        self.collection = self.address + "/v1/collections/default"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()

    def search(self, image):
        """`image`: the bytes of a file."""
        return request(self.collection + "/search", "POST", image, "application/octet-stream")
