# SPDX-License-Identifier: GPL-2.0-or-later
"""``make fuzz ARGS=files``: every command on files that are damaged, or nothing at all (bench/hostile_files.py).

No traceback, no hang, no more memory than a limit, and words: an exit status of 0, 1 or 2, with 2 a line that says why,
and nothing that could steer a terminal. Files are read by children with a limit on their memory, a batch a child.
"""

from __future__ import annotations

import argparse
import faulthandler
import io
import json
import random
import resource
import subprocess
import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

from bench import hostile_files
from dalytools.cli import COMMANDS, main

if TYPE_CHECKING:
    from collections.abc import Sequence

READ = (
    ("decode", "{file}"),
    ("check", "--no-dissector", "--no-colour", "{file}"),
    ("decode", "--format", "jsonl", "{file}"),
)
"""Done with every file; the rest in turn."""
TURNS = (
    ("import", "{file}", "-w", "{out}.pcapng", "-v"),
    ("reframe", "{file}", "-w", "{out}.pcapng"),
    ("reframe", "{file}", "-w", "{out}.pcap", "-F", "pcap"),
    ("reframe", "--raw", "{file}", "-w", "{out}.pcapng"),
    ("report", "{file}", "-o", "{out}.html"),
    ("survey", "{file}"),
    ("decode", "--format", "csv", "--rows", "moment", "{file}", "-o", "{out}.csv"),
    ("decode", "--format", "parquet", "{file}", "-o", "{out}.parquet"),
    ("redact", "{file}", "-w", "{out}.pcapng"),
)
BATCH = 250
LONGEST_S = 60
MEMORY = 2 << 30
"""Of address space, bytes: Python with all libraries takes about a third of it."""
MOST_LINES = 1100
"""Of messages: more are not clear words. `import -v` shows a thousand lines."""
_STATUS = (0, 1, 2)


def words_for(number: int) -> list[tuple[str, ...]]:
    """Return what is done with a file."""
    turns = [words for words in TURNS if words[0] in COMMANDS]
    return [*READ, turns[number % len(turns)]]


def tried(words: Sequence[str]) -> str:
    """Run a command here; return what was wrong with how it ended, empty: nothing."""
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace") for _ in range(2))
    status: object = 0
    try:
        with redirect_stdout(out), redirect_stderr(err):
            status = main(words)
    except SystemExit as end:
        status = end.code
    except BaseException as error:
        return f"{type(error).__name__}: {error}"[:300]
    said, messages = (_text(stream) for stream in (out, err))
    if status not in _STATUS:
        return f"exit status {status}"
    if status == 2 and not messages.strip():
        return "status 2 without a word"
    if messages.count("\n") > MOST_LINES:
        return f"{messages.count(chr(10))} lines of messages"
    for text in (said, messages):
        odd = next((character for character in text if not (character.isprintable() or character == "\n")), "")
        if odd:
            return f"prints {odd!r}"
    return ""


def _text(stream: io.TextIOWrapper) -> str:
    stream.flush()
    held = stream.buffer
    assert isinstance(held, io.BytesIO)
    return held.getvalue().decode("utf-8", "backslashreplace")


def batch(seed: int, count: int, folder: Path) -> list[str]:
    """Damage and read files here; return what was wrong."""
    r = random.Random(seed)
    files = hostile_files.whole(folder)
    wrong: list[str] = []
    for number in range(count):
        ending, data = hostile_files.mutated(r, files)
        path = folder / f"{seed}-{number}.{ending}"
        path.write_bytes(data)
        for words in words_for(number):
            faulthandler.dump_traceback_later(LONGEST_S, exit=True)
            said = tried([word.format(file=path, out=folder / "out") for word in words])
            faulthandler.cancel_dump_traceback_later()
            if said:
                wrong.append(f"seed {seed}, file {number} ({ending}), {' '.join(words[:2])}: {said}")
        path.unlink()
        for left in folder.glob("out*"):
            left.unlink()
    return wrong


def _child(words: list[str], *, timeout: float) -> tuple[subprocess.CompletedProcess[str] | None, float, float]:
    """Run this module with a limit on memory; return how it ended (None: it hangs), seconds, and most memory, MiB."""
    began = time.monotonic()
    try:
        done = subprocess.run(
            [sys.executable, "-m", "bench.hostile", *words],
            cwd=hostile_files.ROOT,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return None, time.monotonic() - began, 0.0
    last = done.stdout.strip().splitlines()[-1:] or ["0"]
    return done, time.monotonic() - began, float(last[0]) if last[0].replace(".", "").isdigit() else 0.0


def _run_child(options: argparse.Namespace) -> int:
    """Be the child: a batch of files, or one command. The last line is the most memory that it took."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    with tempfile.TemporaryDirectory() as folder:
        if options.words:
            wrong = [said] if (said := tried(options.words)) else []
        else:
            wrong = batch(options.seed, options.files, Path(folder))
    print(json.dumps(wrong))
    print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f}")
    return 0


def _told(done: subprocess.CompletedProcess[str] | None) -> list[str]:
    if done is None:
        return ["hangs"]
    lines = done.stdout.strip().splitlines()
    if done.returncode or len(lines) < 2:
        return [f"child ended with status {done.returncode}: {done.stderr.strip()[-600:]}"]
    found: list[str] = json.loads(lines[-2])
    return found


def small_files(count: int, seed: int) -> tuple[int, str]:
    """Go through `count` damaged files. Return how much was wrong, and a line."""
    wrong, most, began = 0, 0.0, time.monotonic()
    for start in range(0, count, BATCH):
        size = min(BATCH, count - start)
        done, _, memory = _child(["--child", "--seed", str(seed + start), "--files", str(size)], timeout=size * 20)
        most = max(most, memory)
        for said in _told(done):
            print(f"  {said}")
            wrong += 1
    seconds = time.monotonic() - began
    return wrong, f"{count} damaged files: {wrong} went wrong, {seconds:.0f} s, at most {most:.0f} MiB"


def large_files(size: int) -> int:
    """Give every command garbage. Return how much was wrong."""
    wrong = 0
    with tempfile.TemporaryDirectory() as folder:
        for name, make in hostile_files.garbage(size).items():
            path = Path(folder) / name
            make(path)
            for words in [*READ[:2], *(words for words in TURNS if words[0] in COMMANDS)]:
                filled = [word.format(file=path, out=Path(folder) / "out") for word in words]
                if words[0] == "decode":
                    filled += ["-o", f"{folder}/out.txt"]
                done, seconds, memory = _child(["--child", "--", *filled], timeout=60 + size / 20_000)
                told = _told(done)
                wrong += len(told)
                print(
                    f"  {name:<22} {' '.join(words[:2]).replace('{file}', ''):<24} {seconds:7.1f} s {memory:6.0f} MiB"
                    f"  {'; '.join(told) or 'fine'}",
                    flush=True,
                )
                for left in Path(folder).glob("out*"):
                    left.unlink()
            path.unlink()
    return wrong


def campaign() -> int:
    """Run all of it. Return 1 when anything went wrong."""
    parser = argparse.ArgumentParser(prog="make fuzz ARGS=files", description=__doc__)
    parser.add_argument("--files", type=int, default=10_000, help="damaged files (%(default)s)")
    parser.add_argument("--garbage", type=float, default=100, metavar="MB", help="a file of garbage (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="the same seed gives the same files (%(default)s)")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("words", nargs="*", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        return _run_child(options)
    wrong, line = small_files(options.files, options.seed) if options.files else (0, "")
    print(line)
    wrong += large_files(int(options.garbage * 1e6)) if options.garbage else 0
    print(f"{wrong} went wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(campaign())
