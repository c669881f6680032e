# SPDX-License-Identifier: GPL-2.0-or-later
"""Damaged files and garbage, a few of each: the short form of ``make fuzz ARGS=files``. And the fuzzer itself."""

from __future__ import annotations

import contextlib
import gzip
import random
import sys
from typing import TYPE_CHECKING

import pytest

from bench import hostile, hostile_files
from dalycapture.errors import CaptureError, TruncatedError
from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dalyref.packet import Packet


@pytest.mark.parametrize("seed", [1, 2])
def test_damaged_files_end_in_words(seed: int, tmp_path: Path) -> None:
    assert hostile.batch(seed, 40, tmp_path) == []


def test_garbage_ends_in_words(tmp_path: Path) -> None:
    for number, (name, make) in enumerate(hostile_files.garbage(50_000).items()):
        path = tmp_path / name
        make(path)
        for words in hostile.words_for(number):
            filled = [word.format(file=path, out=tmp_path / "out") for word in words]
            assert hostile.tried(filled) == "", filled


def test_every_whole_file_is_one(tmp_path: Path) -> None:
    """What is damaged must be good before; the logs and raw bytes are no captures."""
    for name, data in hostile_files.whole(tmp_path).items():
        (tmp_path / "file").write_bytes(data)
        if name.endswith((".txt", ".bin")):
            with pytest.raises(CaptureError):
                list(read_capture(tmp_path / "file"))
            assert hostile.tried(["import", str(tmp_path / "file"), "-w", str(tmp_path / "out.pcapng")]) == ""
            assert list(read_capture(tmp_path / "out.pcapng")), name
        else:
            packets: list[Packet] = []
            with contextlib.suppress(TruncatedError):  # where it was cut to be small
                for packet in read_capture(tmp_path / "file"):
                    packets.append(packet)
            assert packets, name


def test_mutations_are_the_same_for_the_same_seed_and_differ(tmp_path: Path) -> None:
    files = hostile_files.whole(tmp_path)
    made = [hostile_files.mutated(random.Random(seed), files) for seed in range(30)]
    assert made == [hostile_files.mutated(random.Random(seed), files) for seed in range(30)]
    assert len({data for _, data in made}) > 25
    assert sum(data in files.values() for _, data in made) < 5


def test_a_bomb_is_far_larger_than_its_file(tmp_path: Path) -> None:
    hostile_files.garbage(500_000)["bomb.pcapng.gz"](tmp_path / "bomb.gz")
    packed = (tmp_path / "bomb.gz").read_bytes()
    assert len(gzip.decompress(packed)) > 500 * len(packed)


def _raises(_: Sequence[str]) -> int:
    message = "not foreseen"
    raise ValueError(message)


def _steers(_: Sequence[str]) -> int:
    sys.stdout.write("\x1b[2J")
    return 0


def _is_silent(_: Sequence[str]) -> int:
    return 2


def _exits(_: Sequence[str]) -> int:
    raise SystemExit(3)


def _chatters(_: Sequence[str]) -> int:
    sys.stderr.write("again\n" * (hostile.MOST_LINES + 1))
    return 0


@pytest.mark.parametrize(
    ("main", "said"),
    [
        (_raises, "ValueError: not foreseen"),
        (_steers, "prints '\\x1b'"),
        (_is_silent, "status 2 without a word"),
        (_exits, "exit status 3"),
        (_chatters, "1101 lines of messages"),
    ],
)
def test_what_goes_wrong_is_said(main: object, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hostile, "main", main)
    assert hostile.tried(["decode"]) == said
