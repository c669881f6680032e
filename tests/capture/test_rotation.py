# SPDX-License-Identifier: GPL-2.0-or-later
"""One capture in several files: each complete in itself, none overwritten, names and checksums told when closed."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import struct
import subprocess
import time
from typing import TYPE_CHECKING, Any

import pytest
from tests.capture.bus import Bus, numbered

from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import tap
from dalycapture.opening import open_port
from dalycapture.reader import read_capture
from dalycapture.rotation import Keeping, Rotation
from dalycapture.sniffer import End, Limits, Side, Sniffer

if TYPE_CHECKING:
    from pathlib import Path

    from dalycapture.writer import CaptureWriter

NAME = re.compile(r"x_(\d{5})_20\d{12}\.pcapng")


def series(folder: Path, *, checksum: bool = False, **conditions: Any) -> CaptureWriter:
    keeping = Keeping(checksum=checksum, rotation=Rotation(**conditions))
    return open_writer(folder / "x.pcapng", keeping=keeping, application="dalyshark test")


def captures(folder: Path) -> list[Path]:
    """The files of the series, by name; their numbers must be in a row."""
    paths = sorted(folder.glob("*.pcapng"))
    for path in paths:
        assert NAME.fullmatch(path.name), path.name
    return paths


def block_types(path: Path) -> list[int]:
    """The blocks of a file, walked by their lengths (pcapng draft, 3.1)."""
    data, at, types = path.read_bytes(), 0, list[int]()
    while at < len(data):
        kind, total = struct.unpack_from("<II", data, at)
        assert data[at + total - 4 : at + total] == struct.pack("<I", total)
        types.append(kind)
        at += total
    assert at == len(data)
    return types


def test_by_packets_every_file_is_complete_in_itself(tmp_path: Path) -> None:
    with series(tmp_path, packets=3) as writer:
        writer.add_interface(tap("a"))
        writer.add_interface(tap("b"))
        for number in range(8):
            writer.write_packet(1_700_000_000_000_000_000 + number, numbered(number), interface=number % 2)
        writer.finish()
    paths = captures(tmp_path)
    assert [[p.data for p in read_capture(path)] for path in paths] == [
        [numbered(n) for n in group] for group in ([0, 1, 2], [3, 4, 5], [6, 7])
    ]
    section, described, statistics, packet = 0x0A0D0D0A, 1, 5, 6
    for path, count in zip(paths, (3, 3, 2), strict=True):
        assert block_types(path) == [section, described, described, *[packet] * count, statistics, statistics]
    assert [p.interface for path in paths for p in read_capture(path)] == [n % 2 for n in range(8)]


def test_the_statistics_count_what_is_in_their_file(tmp_path: Path) -> None:
    """isb_ifrecv (4, the draft's 4.6) by python-pcapng: of five records, three and two."""
    from pcapng import FileScanner
    from pcapng.blocks import InterfaceStatistics

    with series(tmp_path, packets=3) as writer:
        writer.add_interface(tap("a"))
        for number in range(5):
            writer.write_packet(number, b"x")
        writer.count_dropped(0, 7)
        writer.finish()
    got: list[tuple[int, int, int]] = []
    for path in captures(tmp_path):
        with path.open("rb") as file:
            blocks: list[Any] = [block for block in FileScanner(file) if isinstance(block, InterfaceStatistics)]
        (one,) = blocks
        options: Any = one.options
        got.append((options["isb_ifrecv"], options["isb_ifdrop"], options.get("isb_osdrop", 0)))
    assert got == [(3, 0, 0), (2, 0, 7)]


def test_a_file_says_what_it_goes_on_from(tmp_path: Path) -> None:
    with series(tmp_path, packets=1) as writer:
        writer.add_interface(tap("a"))
        writer.write_packet(1, b"x")
        writer.write_packet(2, b"y")
    first, second = captures(tmp_path)
    assert f"goes on from {first}".encode() in second.read_bytes()


def test_by_filesize_as_dumpcap_has_it(tmp_path: Path) -> None:
    """The block that reaches the size is the last of its file; 48 bytes a packet of 13."""
    with series(tmp_path, filesize=1000) as writer:
        writer.add_interface(tap("a"))
        for number in range(100):
            writer.write_packet(number, numbered(number))
    sizes = [path.stat().st_size for path in captures(tmp_path)]
    assert len(sizes) > 3
    for size in sizes[:-1]:
        assert (
            1000 <= size < 1000 + 48 + 76
        )  # statistics come behind: 20 + four options of 12 + end of options + length


def test_a_silent_bus_still_gets_its_files(tmp_path: Path) -> None:
    """That nothing was heard is evidence too: a file with its statistics says so."""
    with Bus() as bus:
        port = open_port(bus.port)
        writer = series(tmp_path, duration=0.1)
        tally = Sniffer([Side(port, tap("x"))], [writer], limits=Limits(duration=0.55)).run()
        port.close()
    paths = captures(tmp_path)
    assert 3 <= len(paths) <= 6
    assert tally.end is End.DURATION
    assert all(block_types(path) == [0x0A0D0D0A, 1, 5] for path in paths)


def test_by_the_clock(tmp_path: Path) -> None:
    """interval:2 changes files at even seconds, whenever the capture began."""
    before = time.monotonic()
    with series(tmp_path, interval=2) as writer:
        writer.add_interface(tap("a"))
        due, after = writer.due, time.monotonic()
        assert before <= due <= after + 2
        assert (time.time() + due - time.monotonic() + 1e-3) % 2 < 0.05 or due - after < 0.01


def test_only_so_many_are_kept(tmp_path: Path) -> None:
    with series(tmp_path, packets=2, files=3, checksum=True) as writer:
        writer.add_interface(tap("a"))
        for number in range(14):
            writer.write_packet(number, numbered(number))
    paths = captures(tmp_path)
    assert [int(path.name[2:7]) for path in paths] == [5, 6, 7]
    assert [p.data for path in paths for p in read_capture(path)] == [numbered(n) for n in range(8, 14)]
    assert {p.name for p in tmp_path.iterdir()} == {n for path in paths for n in (path.name, f"{path.name}.sha256")}


def test_the_end_after_so_many_files(tmp_path: Path) -> None:
    with Bus() as bus:
        port = open_port(bus.port)
        bus.send(b"".join(numbered(n) for n in range(20)))
        tally = Sniffer([Side(port, tap("x"))], [series(tmp_path, packets=4, stop_after=3)]).run()
        port.close()
    assert tally.end is End.FILES
    assert len(captures(tmp_path)) == 3
    got = [p.data for path in captures(tmp_path) for p in read_capture(path)]
    assert got == [numbered(n) for n in range(len(got))]
    assert len(got) >= 12


def test_the_last_of_so_many_files_ends_when_it_is_full(tmp_path: Path) -> None:
    """As dumpcap's does: it holds no more than the others, and nothing else need be heard for the capture to end."""
    with Bus() as bus:
        port = open_port(bus.port)
        bus.send(b"".join(numbered(n) for n in range(6)))
        limits = Limits(duration=10)
        tally = Sniffer([Side(port, tap("x"))], [series(tmp_path, packets=3, stop_after=2)], limits=limits).run()
        port.close()
    assert tally.end is End.FILES
    assert [[p.data for p in read_capture(path)] for path in captures(tmp_path)] == [
        [numbered(n) for n in group] for group in ([0, 1, 2], [3, 4, 5])
    ]


def test_names_are_told_when_closed(tmp_path: Path) -> None:
    names = tmp_path / "names"
    names.write_text("an older line\n", encoding="utf-8")
    with series(tmp_path, packets=2, printname=str(names)) as writer:
        writer.add_interface(tap("a"))
        for number in range(5):
            writer.write_packet(number, b"x")
    assert names.read_text(encoding="utf-8").splitlines() == ["an older line", *map(str, captures(tmp_path))]


def test_a_pipe_for_the_names_that_nobody_reads_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "names")
    with series(tmp_path, packets=1, printname=str(tmp_path / "names")) as writer:
        writer.add_interface(tap("a"))
        writer.write_packet(1, b"x")


def test_rotate_when_asked(tmp_path: Path) -> None:
    """Without -b the first file has the name that was given."""
    with open_writer(tmp_path / "x.pcapng") as writer:
        writer.add_interface(tap("a"))
        writer.write_packet(1, b"one")
        second = writer.rotate()
        writer.write_packet(2, b"two")
    assert second
    assert re.search(r"/x_00002_20\d{12}\.pcapng$", second)
    assert [p.data for p in read_capture(tmp_path / "x.pcapng")] == [b"one"]
    assert [p.data for p in read_capture(second)] == [b"two"]


def test_rotate_after_the_file_was_moved_away(tmp_path: Path) -> None:
    """What logrotate does: rename, then ask for a new file of the old name."""
    path = tmp_path / "x.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(tap("a"))
        writer.write_packet(1, b"one")
        path.rename(tmp_path / "x.pcapng.1")
        assert writer.rotate() == str(path)
        writer.write_packet(2, b"two")
    assert [p.data for p in read_capture(tmp_path / "x.pcapng.1")] == [b"one"]
    assert [p.data for p in read_capture(path)] == [b"two"]


def test_a_new_file_that_can_not_be_made(tmp_path: Path) -> None:
    """The capture goes on in the old one, and says so once."""
    folder = tmp_path / "there"
    folder.mkdir()
    with series(folder, packets=2) as writer:
        writer.add_interface(tap("a"))
        folder.rename(tmp_path / "elsewhere")
        for number in range(9):
            writer.write_packet(number, numbered(number))
    (path,) = captures(tmp_path / "elsewhere")
    assert [p.data for p in read_capture(path)] == [numbered(n) for n in range(9)]
    (note,) = writer.notes
    assert re.fullmatch(r"went on in \S+x_00001_\d+\.pcapng: there is no directory .*", note)


def test_an_interrupted_series_is_not_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def noon(_: str) -> str:
        return "20260131120000"

    monkeypatch.setattr(time, "strftime", noon)
    (tmp_path / "x_00001_20260131120000.pcapng").write_bytes(b"\x0a\x0d\x0d\x0a evidence")
    with pytest.raises(CaptureError, match="is there already"):
        series(tmp_path, packets=1)


@pytest.mark.parametrize("file_format", ["pcapng", "pcap"])
def test_the_checksum_is_that_of_the_file(file_format: Any, tmp_path: Path) -> None:
    path = tmp_path / "x y.cap"
    with open_writer(path, file_format, keeping=Keeping(checksum=True)) as writer:
        writer.add_interface(tap("a"))
        for number in range(100):
            writer.write_packet(number, numbered(number))
        assert not (tmp_path / "x y.cap.sha256").exists()  # not before it is whole
    told = (tmp_path / "x y.cap.sha256").read_text(encoding="utf-8")
    assert told == f"{hashlib.sha256(path.read_bytes()).hexdigest()}  x y.cap\n"


@pytest.mark.skipif(not shutil.which("sha256sum"), reason="GNU coreutils are not here")
@pytest.mark.parametrize("name", ["x.pcapng", "a\\b.pcapng", "a\nb.pcapng", " -z.pcapng", "ü.pcapng"])
def test_sha256sum_agrees(name: str, tmp_path: Path) -> None:
    with open_writer(tmp_path / name, keeping=Keeping(checksum=True)) as writer:
        writer.add_interface(tap("a"))
        writer.write_packet(1, b"x")
    command = ["sha256sum", "--strict", "-c", f"./{name}.sha256"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with (tmp_path / name).open("r+b") as file:
        file.seek(-9, os.SEEK_END)
        file.write(b"\x55")
    assert subprocess.run(command, cwd=tmp_path, capture_output=True, check=False).returncode == 1


def test_an_old_checksum_goes_when_its_file_is_overwritten(tmp_path: Path) -> None:
    for _ in range(2):
        writer = open_writer(tmp_path / "x.pcapng", keeping=Keeping(checksum=True))
        assert not (tmp_path / "x.pcapng.sha256").exists()
        writer.add_interface(tap("a"))
        writer.close()
        assert (tmp_path / "x.pcapng.sha256").exists()


def test_the_disk_is_asked_once_a_second_and_at_events(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced: list[float] = []

    def sync(_: int) -> None:
        synced.append(time.monotonic())

    monkeypatch.setattr(os, "fdatasync", sync)
    with open_writer(tmp_path / "x.pcapng", keeping=Keeping(sync_s=30)) as writer:
        writer.add_interface(tap("a"))
        for number in range(500):
            writer.write_packet(number, b"x")
        assert not synced
        writer.write_packet(501, b"", comment="mark")
        end = time.monotonic() + 20
        while not synced:
            assert time.monotonic() < end
            time.sleep(0.001)
        writer.write_packet(502, b"x")
    assert len(synced) == 2  # the event, and the end


def test_a_disk_that_fails_late(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some file systems take a write, and say only when they store it that they can't."""

    def fail(_: int) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fdatasync", fail)
    writer = open_writer(tmp_path / "x.pcapng", keeping=Keeping(checksum=True))
    writer.add_interface(tap("a"))
    writer.write_packet(1, b"", comment="mark")
    end = time.monotonic() + 20
    with pytest.raises(CaptureError, match="input/output error"):  # noqa: PT012 - it comes when the disk has said it
        while time.monotonic() < end:
            writer.hand_on()
    writer.close()
    assert not (tmp_path / "x.pcapng.sha256").exists()
    assert "input/output error when it was closed" in writer.notes[0]


def test_what_does_not_go_together(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="--append goes on in one file, -b begins new ones"):
        open_writer(tmp_path / "x.pcapng", keeping=Keeping(append=True, rotation=Rotation(packets=1)))
    with pytest.raises(CaptureError, match="is no file: --append, --sha256 and -b have no meaning"):
        open_writer("/dev/null", keeping=Keeping(checksum=True))
