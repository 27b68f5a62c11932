#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""The client against a real server."""
import base64
import functools
import http.server
import json
import pathlib
import shutil
import subprocess
import sys
import tarfile
import threading
import unittest

import cv2
import numpy as np

import pliant
from support import BIN, FolderCase, eventually, other_view, pattern, png, run, server


class Served(FolderCase):
    def setUp(self):
        super().setUp()
        running = server(self.folder)
        self.address, self.database = running.__enter__()
        self.addCleanup(running.__exit__, None, None, None)
        self.client = pliant.Client(self.address)

    def test_life(self):
        client = self.client
        self.assertTrue(client.ready())
        self.assertEqual([one["name"] for one in client.collections()], ["default"])
        shelf = client.collection("shelf")
        self.assertEqual(shelf.create()["name"], "shelf")
        self.assertEqual(shelf.create()["name"], "shelf")
        path = self.write("a.png", pattern(0))
        record = shelf.add(path, object="mug", metadata={"year": 2024, "shop": "café"})
        self.assertEqual((record["object"], record["metadata"]), ("mug", {"year": 2024, "shop": "café"}))
        self.assertEqual(shelf.add(path.read_bytes(), object="mug", metadata={"shop": "café", "year": 2024})["id"],
                         record["id"])
        colour = cv2.merge([pattern(1), pattern(2), pattern(3)])
        shelf.add(colour, id="cup:1", object="cup é/?#", channels="BGR")
        stored = cv2.imdecode(np.frombuffer(shelf.content("cup:1"), np.uint8), cv2.IMREAD_COLOR)
        np.testing.assert_array_equal(stored, colour)
        shelf.add(pattern(4), id="grey")
        stored = cv2.imdecode(np.frombuffer(shelf.content("grey"), np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(stored, pattern(4))

        heard = []
        job = shelf.train(words=50, progress=heard.append)
        self.assertEqual(job["state"], "done")
        self.assertEqual(heard[-1], job)
        self.assertEqual(shelf.job(job["id"])["state"], "done")
        self.assertIn(job["id"], [one["id"] for one in client.jobs()])
        self.assertTrue(any(v["words"] == 50 and v["active"] for v in shelf.vocabularies()))

        answer = shelf.search(other_view(0), limit=2, explain=True, region=(0, 0, 160, 120))
        self.assertEqual(answer["hits"][0]["object"], "mug")
        self.assertEqual(len(answer["hits"]), 2)
        self.assertIn("mesh", answer["hits"][0]["explain"])
        stored = shelf.search(image_id=record["id"], exclude_self=False)
        self.assertEqual(stored["hits"][0]["image_id"], record["id"])
        self.assertNotIn(record["id"], [hit["image_id"] for hit in shelf.search(image_id=record["id"])["hits"]])
        self.assertNotIn(record["id"], [hit["image_id"] for hit in shelf.search(image_ids=[record["id"]])["hits"]])
        self.assertEqual([hit["object"] for hit in shelf.search(path, filter={"year": {"gte": 2020}})["hits"]], ["mug"])
        self.assertTrue(shelf.locate(other_view(0), "mug")["found"])

        self.assertEqual(shelf.info()["images"], 3)
        self.assertEqual([one["id"] for one in shelf.images(page=1)], sorted(["cup:1", "grey", record["id"]]))
        self.assertEqual([one["id"] for one in shelf.images("cup é/?#")], ["cup:1"])
        self.assertEqual([one["object"] for one in shelf.objects(page=1)], ["cup é/?#", "mug"])
        self.assertEqual(shelf.get("grey")["id"], "grey")
        self.assertEqual(shelf.thumbnail("grey")[:2], b"\xff\xd8")
        self.assertEqual(shelf.features("grey")["descriptors"]["rows"], shelf.get("grey")["keypoints"])
        shelf.save_features(self.folder / "shelf.npz")
        all_of_it = pliant.Features.load_folder(self.folder / "shelf.npz")
        self.assertEqual(sorted(all_of_it), [one["id"] for one in shelf.images()])
        for id, features in all_of_it.items():
            alone = shelf.features(id)
            rows = np.frombuffer(base64.b64decode(alone["descriptors"]["base64"]), np.float32).reshape(-1, 128)
            np.testing.assert_array_equal(features.descriptors, rows)
            np.testing.assert_array_equal(features.keypoints[:, 0], np.float32([k["x"] for k in alone["keypoints"]]))
            self.assertEqual((features.width, features.height, features.model_id),
                             (alone["width"], alone["height"], alone["model_id"]))
        with np.load(self.folder / "shelf.npz") as arrays:
            self.assertEqual(dict(zip(arrays["names"].tolist(), arrays["objects"].tolist())),
                             {"cup:1": "cup é/?#", "grey": "", record["id"]: "mug"})
        shelf.save_features(self.folder / "mug.npz", "mug")
        self.assertEqual(list(pliant.Features.load_folder(self.folder / "mug.npz")), [record["id"]])
        before = (self.folder / "mug.npz").read_bytes()
        with self.assertRaises(pliant.NotFoundError):
            client.collection("none").save_features(self.folder / "mug.npz")
        self.assertEqual((self.folder / "mug.npz").read_bytes(), before)
        with self.assertRaises(OSError):
            shelf.save_features(self.folder / "nowhere" / "x.npz")
        self.assertEqual([f.name for f in self.folder.iterdir() if ".part-" in f.name], [])
        shelf.delete("grey")
        self.assertEqual(shelf.delete_object("cup é/?#"), 1)
        self.assertEqual(shelf.info()["images"], 1)
        shelf.drop()
        self.assertEqual([one["name"] for one in client.collections()], ["default"])

    def test_what_admins_and_exports_need(self):
        client = self.client
        for seed in range(3):
            client.add(pattern(seed), id=f"p{seed}", object="mug", metadata={"shop": "east" if seed else "west"})
        self.assertEqual(client.object_info("mug")["images"], 3)
        for of, total in (("images", 3), ("objects", 1)):
            counted = client.facets("shop", of=of)
            self.assertEqual((counted["total"], counted["facets"]["shop"]["complete"]), (total, True))
        self.assertEqual(client.facets("shop")["facets"]["shop"]["values"][0], {"value": "east", "count": 2})
        self.assertEqual(client.facets(filter={"shop": "west"}), {"total": 1, "facets": {}})
        client.save_records(self.folder / "east.ndjson", filter={"shop": "east"})
        lines = (self.folder / "east.ndjson").read_text().splitlines()
        self.assertEqual([json.loads(line)["id"] for line in lines], ["p1", "p2"])
        table = self.folder / "names.csv"
        client.save_records(table)
        table.write_text(table.read_text().replace("p0,mug", "p0,red mug"))
        self.assertEqual(client.import_archive(table)["failed"], 0)
        self.assertEqual([client.get(f"p{seed}")["object"] for seed in range(3)], ["red mug", "mug", "mug"])
        client.update("p0", object="mug")
        self.assertEqual(client.preview(pattern(0))[:2], b"\xff\xd8")
        self.assertIn(b'viewBox="0 0 29 29"', client.qr("pliant"))
        client.train(words=40, activate=False)
        client.use(client.vocabularies()[-1]["id"])
        self.assertTrue(client.vocabularies()[-1]["active"])
        with self.fails(pliant.ForbiddenError, "imports_off"):
            client.import_folder()
        with self.fails(pliant.ForbiddenError, "backups_off"):
            client.backups()
        root = client.create_key("root", "admin")
        admin = pliant.Client(self.address, root["key"])
        self.assertEqual(admin.me()["key"]["name"], "root")
        shop = admin.create_key("shop", "read")
        self.assertEqual([key["name"] for key in admin.keys()], ["root", "shop"])
        admin.revoke_key(shop["id"])
        with self.fails(pliant.UnauthorizedError):
            pliant.Client(self.address, shop["key"]).info()

    def test_backups_and_imports_of_folders(self):
        for name in ("backups", "shelf/mug", "shelf/@eaDir", "other"):
            (self.folder / name).mkdir(parents=True)
        self.write("shelf/mug/a.png", pattern(1))
        self.write("shelf/@eaDir/a.png", pattern(2))
        with server(self.folder / "other", "--backup-dir", self.folder / "backups", "--import-dir", self.folder) as (address, _):
            client = pliant.Client(address)
            job = client.import_folder("shelf")
            self.assertEqual((job["done"], job["failed"], job["system_files"]), (1, 0, 1))
            self.assertEqual(client.backup("a.db")["state"], "done")
            self.assertEqual([one["name"] for one in client.backups()], ["a.db"])
            client.save_backup("a.db", self.folder / "copy.db")
            client.delete_backup("a.db")
            self.assertEqual(client.backups(), [])
        self.assertEqual(run("db", "check", "--db", self.folder / "copy.db", "--json")["ok"], True)

    def test_same_as_the_library(self):
        for seed in range(3):
            self.client.add(pattern(seed), object=f"o{seed}")
        self.client.train(words=50)
        theirs = self.client.search(other_view(1), verify="tps")["hits"]
        with pliant.Index(self.database, read_only=True) as index:
            ours = index.search(other_view(1), verify="tps").document["hits"]
        self.assertEqual(ours, theirs)

    def test_names_and_metadata_change(self):
        client = self.client
        for seed in range(3):
            client.add(pattern(seed), id=f"p{seed}", object=f"o{seed}", metadata={"shelf": seed, "shop": "east"})
        before = client.etag("p0")
        record = client.update("p0", object="mug é", metadata={"shelf": 5, "shop": None}, source="mug.png")
        self.assertEqual((record["object"], record["metadata"], record["source"]), ("mug é", {"shelf": 5}, "mug.png"))
        self.assertEqual(client.get("p0"), record)
        with self.fails(pliant.ConflictError, "precondition_failed") as caught:
            client.update("p0", object="cup", if_match=before)
        self.assertEqual(caught.exception.status, 412)
        self.assertEqual(client.update("p0", object="", if_match=client.etag("p0"))["object"], "")
        self.assertEqual(client.get("p0")["metadata"], {"shelf": 5})

        self.assertEqual(client.rename_object("o1", "cup/é?")["object"], "cup/é?")
        self.assertEqual([one["object"] for one in client.objects()], ["cup/é?", "o2"])
        with self.fails(pliant.ConflictError, "object_exists"):
            client.rename_object("o2", "cup/é?")
        self.assertEqual(client.rename_object("o2", "cup/é?", merge=True)["images"], 2)
        winter = self.client.collection("winter")
        winter.create()
        self.assertEqual(client.update("p0", collection="winter")["collection"], "winter")
        self.assertEqual(client.move_object("cup/é?", "winter")["images"], 2)
        self.assertEqual([one["object"] for one in winter.objects()], ["cup/é?"])
        self.assertEqual(winter.move_object("cup/é?", client.name)["images"], 2)
        self.assertEqual(winter.update("p0", collection=client.name)["id"], "p0")
        for work, kind, code in ((lambda: client.update("none", object="x"), pliant.NotFoundError, "image_not_found"),
                                 (lambda: client.move_object("cup/é?", "x"), pliant.NotFoundError, "collection_not_found"),
                                 (lambda: client.rename_object("none", "x"), pliant.NotFoundError, "object_not_found"),
                                 (lambda: client.update("p0", source="a\u202eb"), ValueError, "invalid_parameter"),
                                 (lambda: client.update("p0"), TypeError, None),
                                 (lambda: client.update("p0", metadata={"x": float("nan")}), ValueError, None)):
            with self.fails(kind, code):
                work()

    def test_batches(self):
        client = self.client
        for seed in range(3):
            client.add(pattern(seed), id=f"p{seed}", object=f"o{seed}")
        client.train(words=50)
        path = self.write("view.png", other_view(1))
        first, second, third, fourth = client.search_batch(
            [{"image": path, "limit": 1}, {"image_id": "none"}, {"image": other_view(2), "group_by": "image"},
             {"image": b"no image"}])
        self.assertEqual([hit["object"] for hit in first["hits"]], ["o1"])
        self.assertIsInstance(second, pliant.NotFoundError)
        self.assertEqual((second.code, second.status), ("image_not_found", 404))
        self.assertEqual(third["hits"][0]["object"], "o2")
        self.assertIsInstance(fourth, pliant.UnsupportedMediaTypeError)
        with self.fails(pliant.InvalidArgumentError):
            client.search_batch([])

    def test_an_archive(self):
        for seed in range(3):
            self.write(f"shop/o{seed}/a.png", pattern(seed))
        (self.folder / "shop" / "o2" / "broken.png").write_bytes(png(pattern(9))[:400])
        archive = self.folder / "shop.tar"
        with tarfile.open(archive, "w") as tar:
            tar.add(self.folder / "shop", "shop")
        heard = []
        job = self.client.import_archive(archive, metadata={"shop": "east"}, progress=heard.append)
        self.assertEqual((job["state"], job["done"], job["failed"]), ("done", 4, 1))
        self.assertEqual(heard[-1], job)
        items = list(self.client.job_items(job["id"]))
        self.assertEqual(sorted(item["status"] for item in items), [201, 201, 201, 422])
        self.assertEqual({(one["object"], one["metadata"]["shop"]) for one in self.client.images()},
                         {(f"o{seed}", "east") for seed in range(3)})
        lines = self.folder / "more.ndjson"
        lines.write_text(json.dumps({"image": base64.b64encode(png(pattern(5))).decode(), "id": "five"}) + "\n")
        self.client.import_archive(lines, object="all", wait=False)
        eventually(lambda: self.assertEqual(self.client.get("five")["object"], "all"))
        for work, kind, code in ((lambda: self.client.import_archive(self.folder / "x.zip"), ValueError, "archive_type"),
                                 (lambda: self.client.import_archive(self.folder / "none.tar"), OSError, None),
                                 (lambda: self.client.import_archive(self.folder), ValueError, "archive_type"),
                                 (lambda: list(self.client.job_items("0")), pliant.NotFoundError, "job_not_found")):
            with self.fails(kind, code):
                work()

    def test_errors(self):
        client = self.client
        with self.fails(pliant.NotFoundError, "image_not_found") as caught:
            client.get("nothing")
        error = caught.exception
        self.assertEqual((error.status, error.title), (404, "Not Found"))
        self.assertTrue(error.request_id)
        self.assertEqual(error.problem["code"], error.code)
        for work, kind, code in (
                (lambda: client.delete("nothing"), pliant.NotFoundError, "image_not_found"),
                (lambda: client.collection("none").info(), pliant.NotFoundError, "collection_not_found"),
                (lambda: client.job("0"), pliant.NotFoundError, "job_not_found"),
                (lambda: client.add(b"no image"), pliant.UnsupportedMediaTypeError, "image_type_unknown"),
                (lambda: client.add(b""), pliant.InvalidArgumentError, "missing_parameter"),
                (lambda: client.add(png(pattern(1))[:300]), pliant.UnprocessableError, "image_truncated"),
                (lambda: client.add(np.full((64, 64), 9, np.uint8)), pliant.UnprocessableError, "too_few_features"),
                (lambda: client.search(pattern(1), colour="red"), pliant.InvalidArgumentError, "unknown_parameter"),
                (lambda: client.search(pattern(1), rank="best"), pliant.InvalidArgumentError, "invalid_parameter"),
                (lambda: client.drop(), pliant.ConflictError, "collection_permanent"),
                (lambda: client.train(), pliant.Error, "no_images")):
            with self.subTest(code=code), self.fails(kind, code):
                work()
        with self.fails(pliant.InvalidArgumentError) as caught:
            client.search(pattern(1), min_score="x")
        self.assertEqual(caught.exception.parameter, "min_score")
        for work, kind in ((lambda: client.add(5), TypeError), (lambda: client.get(""), ValueError),
                           (lambda: client.get(".."), ValueError), (lambda: client.get(5), TypeError),
                           (lambda: client.search(), TypeError), (lambda: client.add(self.folder / "none"), OSError),
                           (lambda: client.add(self.folder), IsADirectoryError),
                           (lambda: client.add(pattern(1).astype(float)), TypeError),
                           (lambda: client.add(np.zeros((4, 4, 4), np.uint8)), ValueError),
                           (lambda: client.add(pattern(1), metadata={"a": float("inf")}), pliant.InvalidArgumentError),
                           (lambda: client.update("x", metadata={"a": float("inf")}), pliant.InvalidArgumentError),
                           (lambda: client.search(pattern(1), filter={"a": {"gt": float("nan")}}), pliant.InvalidArgumentError),
                           (lambda: client.add(pattern(1), object="\udce9"), pliant.InvalidArgumentError)):
            with self.fails(kind):
                work()
        with self.fails(TypeError, words="metadata: "):
            client.add(pattern(1), metadata={"a": np.float32(1)})

    def test_keys(self):
        keys = [subprocess.run([BIN / "pliant-server", "keys", "create", "--scope", scope, "--name", scope, "--db",
                                self.database], stdout=subprocess.PIPE, text=True, check=True).stdout.strip()
                for scope in ("read", "write")]
        with self.fails(pliant.UnauthorizedError, "unauthorized"):
            self.client.collections()
        reader, writer = (pliant.Client(self.address, key) for key in keys)
        self.assertEqual([one["name"] for one in reader.collections()], ["default"])
        with self.fails(pliant.ForbiddenError, "forbidden"):
            reader.add(pattern(1))
        with self.fails(pliant.ForbiddenError, "forbidden"):
            reader.update("x", object="y")
        large = self.folder / "large.tar"
        with open(large, "wb") as file:
            file.truncate(200 << 20)  # is refused before it has been sent
        with self.fails(pliant.ForbiddenError, "forbidden"):
            reader.import_archive(large)
        writer.add(pattern(1))
        self.assertNotIn(keys[0], repr(reader))
        with self.fails(ValueError, "key_invalid"):
            pliant.Client(self.address, "key\r\nX-Evil: 1")


class ImagesByAddress(FolderCase):
    def elsewhere(self):
        """HOST:PORT of a server that keeps the images of this folder."""
        class Quiet(http.server.SimpleHTTPRequestHandler):
            def log_message(self, *_):
                pass

        handler = functools.partial(Quiet, directory=self.folder)
        other = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
        threading.Thread(target=other.serve_forever, daemon=True).start()
        self.addCleanup(other.server_close)
        self.addCleanup(other.shutdown)
        return f"127.0.0.1:{other.server_port}"

    def test_fetched_by_the_server(self):
        self.write("mug.png", pattern(0))
        self.write("view.png", other_view(0))
        host = self.elsewhere()
        with server(self.folder, "--fetch-hosts", host, "--fetch-private", "true") as (address, _):
            client = pliant.Client(address, retries=0)
            record = client.add(image_url=f"http://{host}/mug.png?secret", object="mug", id="mug-1", metadata={"n": 1})
            self.assertEqual((record["source"], record["object"], record["metadata"]),
                             (f"http://{host}/mug.png", "mug", {"n": 1}))
            self.assertEqual(client.content("mug-1"), (self.folder / "mug.png").read_bytes())
            for seed in range(1, 6):
                client.add(pattern(seed), object=f"other {seed}")
            client.train(words=50)
            view = f"http://{host}/view.png"
            self.assertEqual(client.search(image_url=view, limit=1)["hits"][0]["object"], "mug")
            self.assertTrue(client.locate(None, "mug", image_url=view)["found"])
            for pair in ({"first": self.folder / "mug.png", "second_url": view}, {"first_url": view, "second": pattern(0)},
                         {"first_url": f"http://{host}/mug.png", "second_url": view, "explain": True}):
                compared = client.compare(**pair)
                self.assertEqual((compared["verdict"], "explain" in compared), ("found", "explain" in pair))
            self.assertEqual(client.compare(pattern(0), pattern(1))["verdict"], "not_found")
            with self.fails(pliant.Error, "fetch_failed", "404"):
                client.compare(pattern(0), second_url=f"http://{host}/none.png")
            with self.fails(pliant.Error, "fetch_failed", "404"):
                client.add(image_url=f"http://{host}/none.png")
            with self.fails(pliant.Error, "fetch_host_not_allowed"):
                client.search(image_url="http://elsewhere.test/")
            for both in (lambda: client.add(pattern(1), image_url=view), client.add, client.search, client.compare,
                         lambda: client.compare(pattern(1)), lambda: client.compare(pattern(1), pattern(2), second_url=view),
                         lambda: client.search(image_id="mug-1", image_url=view), lambda: client.locate(None, "mug")):
                with self.assertRaises(TypeError):
                    both()

    def test_off(self):
        with server(self.folder) as (address, _):
            with self.fails(pliant.Error, "fetch_off"):
                pliant.Client(address).add(image_url="http://127.0.0.1/mug.png")


class WithoutTheLibrary(FolderCase):
    def test_import(self):
        """A copy of the Python files alone, where NumPy cannot be imported either."""
        package = pathlib.Path(pliant.__file__).parent
        copy = self.folder / "pliant"
        copy.mkdir()
        for file in package.glob("*.py"):
            shutil.copyfile(file, copy / file.name)
        (self.folder / "numpy.py").write_text("raise ImportError('no NumPy here')")
        script = ("import pliant.client, sys\n"
                  "assert pliant.Client is pliant.client.Client and issubclass(pliant.NotFoundError, pliant.Error)\n"
                  "assert pliant.client.__file__.startswith(sys.argv[1]), pliant.client.__file__\n"
                  "assert not [name for name in sys.modules if name.startswith(('numpy', 'pliant._native'))]\n"
                  "try:\n"
                  "    pliant.Client('http://127.0.0.1:9', retries=0).collections()\n"
                  "except pliant.ConnectionFailedError as error:\n"
                  "    print(error.code)\n"
                  "try:\n"
                  "    pliant.describe\n"
                  "except ImportError as error:\n"
                  "    print('no library')\n")
        done = subprocess.run([sys.executable, "-c", script, str(self.folder)], env={"PYTHONPATH": str(self.folder)},
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=60)
        self.assertEqual((done.stdout, done.stderr), ("connection_failed\nno library\n", ""))


if __name__ == "__main__":
    unittest.main()
