# SPDX-License-Identifier: GPL-2.0-or-later
"""Classic pcap, compression, and files that are no captures."""

from __future__ import annotations

import gzip
import io
import struct
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dalycapture.create import open_writer
from dalycapture.errors import CaptureError, TruncatedError
from dalycapture.interface import tap
from dalycapture.linktype import DALY_LINK_TYPES, check_link_type, link_type_name
from dalycapture.pcap import PcapWriter, read_pcap
from dalycapture.reader import read_capture
from dalycapture.source import Source

if TYPE_CHECKING:
    from pathlib import Path

FRAMES = [
    (1_700_000_000_123_456_789, bytes.fromhex("a501900800f80000753001815d")),
    (1_700_000_000_999_999_999, b""),
    (1_700_000_001_000_000_000, bytes.fromhex("a50191080c52050b6b0101819b")),
]


class Memory:
    name = "memory"
    size = 0

    def __init__(self) -> None:
        self.data = b""

    def write(self, block: bytes) -> bool:
        self.data += block
        return True

    def pump(self) -> None: ...

    def close(self) -> None: ...


def pcap(path: Path) -> Path:
    with open_writer(path, "pcap") as writer:
        writer.add_interface(tap("/dev/ttyUSB0"))
        for time_ns, data in FRAMES:
            writer.write_packet(time_ns, data, flags=1 << 24, comment="has no place here")
    return path


@given(st.lists(st.tuples(st.integers(0, 2**32 * 10**9 - 1), st.binary(max_size=50)), max_size=20), st.booleans())
def test_pcap_round_trip(packets: list[tuple[int, bytes]], nanoseconds: bool) -> None:
    memory = Memory()
    writer = PcapWriter(memory, nanoseconds=nanoseconds)
    writer.add_interface(tap("x", link_type=150))
    for time_ns, data in packets:
        writer.write_packet(time_ns, data)
    got = list(read_pcap(Source(io.BytesIO(memory.data), "x")))
    unit = 1 if nanoseconds else 1000
    assert [(p.time_ns, p.data) for p in got] == [(t // unit * unit, d) for t, d in packets]
    assert all(p.link_type == 150 for p in got)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(("magic", "unit"), [(0xA1B2C3D4, 1000), (0xA1B23C4D, 1)])
def test_pcap_of_others(order: str, magic: int, unit: int, tmp_path: Path) -> None:
    path = tmp_path / "x.pcap"
    header = struct.pack(order + "IHHiIII", magic, 2, 4, 0, 0, 65535, 0x1000_0093)  # an FCS length above the type
    path.write_bytes(header + struct.pack(order + "IIII", 7, 9, 2, 20) + b"ab")
    (one,) = read_capture(path)
    assert (one.number, one.time_ns, one.data, one.link_type) == (1, 7 * 10**9 + 9 * unit, b"ab", 147)


HCI = bytes.fromhex("0400") + b"\x01\x00"


@pytest.mark.parametrize("microseconds", [0, -1, (1 << 63) - 1, -(1 << 63)])
def test_a_btsnoop_time_that_no_capture_can_hold_is_no_time(microseconds: int, tmp_path: Path) -> None:
    """Microseconds since the year 0; what is before 1970 or too far away can't be written again."""
    path = tmp_path / "x.btsnoop"
    record = struct.pack(">IIIIq", 4, 4, 0, 0, microseconds) + HCI
    path.write_bytes(b"btsnoop\0" + struct.pack(">II", 1, 1002) + record)
    (one,) = read_capture(path)
    assert one.time_ns == 0


@pytest.mark.parametrize(("resolution", "offset"), [(0, 0), (6, -(1 << 62)), (6, 1 << 62), (0x80, 0)])
def test_a_pcapng_time_that_no_capture_can_hold_is_no_time(resolution: int, offset: int, tmp_path: Path) -> None:
    path = tmp_path / "x.pcapng"
    options = struct.pack("<HHB3xHHqI", 9, 1, resolution, 14, 8, offset, 0)
    interface = struct.pack("<HHI", 147, 0, 0) + options
    packet = struct.pack("<IIIII", 0, 0x7FFFFFFF, 0xFFFFFFFF, 4, 4) + b"\xa5\x40\x90\x08"
    blocks = [(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1)), (1, interface), (6, packet)]
    path.write_bytes(
        b"".join(
            struct.pack("<II", kind, len(body) + 12) + body + struct.pack("<I", len(body) + 12) for kind, body in blocks
        )
    )
    (one,) = read_capture(path)
    assert one.time_ns == 0


def test_a_time_behind_2262_is_no_time(tmp_path: Path) -> None:
    """Whoever keeps times as signed 64-bit numbers, as tables do, could not take it."""
    with open_writer(tmp_path / "x.pcapng") as writer:
        writer.add_interface(tap("x"))
        for time_ns in ((1 << 63) - 1, 1 << 63):
            writer.write_packet(time_ns, b"x")
    assert [packet.time_ns for packet in read_capture(tmp_path / "x.pcapng")] == [(1 << 63) - 1, 0]


def test_classic_pcap_has_32_bits_for_seconds(tmp_path: Path) -> None:
    path = tmp_path / "x.pcap"
    with open_writer(path, "pcap") as writer:
        writer.add_interface(tap("x"))
        for seconds in (0xFFFFFFFF, 1 << 32):
            writer.write_packet(seconds * 10**9 + 5, b"x")
    assert [packet.time_ns for packet in read_capture(path)] == [0xFFFFFFFF * 10**9 + 5, 0]


def test_scapy_reads_and_writes_pcap(tmp_path: Path) -> None:
    from scapy.utils import RawPcapReader, RawPcapWriter

    reader: Any = RawPcapReader(str(pcap(tmp_path / "x.pcap")))
    assert [(meta.sec * 10**9 + meta.usec, data) for data, meta in reader] == FRAMES
    writer: Any = RawPcapWriter(str(tmp_path / "y.pcap"), linktype=147, nano=True)
    writer.write_header(None)
    for time_ns, data in FRAMES:
        writer.write_packet(data, sec=time_ns // 10**9, usec=time_ns % 10**9)
    writer.close()
    assert [(p.time_ns, p.data) for p in read_capture(tmp_path / "y.pcap")] == FRAMES


def test_tshark_reads_pcap(tmp_path: Path) -> None:
    command = [
        "tshark",
        "-r",
        str(pcap(tmp_path / "x.pcap")),
        "-T",
        "fields",
        "-e",
        "frame.time_epoch",
        "-e",
        "frame.len",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert [line.split() for line in done.stdout.splitlines()] == [
        [f"{time_ns // 10**9}.{time_ns % 10**9:09}", str(len(data))] for time_ns, data in FRAMES
    ]


def test_pcap_has_one_link_type() -> None:
    writer = PcapWriter(Memory())
    writer.add_interface(tap("a"))
    assert writer.add_interface(tap("b")) == 1
    with pytest.raises(CaptureError, match=r"147 \(USER0\) and 148 \(USER1\); write pcapng"):
        writer.add_interface(tap("c", link_type=148))


def test_pcap_cut_anywhere(tmp_path: Path) -> None:
    whole = pcap(tmp_path / "x.pcap").read_bytes()
    borders = {24: 0, 53: 1, 69: 2, 98: 3}  # 24, + 16 + 13, + 16, + 16 + 13
    assert len(whole) == 98
    path = tmp_path / "cut.pcap"
    for cut in range(1, len(whole)):
        path.write_bytes(whole[:cut])
        got: list[int] = []
        if cut in borders:
            got.extend(p.number for p in read_capture(path))
        else:
            with pytest.raises(TruncatedError, match="cut off in the middle of"):
                got.extend(p.number for p in read_capture(path))
        assert len(got) == max(count for border, count in borders.items() if border <= max(cut, 24))


def test_pcap_hostile_length(tmp_path: Path) -> None:
    path = tmp_path / "x.pcap"
    path.write_bytes(struct.pack("<IHHIIIIIIII", 0xA1B2C3D4, 2, 4, 0, 0, 0, 147, 0, 0, 0xFFFFFFF0, 1))
    with pytest.raises(CaptureError, match=r"after 0 whole packets: a packet of 4294967280 bytes"):
        list(read_capture(path))


@pytest.mark.parametrize("file_format", ["pcap", "pcapng"])
def test_gzip(file_format: Any, tmp_path: Path) -> None:
    plain = tmp_path / "x"
    with open_writer(plain, file_format) as writer:
        writer.add_interface(tap("x"))
        for time_ns, data in FRAMES:
            writer.write_packet(time_ns, data)
    packed = tmp_path / "x.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    assert list(read_capture(packed)) == list(read_capture(plain))
    packed.write_bytes(packed.read_bytes()[:-9])
    got: list[bytes] = []
    with pytest.raises(TruncatedError, match="compressed data"):
        got.extend(p.data for p in read_capture(packed))
    damaged = bytearray(gzip.compress(plain.read_bytes()))
    damaged[-6] ^= 1  # its checksum
    packed.write_bytes(damaged)
    with pytest.raises(CaptureError, match="compressed data is damaged"):
        list(read_capture(packed))


def test_a_gzip_bomb_costs_no_memory(tmp_path: Path) -> None:
    """200 MB of zeros in 200 kB: refused after the first block, in a process that may not have 150 MB."""
    path = tmp_path / "bomb.gz"
    with gzip.open(path, "wb", compresslevel=9) as file:
        file.write(b"\x0a\x0d\x0d\x0a")
        for _ in range(200):
            file.write(bytes(1 << 20))
    code = (
        "import resource, sys; from dalycapture.reader import read_capture\n"
        "resource.setrlimit(resource.RLIMIT_AS, (150 << 20, 150 << 20))\n"
        "list(read_capture(sys.argv[1]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, timeout=60, check=False
    )
    assert "CaptureError" in done.stderr
    assert "MemoryError" not in done.stderr


def test_standard_input(tmp_path: Path) -> None:
    code = "from dalycapture.reader import read_capture\nfor p in read_capture('-'): print(p.number, len(p.data))"
    with pcap(tmp_path / "x.pcap").open("rb") as file:
        done = subprocess.run(
            [sys.executable, "-c", code], stdin=file, capture_output=True, text=True, timeout=60, check=True
        )
    assert done.stdout.split() == ["1", "13", "2", "0", "3", "13"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"2024-01-01 A5 40 90 08\n", "is a text file, not a capture; "),
        ("Straße A5 40\r\n".encode("latin-1"), "is a text file"),
        (b"\x7fELF\x02\x01\x01\x00", "is not a capture file"),
        (b"\x28\xb5\x2f\xfd....", "is compressed with zstd; unpack it first"),
        (b"PK\x03\x04....", "is a zip archive"),
    ],
)
def test_what_is_no_capture_is_named(content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "thing"
    path.write_bytes(content)
    with pytest.raises(CaptureError, match=message) as caught:
        list(read_capture(path))
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(path))


def test_missing_and_directory(tmp_path: Path) -> None:
    with pytest.raises(CaptureError, match="there is no such file"):
        list(read_capture(tmp_path / "none"))
    with pytest.raises(CaptureError, match="is a directory"):
        list(read_capture(tmp_path))


def test_no_permission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from pathlib import Path as RealPath

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(RealPath, "open", refuse)
    with pytest.raises(CaptureError, match="no permission to read it"):
        list(read_capture(tmp_path / "x"))


def test_link_types() -> None:
    assert set(range(147, 163)) == DALY_LINK_TYPES
    assert link_type_name(1) == "1 (Ethernet)"
    assert link_type_name(162) == "162 (USER15)"
    assert link_type_name(9999) == "9999"
    assert check_link_type(162) == 162
    with pytest.raises(CaptureError, match=r"149 .* is taken"):
        check_link_type(149)
    with pytest.raises(CaptureError, match=r"1 \(Ethernet\) is not for private use"):
        check_link_type(1)
