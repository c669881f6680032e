# SPDX-License-Identifier: GPL-2.0-or-later
"""Captures, dissectors and tsharks made for a test: the latter two with deliberate errors."""

from __future__ import annotations

import re
import shutil
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.tshark import dissector_folder

if TYPE_CHECKING:
    from collections.abc import Generator, Iterable, Sequence

SAMPLES = Path(__file__).parents[3] / "pcap_samples"
EPOCH_NS = 1_700_000_000_000_000_000
FRAME_S = 13 * 10 / 9600
"""Thirteen characters of ten bits."""


def a5(address: int, data_id: int, data: bytes = bytes(8)) -> bytes:
    """Build a good A5 frame: the low byte of the sum of the twelve bytes before it (paper, section 2.3)."""
    head = bytes([0xA5, address, data_id, 8]) + data.ljust(8, b"\0")
    return head + bytes([sum(head) & 0xFF])


ASK, ANSWER = a5(0x40, 0x90), bytes.fromhex("a501900800f80000753001815d")
"""A request and its reply, 24.8 V, 0 A, 38.5 % (real frame cpy-90)."""


def write(
    path: Path,
    packets: Iterable[tuple[float, bytes]],
    *,
    interfaces: Sequence[str] = ("dalyshark bus=main",),
    link_type: int = 147,
    comment: str = "",
    flags: int = 0,
) -> Path:
    """Write packets (time in s, bytes) to a capture, in turn to its interfaces; an empty one is an event."""
    with open_writer(path, application="test") as writer:
        for description in interfaces:
            writer.add_interface(Interface("made", description, link_type))
        for number, (seconds, data) in enumerate(packets):
            writer.write_packet(
                EPOCH_NS + round(seconds * 1e9),
                data,
                interface=number % len(interfaces),
                comment=comment,
                flags=flags,
            )
    path.chmod(0o644)
    return path


@contextmanager
def open_folder() -> Generator[Path]:
    """Give a folder that everybody may enter, as pytest's own are its user's alone."""
    with tempfile.TemporaryDirectory(prefix="dalyshark-test-") as name:
        folder = Path(name)
        folder.chmod(0o755)
        yield folder


@contextmanager
def dissector(*errors: tuple[str, str]) -> Generator[Path]:
    """Give a folder with a copy of the dissector in which each pattern, there exactly once, is replaced."""
    with open_folder() as folder:
        texts = {file.name: file.read_text(encoding="utf-8") for file in dissector_folder().glob("*.lua")}
        for pattern, replacement in errors:
            found = [name for name, text in texts.items() for _ in re.findall(pattern, text)]
            assert len(found) == 1, f"the dissector has changed: put this error elsewhere: {pattern} is in {found}"
            texts[found[0]] = re.sub(pattern, replacement, texts[found[0]])
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        yield folder


@contextmanager
def program(text: str) -> Generator[Path]:
    """Give an executable script that stands in for tshark; the real one is in its place under the name REAL."""
    real = shutil.which("tshark")
    assert real
    with open_folder() as folder:
        path = folder / "tshark"
        path.write_text("#!/bin/sh\n" + text.replace("REAL", real), encoding="utf-8")
        path.chmod(0o755)
        yield path
