# SPDX-License-Identifier: GPL-2.0-or-later
"""A disk that is full and has space again: the file stays whole, what is lost is counted and said in the file."""

from __future__ import annotations

import os
import re
import subprocess
import threading
import time
from typing import TYPE_CHECKING

import pytest
from tests.capture.bus import Bus, numbered

from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import tap
from dalycapture.opening import open_port
from dalycapture.reader import read_capture
from dalycapture.rotation import Keeping
from dalycapture.sniffer import Limits, Side, Sniffer

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

WAIT = Keeping(wait_when_full=True)


class Disk:
    """Has place for so many bytes of captures, like ENOSPC does: a write is cut short, then refused."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.room = 1 << 30
        self._write = os.write
        monkeypatch.setattr("dalycapture.output.os.write", self._limited)

    def _limited(self, fd: int, data: bytes) -> int:
        if not self.room:
            raise OSError(28, "No space left on device")
        done = self._write(fd, data[: self.room])
        self.room -= done
        return done


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Disk:
    return Disk(monkeypatch)


@pytest.mark.parametrize("over", [0, 1, 12, 47])
def test_it_goes_on_when_there_is_space(over: int, disk: Disk, tmp_path: Path) -> None:
    """Ten records fit and a part of the next; five are lost, and an event; then there is space."""
    path = tmp_path / "x.pcapng"
    with open_writer(path, keeping=WAIT) as writer:
        writer.add_interface(tap("x"))
        disk.room = 10 * 48 + over
        for number in range(15):
            writer.write_packet(1_700_000_000_000_000_000 + number * 10**9, numbered(number))
            assert (path.stat().st_size - 4) % 4 == 0
        writer.write_packet(1_700_000_015_000_000_000, b"", comment="port lost")
        whole = path.stat().st_size
        assert len(list(read_capture(path))) == 10  # whole blocks, at any moment
        disk.room = 1 << 30
        writer.write_packet(1_700_000_016_000_000_000, numbered(16))
    assert path.stat().st_size > whole
    assert (writer.written, writer.lost) == (11, 5)
    packets = list(read_capture(path))
    assert [p.data for p in packets] == [*map(numbered, range(10)), b"", numbered(16)]
    assert re.fullmatch(
        r"disk full from 20\d\d-.* UTC to 2023-11-14 22:13:36\.000 UTC: 5 records \(65 bytes\) lost here; "
        r"1 event meanwhile: 2023-11-14 22:13:35\.000 UTC port lost",
        packets[10].comment,
    )
    assert writer.notes == [f"{path}: {packets[10].comment}"]
    assert (4).to_bytes(2, "little") + (8).to_bytes(2, "little") + (5).to_bytes(8, "little") in path.read_bytes()[
        whole:
    ]


def test_full_from_the_first_byte(disk: Disk, tmp_path: Path) -> None:
    """The header is written when there is space, before anything else."""
    path = tmp_path / "x.pcapng"
    with open_writer(path, keeping=WAIT) as writer:
        disk.room = 30
        writer.add_interface(tap("x"))
        writer.add_interface(tap("y"))
        writer.write_packet(1, numbered(1))
        assert path.stat().st_size == 0
        disk.room = 1 << 30
        writer.write_packet(2, numbered(2), interface=1)
    assert [(p.data, p.interface) for p in read_capture(path)] == [(b"", 0), (numbered(2), 1)]
    assert writer.lost == 1


def test_full_to_the_end(disk: Disk, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with open_writer(path, keeping=WAIT) as writer:
        writer.add_interface(tap("x"))
        writer.write_packet(1, numbered(1))
        disk.room = 5
        writer.write_packet(2, numbered(2))
        writer.finish()
    assert [p.data for p in read_capture(path)] == [numbered(1)]
    assert re.search(r"the disk was full to the end, since .*: 1 record \(13 bytes\) lost", writer.notes[0])


def test_other_errors_still_stop_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Waiting helps only when space is missing."""
    writer = open_writer(tmp_path / "x.pcapng", keeping=WAIT)
    writer.add_interface(tap("x"))

    def fail(*_: object) -> int:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("dalycapture.output.os.write", fail)
    with pytest.raises(CaptureError, match="input/output error; 0 records written, 1 lost"):
        writer.write_packet(1, b"x")
    writer.close()


def can_mount() -> bool:
    return subprocess.run(["unshare", "-m", "true"], capture_output=True, check=False).returncode == 0


@pytest.fixture
def small(tmp_path: Path) -> Iterator[Path]:
    """A tmpfs of 64 KiB."""
    folder = tmp_path / "small"
    folder.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)], check=True)
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.skipif(not can_mount(), reason="only root may mount")
def test_a_real_one(small: Path) -> None:
    """Live, on a file system that is full and freed again: every record is in the file or counted."""
    ballast = small / "ballast"
    ballast.write_bytes(bytes(40_000))
    path = small / "x.pcapng"
    sent = 1500
    with Bus() as bus:
        port = open_port(bus.port)
        writer = open_writer(path, keeping=WAIT)
        sniffer = Sniffer([Side(port, tap("x"))], [writer], limits=Limits(packets=sent))

        def feed() -> None:
            for number in range(sent):
                bus.send(numbered(number))
                if number % 10 == 0:
                    time.sleep(0.002)
                if number == 1000:
                    while not writer.lost:
                        time.sleep(0.005)
                    ballast.unlink()

        feeder = threading.Thread(target=feed)
        feeder.start()
        sniffer.run()
        feeder.join()
        port.close()
    packets = list(read_capture(path))  # not cut off
    got = [int("".join(str(byte) for byte in p.data[4:12])) for p in packets if p.data]
    (at,) = [index for index, packet in enumerate(packets) if not packet.data]
    assert got[:at] == list(range(at))
    assert got[at:] == list(range(sent - len(got[at:]), sent))
    assert writer.lost == sent - len(got) > 0
    assert f": {writer.lost} records ({writer.lost * 13} bytes) lost here" in packets[at].comment
