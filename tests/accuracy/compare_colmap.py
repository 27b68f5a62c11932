#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Gives COLMAP's vocabulary-tree retriever (Debian's package colmap) the queries of `pliant eval retrieval`,
and writes its results in the same JSON form.

    tests/accuracy/compare_colmap.py DIR --pliant build/release/bin/pliant --out colmap.json
    pliant eval retrieval DIR --peers colmap.json

COLMAP extracts SIFT with its defaults and trains a tree on the searched images. It ranks twice: by visual words
only, and with its own spatial verification of the best images.
"""
import argparse
import contextlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

RANKS = 20
HIT = re.compile(r"image_id=\d+, image_name=([^,]+), score=")


def run(arguments, log):
    """Runs a command and logs its output. Returns its standard output."""
    environment = dict(os.environ, QT_QPA_PLATFORM="offscreen")
    done = subprocess.run(arguments, env=environment, capture_output=True, text=True, check=False)
    log.write(" ".join(arguments) + "\n" + done.stdout + done.stderr)
    if done.returncode != 0:
        sys.exit(f"{' '.join(arguments)} failed with exit status {done.returncode}:\n{done.stdout[-2000:]}"
                 f"{done.stderr[-2000:]}")
    return done.stdout


def read_set(options):
    """The queries and searched images, from the program that will be compared."""
    command = [options.pliant, "eval", "retrieval", str(options.folder), "--list"]
    for folder in options.distractors:
        command += ["--distractors", str(folder)]
    if options.layout:
        command += ["--layout", options.layout]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):
        sys.exit(done.stderr)
    return json.loads(done.stdout)


def extract(images, work, options, log):
    """Links the images under flat names, and lets COLMAP describe them. Returns the names in the order of `images`."""
    folder = work / "images"
    folder.mkdir(exist_ok=True)
    names = []
    for number, image in enumerate(images):
        source = pathlib.Path(image["file"]).resolve()
        names.append(f"{number:06d}{source.suffix}")
        link = folder / names[-1]
        if not link.is_symlink():
            link.symlink_to(source)
        elif link.resolve() != source:
            sys.exit(f"{work} belongs to other images: {link.name} is {link.resolve()}. Choose another --work.")
    command = ["colmap", "feature_extractor", "--database_path", str(work / "colmap.db"),
               "--image_path", str(folder), "--SiftExtraction.use_gpu", "0",
               "--SiftExtraction.num_threads", str(options.threads)]
    if options.max_keypoints:
        command += ["--SiftExtraction.max_num_features", str(options.max_keypoints)]
    run(command, log)
    return names


def measure(answers, images, right):
    """The metrics of index/evaluation/retrieval_metrics.h, averaged over the queries."""
    sums = {"map": 0.0, "top1": 0.0, "mrr": 0.0, "ns": 0.0}
    accuracy = [0.0] * RANKS
    for query, answer in answers.items():
        hits = [images[hit]["object"] == images[query]["object"] for hit in answer]
        found = 0
        for rank in range(1, max(len(hits), RANKS) + 1):
            if rank <= len(hits) and hits[rank - 1]:
                found += 1
                sums["map"] += found / rank / right[query]
                sums["mrr"] += 1 / rank if found == 1 else 0
                sums["ns"] += 1 if rank <= 4 else 0
            if rank <= RANKS:
                accuracy[rank - 1] += found / rank
    count = len(answers)
    means = {key: value / count for key, value in sums.items()}
    means["accuracy_at"] = [value / count for value in accuracy]
    means["top1"] = means["accuracy_at"][0]
    return means


def ask(verified, names, asked, work, options, log):
    """The answer of each query as image numbers, best first, and the seconds of all queries."""
    command = ["colmap", "vocab_tree_retriever", "--database_path", str(work / "colmap.db"),
               "--vocab_tree_path", str(work / "tree.bin"),
               "--database_image_list_path", str(work / "searched.txt"),
               "--query_image_list_path", str(work / "queries.txt"),
               "--num_images_after_verification", str(verified)]
    if options.max_keypoints:
        command += ["--max_num_features", str(options.max_keypoints)]
    start = time.monotonic()
    output = run(command, log)
    seconds = time.monotonic() - start
    number_of = {name: number for number, name in enumerate(names)}
    answers = {}
    current = None
    for line in output.splitlines():
        if line.startswith("Querying for image"):
            current = number_of[line.split()[3]]
            answers[current] = []
        elif (hit := HIT.search(line)) is not None:
            answers[current].append(number_of[hit.group(1)])
    if sorted(answers) != asked:
        sys.exit(f"COLMAP answered {len(answers)} of {len(asked)} queries. See --log for the reason.")
    return answers, seconds


def compare(work, options, log):
    retrieval_set = read_set(options)
    images = retrieval_set["pictures"]
    names = extract(images, work, options, log)
    searched = [i for i, image in enumerate(images) if image["searched"]]
    asked = [i for i, image in enumerate(images) if image["query"]]
    (work / "searched.txt").write_text("".join(names[i] + "\n" for i in searched))
    (work / "queries.txt").write_text("".join(names[i] + "\n" for i in asked))
    run(["colmap", "vocab_tree_builder", "--database_path", str(work / "colmap.db"),
         "--vocab_tree_path", str(work / "tree.bin"), "--num_visual_words", str(options.words),
         "--num_iterations", str(options.iterations)], log)
    counts_itself = retrieval_set["counts_itself"]
    right = {q: sum(images[i]["object"] == images[q]["object"] and (counts_itself or i != q)
                    for i in searched) for q in asked}
    results = []
    for protocol, verified in (("words", 0), ("verified", options.verify)):
        answers, seconds = ask(verified, names, asked, work, options, log)
        if not counts_itself:
            answers = {q: [i for i in answer if i != q] for q, answer in answers.items()}
        means = measure(answers, images, right)
        results.append({"descriptor": "colmap", "protocol": protocol, "words": options.words,
                        "accuracy_at": means["accuracy_at"], "map": means["map"],
                        "top1": means["top1"], "mrr": means["mrr"],
                        "ns_score": means["ns"] if retrieval_set["layout"] == "ukbench" else None,
                        "seconds_per_query": seconds / len(asked)})
    return {"layout": retrieval_set["layout"], "pictures": len(searched), "queries": len(asked),
            "results": results}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=pathlib.Path, metavar="DIR")
    parser.add_argument("--pliant", default="pliant", help="the program `pliant`, which reads the layout (default: %(default)s)")
    parser.add_argument("--layout", help="as in pliant eval retrieval; default: detect")
    parser.add_argument("--distractors", action="append", default=[], type=pathlib.Path, metavar="DIR",
                        help="folder of images that show none of the objects; can be repeated")
    parser.add_argument("--words", type=int, default=16384, help="visual words of the tree (default: %(default)s)")
    parser.add_argument("--iterations", type=int, default=11, help="k-means iterations for the tree (default: %(default)s)")
    parser.add_argument("--verify", type=int, default=100, help="images to verify for the second row (default: %(default)s)")
    parser.add_argument("--max-keypoints", type=int, default=0, help="keypoints per image; 0 = COLMAP's default")
    parser.add_argument("--threads", type=int, default=2, help="threads of COLMAP (default: %(default)s)")
    parser.add_argument("--work", type=pathlib.Path,
                        help="folder that keeps COLMAP's features for the next run; default: a temporary folder")
    parser.add_argument("--log", type=pathlib.Path, help="file for the output of COLMAP; default: none")
    parser.add_argument("--out", type=pathlib.Path, help="file for the results; default: standard output")
    options = parser.parse_args()
    if shutil.which("colmap") is None:
        sys.exit("COLMAP is not installed. On Debian: apt-get install colmap")
    if options.work:
        options.work.mkdir(parents=True, exist_ok=True)
    with contextlib.nullcontext(options.work) if options.work \
            else tempfile.TemporaryDirectory(prefix="pliant-colmap-") as work, \
            open(options.log or os.devnull, "w", encoding="utf-8") as log:
        report = json.dumps(compare(pathlib.Path(work), options, log))
    if options.out:
        options.out.write_text(report + "\n")
    else:
        print(report)


if __name__ == "__main__":
    main()
