# SPDX-License-Identifier: GPL-2.0-or-later
"""Outputs: whole blocks or none, nobody's file overwritten, no waiting for a slow reader."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from typing import TYPE_CHECKING

import pytest

from dalycapture import output
from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import bus_name, tap
from dalycapture.output import PipeOutput, open_output
from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from pathlib import Path


def fill(path: Path, count: int) -> None:
    with open_writer(path) as writer:
        writer.add_interface(tap("x"))
        for number in range(count):
            writer.write_packet(number, b"abc")


def test_an_older_capture_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    fill(path, 50)
    fill(path, 2)
    assert len(list(read_capture(path))) == 2


def test_an_empty_file_is_used(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    path.touch()
    fill(path, 2)
    assert len(list(read_capture(path))) == 2


def test_another_file_is_not(tmp_path: Path) -> None:
    path = tmp_path / "thesis.txt"
    path.write_text("three years of work", encoding="utf-8")
    with pytest.raises(CaptureError, match=r"is not a capture file, so it is not overwritten; choose another name"):
        open_output(path)
    assert path.read_text(encoding="utf-8") == "three years of work"


def test_a_capture_that_is_being_written_is_not(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(tap("x"))
        size = path.stat().st_size
        with pytest.raises(CaptureError, match="is being written by another capture"):
            open_output(path)
        assert path.stat().st_size == size


def test_directory_and_missing_directory(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="is a directory; give the name of a file"):
        open_output(tmp_path)
    with pytest.raises(CaptureError, match=r"there is no directory .*none for x\.pcapng"):
        open_output(tmp_path / "none" / "x.pcapng")


def test_unwritable_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Root may write anywhere, so the refusal is made."""

    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("os.open", refuse)
    with pytest.raises(CaptureError, match="no permission to write"):
        open_output(tmp_path / "x.pcapng")


LIMITED = """
import resource, sys
from dalycapture.create import open_writer
from dalycapture.interface import tap
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), int(sys.argv[2])))
writer = open_writer(sys.argv[1])
writer.add_interface(tap("x"))
for number in range(1000):
    writer.write_packet(number, bytes([number % 256]) * 13)
"""


@pytest.mark.parametrize("limit", [2000, 2001, 2003, 2017, 2033, 2047])
def test_a_full_disk_leaves_whole_blocks(limit: int, tmp_path: Path) -> None:
    """A file size limit stands for a full disk: the write is cut short, then fails. 48 bytes a packet of 13."""
    path = tmp_path / "x.pcapng"
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(path), str(limit)], capture_output=True, text=True, timeout=60, check=False
    )
    packets = list(read_capture(path))
    assert [p.data for p in packets] == [bytes([n]) * 13 for n in range(len(packets))]
    assert limit - 48 < path.stat().st_size <= limit
    last = done.stderr.splitlines()[-1]
    assert f"{path}: file too large; {len(packets)} records written, 1 lost; free some space" in last


def test_a_device_that_is_full() -> None:
    with pytest.raises(CaptureError, match="/dev/full: no space left on device; 0 records written, 0 lost"):
        open_writer("/dev/full").add_interface(tap("x"))


def test_a_slow_reader_is_not_waited_for() -> None:
    """A pipe holds 64 KiB; what does not fit waits in memory, in order."""
    reading, writing = os.pipe()
    pipe = PipeOutput(writing, "pipe")
    blocks = [bytes([n]) * 4000 for n in range(100)]
    for block in blocks:
        assert pipe.write(block)
    assert pipe.waiting >= 400_000 - 65_536
    got = b""
    while len(got) < 400_000:
        got += os.read(reading, 1 << 16)
        pipe.pump()
    assert got == b"".join(blocks)
    assert pipe.waiting == 0
    pipe.close()
    assert os.read(reading, 1) == b""
    os.close(reading)


def test_a_dead_slow_reader_costs_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, "BACKLOG_LIMIT", 10_000)
    monkeypatch.setattr(output, "GOODBYE_S", 0.05)
    reading, writing = os.pipe()
    pipe = PipeOutput(writing, "pipe")
    taken = [pipe.write(bytes(1000)) for _ in range(100)]
    assert taken[0]
    assert not taken[-1]
    assert pipe.waiting <= 10_000
    assert pipe.size == 1000 * sum(taken)
    pipe.close()
    os.close(reading)


def test_a_reader_that_went_away() -> None:
    reading, writing = os.pipe()
    pipe = PipeOutput(writing, "pipe")
    os.close(reading)
    with pytest.raises(BrokenPipeError):
        pipe.pump()
    with pytest.raises(BrokenPipeError):
        pipe.write(b"x")
    pipe.close()


def test_a_system_that_can_not_poll_pipes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Windows: a thread waits for the reader, nobody else does."""
    monkeypatch.delattr("select.poll")
    reading, writing = os.pipe()
    pipe = PipeOutput(writing, "pipe")
    assert pipe.fileno() == -1
    blocks = [bytes([n]) * 4000 for n in range(100)]
    for block in blocks:
        assert pipe.write(block)
    got = b""
    while len(got) < 400_000:
        got += os.read(reading, 1 << 16)
    assert got == b"".join(blocks)
    os.close(reading)
    end = time.monotonic() + 20
    with pytest.raises(BrokenPipeError):  # noqa: PT012 - it is told when the thread has seen it
        while time.monotonic() < end:
            pipe.write(b"x")
            time.sleep(0.001)
    pipe.close()


def test_a_pipe_without_poll_gives_the_rest_at_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("select.poll")
    reading, writing = os.pipe()
    pipe = PipeOutput(writing, "pipe")
    assert pipe.write(b"the rest")
    pipe.close()
    assert os.read(reading, 100) == b"the rest"
    assert os.read(reading, 100) == b""
    os.close(reading)


def test_bus_names() -> None:
    assert bus_name("garage-2") == "garage-2"
    for bad in ("", "a b", "a,b", "a;b", "x" * 65, "a\n"):
        with pytest.raises(CaptureError, match="is not one word"):
            bus_name(bad)
