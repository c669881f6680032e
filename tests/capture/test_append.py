# SPDX-License-Identifier: GPL-2.0-or-later
"""Going on in a file that was not closed: its torn end is cut off and kept as text, nothing whole is touched."""

from __future__ import annotations

import hashlib
import struct
from typing import TYPE_CHECKING, Any

import pytest
from tests.capture.bus import numbered

from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import tap
from dalycapture.output import open_output
from dalycapture.pcap import PcapWriter
from dalycapture.reader import read_capture
from dalycapture.rotation import Keeping

if TYPE_CHECKING:
    from pathlib import Path

APPEND = Keeping(append=True)


def fill(path: Path, *numbers: int, keeping: Keeping | None = None, file_format: Any = "pcapng") -> list[str]:
    """Write these records; what the writer noted."""
    with open_writer(path, file_format, keeping=keeping) as writer:
        writer.add_interface(tap("x"))
        for number in numbers:
            writer.write_packet(1_700_000_000_000_000_000 + number, numbered(number))
    return writer.notes


def records(path: Path) -> list[bytes]:
    return [p.data for p in read_capture(path) if p.data]


def events(path: Path) -> list[str]:
    return [p.comment for p in read_capture(path) if not p.data]


def test_a_whole_file_goes_on_in_a_new_section(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    fill(path, 1, 2)
    before = path.read_bytes()
    assert fill(path, 3, keeping=APPEND) == []
    assert path.read_bytes().startswith(before)
    assert path.read_bytes()[len(before) :].startswith(b"\x0a\x0d\x0d\x0a")
    assert records(path) == [numbered(n) for n in (1, 2, 3)]
    assert events(path) == []
    assert [p.interface for p in read_capture(path)] == [0, 0, 1]


def test_nothing_there_is_no_error(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    fill(path, 1, keeping=APPEND)
    (tmp_path / "y.pcapng").touch()
    fill(tmp_path / "y.pcapng", 1, keeping=APPEND)
    assert records(path) == records(tmp_path / "y.pcapng") == [numbered(1)]


@pytest.mark.parametrize("zeros", [0, 5, 4096])
def test_torn_at_every_byte(zeros: int, tmp_path: Path) -> None:
    """Two packets of 48 bytes behind the header; each cut, and as file systems leave it after a power cut."""
    path = tmp_path / "x.pcapng"
    fill(path, 1, 2)
    whole = path.read_bytes()
    borders = [len(whole) - 96, len(whole) - 48]
    for cut in range(1, len(whole)):
        path.write_bytes(whole[:cut] + bytes(zeros))
        notes = fill(path, 3, keeping=APPEND)
        # Three of the four bytes of a length at the end are zero: with zeros behind, such a block is whole.
        whole_end = max((end for end in _block_ends(whole) if cut >= end - (3 if zeros else 0)), default=0)
        left = [numbered(n + 1) for n, border in enumerate(borders) if whole_end >= border + 48]
        assert records(path) == [*left, numbered(3)], cut
        if torn := cut + zeros - whole_end:
            counted = "1 byte" if torn == 1 else f"{torn} bytes"
            assert f"a torn end of {counted} was cut off" in notes[0], cut
            (event,) = events(path)
            shown = whole[whole_end:cut].rstrip(b"\0")
            assert event.endswith(f" was cut off: {shown.hex()}" if shown else " (zeros)")
        else:
            assert notes == []


def _block_ends(data: bytes) -> list[int]:
    ends, at = list[int](), 0
    while at < len(data):
        at += struct.unpack_from("<I", data, at + 4)[0]
        ends.append(at)
    return ends


def test_big_endian_files_of_others(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    section = struct.pack(">IIIHHqI", 0x0A0D0D0A, 28, 0x1A2B3C4D, 1, 0, -1, 28)
    side = struct.pack(">IIHHII", 1, 20, 147, 0, 0, 20)
    packet = struct.pack(">IIIIIII4sI", 6, 36, 0, 0, 7, 4, 4, b"\xa5\x01\x90\x08", 36)
    path.write_bytes(section + side + packet + packet[:20])
    fill(path, 3, keeping=APPEND)
    assert records(path) == [b"\xa5\x01\x90\x08", numbered(3)]


@pytest.mark.parametrize("what", ["length", "trailer", "type and length"])
def test_damage_in_the_middle_is_not_cut(what: str, tmp_path: Path) -> None:
    """What comes behind the damage is evidence too."""
    path = tmp_path / "x.pcapng"
    fill(path, *range(20))
    data = bytearray(path.read_bytes())
    at = len(data) - 10 * 48
    if what == "length":
        data[at + 4 : at + 8] = struct.pack("<I", 8000)
    elif what == "trailer":
        data[at + 44 : at + 48] = b"\xff\xff\xff\xff"
    else:
        data[at : at + 8] = b"\xde\xad\xbe\xef\xde\xad\xbe\xef"
    path.write_bytes(data)
    with pytest.raises(CaptureError, match=rf"is damaged at byte {at} of {len(data)}, not only at its end"):
        fill(path, 3, keeping=APPEND)
    assert path.read_bytes() == data


def test_a_file_of_zeros_and_something_far_behind(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with path.open("wb") as file:
        file.seek(40 << 20)
        file.write(b"something")
    with pytest.raises(CaptureError, match="is damaged at byte 0"):
        fill(path, 3, keeping=APPEND)


def test_what_is_no_capture_is_left(tmp_path: Path) -> None:
    path = tmp_path / "x.txt"
    path.write_text("three years of work", encoding="utf-8")
    with pytest.raises(CaptureError, match="is not a pcapng or pcap file"):
        fill(path, 3, keeping=APPEND)
    assert path.read_text(encoding="utf-8") == "three years of work"


def test_a_capture_that_is_being_written_is_left(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(tap("x"))
        with pytest.raises(CaptureError, match="is being written by another capture"):
            fill(path, 3, keeping=APPEND)


def test_the_checksum_covers_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    fill(path, 1, 2)
    path.write_bytes(path.read_bytes()[:-7])
    fill(path, 3, keeping=Keeping(append=True, checksum=True))
    told = (tmp_path / "x.pcapng.sha256").read_text(encoding="utf-8")
    assert told.split()[0] == hashlib.sha256(path.read_bytes()).hexdigest()


def test_classic_pcap_torn_at_every_byte(tmp_path: Path) -> None:
    """24 bytes of header, then 16 + 13 a packet."""
    path = tmp_path / "x.pcap"
    fill(path, 1, 2, file_format="pcap")
    whole = path.read_bytes()
    assert len(whole) == 24 + 2 * 29
    for cut in range(len(whole) + 1):
        path.write_bytes(whole[:cut])
        fill(path, 3, keeping=APPEND, file_format="pcap")
        left = [numbered(n) for n in (1, 2) if cut >= 24 + n * 29]
        assert records(path) == [*left, numbered(3)], cut


def test_classic_pcap_keeps_its_unit_and_link_type(tmp_path: Path) -> None:
    path = tmp_path / "x.pcap"
    writer = PcapWriter(open_output(path), nanoseconds=False)
    writer.add_interface(tap("x"))
    writer.write_packet(1_700_000_000_123_456_000, b"a")
    writer.close()
    with open_writer(path, "pcap", keeping=APPEND) as writer:
        writer.add_interface(tap("x"))
        writer.write_packet(1_700_000_000_654_321_999, b"b")
    assert [p.time_ns % 10**9 for p in read_capture(path)] == [123_456_000, 654_321_000]
    with (
        open_writer(path, "pcap", keeping=APPEND) as writer,
        pytest.raises(CaptureError, match=r"holds link type 147 \(USER0\), and classic pcap only one"),
    ):
        writer.add_interface(tap("x", link_type=150))


def test_formats_do_not_mix(tmp_path: Path) -> None:
    fill(tmp_path / "x.pcapng", 1)
    with pytest.raises(CaptureError, match="is pcapng, and pcap can not follow it"):
        fill(tmp_path / "x.pcapng", 2, keeping=APPEND, file_format="pcap")
    assert records(tmp_path / "x.pcapng") == [numbered(1)]
