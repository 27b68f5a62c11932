#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Every page is short, its lines too, its links lead somewhere, and no sentence is on two pages.

    documents_test.py ROOT
"""
import pathlib
import re
import sys

MAX_LINES, MAX_COLUMNS, SENTENCE = 150, 160, 60


def pages(root):
    folders = {"build", "node_modules", "shared"}
    return sorted(path for path in root.rglob("*.md") if not folders & set(path.relative_to(root).parts))


def anchors(text):
    """As GitHub makes them of headings."""
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in re.findall(r"^#+ (.*?)\s*$", text, re.MULTILINE)}


def link_problems(page, text):
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        if not target.exists():
            yield f"{link} does not exist"
        elif anchor and anchor not in anchors(target.read_text(encoding="utf-8")):
            yield f"{link} has no such heading"


def sentences(text):
    prose = re.sub(r"^(```.*?^```|    .*?|\|.*?)$", "", text, flags=re.MULTILINE | re.DOTALL)
    return {part.strip() for part in re.split(r"(?<=[.!?])\s+|\n\n", re.sub(r"\n(?=\S)", " ", prose)) if len(part.strip()) >= SENTENCE}


def problems(root):
    known = {}
    for page in pages(root):
        text, name = page.read_text(encoding="utf-8"), page.relative_to(root)
        lines = text.splitlines()
        if len(lines) > MAX_LINES:
            yield f"{name}: {len(lines)} lines, {MAX_LINES} at most"
        yield from (f"{name}:{i}: {len(line)} characters, {MAX_COLUMNS} at most" for i, line in enumerate(lines, 1) if len(line) > MAX_COLUMNS)
        yield from (f"{name}: {problem}" for problem in link_problems(page, text))
        for sentence in sentences(text):
            if sentence in known:
                yield f"{name} and {known[sentence]} have the same sentence: {sentence}"
            known[sentence] = name


if __name__ == "__main__":
    found = list(problems(pathlib.Path(sys.argv[1]).resolve()))
    print(*found, f"{len(found)} problems", sep="\n")
    sys.exit(bool(found))
