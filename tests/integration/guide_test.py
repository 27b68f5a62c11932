#!/usr/bin/env python3
# SPDX-FileCopyrightText: The Pliant authors
# SPDX-License-Identifier: Apache-2.0
"""Runs what a guide tells its readers to type, in the guide's order, and compares what comes out.

    guide_test.py GUIDE.md... --bin DIR [--server] [--options-only]

Several pages are one guide: later pages use what earlier ones made.

Fenced blocks are bash or python; all run in one folder, the Python ones in one interpreter. A text
block that follows is what one sees, with ... for what differs from run to run. A block after
<!-- options only --> takes too long to run: each of its commands must exist and have the options it
is given; with --options-only this is all that is done, for all blocks. With --server a fresh pliant-server runs, whose address is $PLIANT and whose database is
$PLIANT_DB.
"""

import argparse
import contextlib
import io
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import traceback

LANGUAGES = {"bash", "python", "text"}
OPTIONS_ONLY = "<!-- options only -->"


def blocks(guide):
    """(language, text, line number, options only) of every fenced block."""
    found, lines, i = [], guide.read_text().splitlines(), 0
    while i < len(lines):
        fence = re.fullmatch(r"```(\w+)", lines[i])
        if lines[i].startswith("```") and not fence:
            sys.exit(f"{guide}:{i + 1}: a block without language")
        if fence:
            before = [line for line in lines[:i] if line.strip()]
            end = lines.index("```", i + 1)
            if fence.group(1) not in LANGUAGES:
                sys.exit(f"{guide}:{i + 1}: {fence.group(1)} is none of {sorted(LANGUAGES)}")
            found.append((fence.group(1), "\n".join(lines[i + 1:end]) + "\n", i + 1,
                          bool(before) and before[-1].strip() == OPTIONS_ONLY))
            i = end
        i += 1
    return found


def matches(expected, seen):
    pieces = [re.escape(" ".join(piece.split())) for piece in expected.split("...")]
    return re.fullmatch(r"\s*" + r".*".join(pieces) + r"\s*", " ".join(seen.split()), re.DOTALL)


def run_bash(text, folder, environment):
    done = subprocess.run(["bash", "-euo", "pipefail", "-c", text], cwd=folder, env=environment,
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=600)
    if done.returncode != 0:
        raise RuntimeError(f"exit status {done.returncode}\n{done.stdout}\n{done.stderr}")
    return done.stdout


def run_python(text, namespace):
    seen = io.StringIO()
    with contextlib.redirect_stdout(seen):
        exec(compile(text, "<guide>", "exec"), namespace)  # pylint: disable=exec-used
    return seen.getvalue()


def command_words(command):
    """The words that may name a command: python3 -m module, or pliant eval retrieval."""
    if command[0].startswith("python3"):
        return command[:3] if command[1] == "-m" else command[:2]
    words = command[:1]
    for word in command[1:3]:
        if "/" in command[0] or not re.fullmatch(r"[a-z]+", word):
            break
        words.append(word)
    return words


def help_of(words, environment, source, known):
    """What --help says of the longest run of words that is a command."""
    if words[0] == "cmake":
        lists = [source / "CMakePresets.json", *(source / "tests").rglob("CMakeLists.txt")]
        return "--build --preset --target" + "".join(path.read_text() for path in lists)
    while tuple(words) not in known:
        done = subprocess.run(words + ["--help"], env=environment, cwd=source, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=120)
        if done.returncode == 0:
            known[tuple(words)] = done.stdout
        elif len(words) == 1 or words[0].startswith("python3"):
            raise RuntimeError(f"there is no command {' '.join(words)}\n{done.stdout}")
        else:
            words = words[:-1]
    return known[tuple(words)]


def check_options(text, environment, source, known):
    for line in text.replace("\\\n", " ").splitlines():
        command = shlex.split(line, comments=True)
        if not command or command[0] == "set":  # the shell's own
            continue
        text_of_help = help_of(command_words(command), environment, source, known)
        for i, word in enumerate(command):
            if not word.startswith("--"):
                continue
            option = re.escape(word.split("=")[0])
            if not re.search(option + r"(?![\w-])", text_of_help):
                raise RuntimeError(f"{line}: {word} is no option of it")
            value = command[i + 1] if i + 1 < len(command) else ""
            choices = re.search(option + r" \{([\w,-]+)\}", text_of_help)
            if choices and value not in choices.group(1).split(","):
                raise RuntimeError(f"{line}: {word} takes {choices.group(1)}, not {value}")


@contextlib.contextmanager
def running_server(binaries, folder, environment):
    database = folder / "server" / "guide.db"
    database.parent.mkdir()
    log = (folder / "server" / "log").open("w+")  # rootsift: a tenth of the time of deal
    server = subprocess.Popen([binaries / "pliant-server", "--db", database, "--listen",
                               "127.0.0.1:0", "--descriptor", "rootsift"], stdout=subprocess.PIPE, stderr=log, text=True)
    try:
        said = server.stdout.readline()
        address = re.search(r"http://\S+", said)
        if not address:
            log.seek(0)
            sys.exit(f"the server did not start: {said}{log.read()}")
        environment.update(PLIANT=address.group(), PLIANT_DB=str(database))
        yield
    finally:
        server.terminate()
        status = server.wait()
    if status != 0:
        log.seek(0)
        sys.exit(f"the server ended with {status}\n{log.read()[-3000:]}")


def run_guide(guide, environment, folder, source, run_nothing, namespace):
    known, seen, ran = {}, None, 0
    for language, text, line, options_only in blocks(guide):
        if run_nothing and language != "bash":
            continue
        try:
            if language == "text":
                if seen is None:
                    raise RuntimeError("an answer without a question")
                if not matches(text, seen):
                    raise RuntimeError(f"expected:\n{text}\nseen:\n{seen}")
                seen = None
                continue
            if options_only or run_nothing:
                check_options(text, environment, source, known)
                seen = None
            elif language == "bash":
                seen = run_bash(text, folder, environment)
            else:
                seen = run_python(text, namespace)
            ran += 1
        except (Exception, SystemExit) as error:  # whatever an example does wrong
            if language == "python" and not isinstance(error, RuntimeError):
                traceback.print_exc()
            sys.exit(f"{guide}:{line}: {error}")
    if ran == 0:
        sys.exit(f"{guide}: there is nothing to run")
    print(f"{guide}: {ran} blocks")


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("guides", metavar="GUIDE.md", nargs="+", type=pathlib.Path)
    parser.add_argument("--bin", type=pathlib.Path, required=True)
    parser.add_argument("--server", action="store_true")
    parser.add_argument("--options-only", action="store_true")
    options = parser.parse_args()
    source = pathlib.Path(__file__).resolve().parents[2]
    binaries = options.bin.resolve()
    environment = dict(os.environ, PATH=f"{binaries}:/usr/bin:{os.environ['PATH']}")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        work = folder / "work"
        work.mkdir()
        os.chdir(work)
        with contextlib.ExitStack() as stack:
            if options.server:
                stack.enter_context(running_server(binaries, folder, environment))
            os.environ.update(environment)
            namespace = {"__name__": "guide"}
            for guide in options.guides:
                run_guide(source / guide, environment, work, source, options.options_only, namespace)


if __name__ == "__main__":
    main()
