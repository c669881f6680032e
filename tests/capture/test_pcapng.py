# SPDX-License-Identifier: GPL-2.0-or-later
"""pcapng: what we write, others read; what others write, we read; damage is named and never costs memory."""

from __future__ import annotations

import contextlib
import io
import json
import struct
import subprocess
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dalycapture import pcapng
from dalycapture.captured import Statistics, Told
from dalycapture.create import open_writer
from dalycapture.errors import CaptureError, TruncatedError
from dalycapture.interface import Interface, tap
from dalycapture.pcapng import PcapngWriter, read_pcapng
from dalycapture.reader import read_capture
from dalycapture.source import Source

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dalyref.packet import Packet

# draft-ietf-opsawg-pcapng, 4.3.1: bits 0-1 direction, 24 CRC error, 26 too short
INBOUND, OUTBOUND, CRC, SHORT = 0b01, 0b10, 1 << 24, 1 << 26


class Memory:
    """An output that keeps its bytes, and where its blocks end."""

    name = "memory"

    def __init__(self) -> None:
        self.blocks: list[bytes] = []
        self.size = 0

    def write(self, block: bytes) -> bool:
        self.blocks.append(block)
        self.size += len(block)
        return True

    def pump(self) -> None: ...

    def close(self) -> None: ...


@dataclass(frozen=True)
class Row:
    time_ns: int
    data: bytes
    interface: int
    flags: int
    comment: str


comments = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\x00"), max_size=40)
rows = st.lists(
    st.builds(
        Row,
        time_ns=st.integers(0, 2**63 - 1),
        data=st.binary(max_size=40) | st.binary(min_size=4090, max_size=4096),
        interface=st.integers(0, 1),
        flags=st.sampled_from([0, INBOUND, OUTBOUND, CRC, SHORT, CRC | INBOUND]),
        comment=comments,
    ),
    max_size=12,
)


def write(output: Any, content: Sequence[Row]) -> None:
    writer = PcapngWriter(output, application="dalyshark test")
    writer.add_interface(tap("/dev/ttyA", bus="x"))
    writer.add_interface(Interface(name="b", description="dalyshark bus=x side B", link_type=148, speed=19200))
    for row in content:
        writer.write_packet(row.time_ns, row.data, interface=row.interface, flags=row.flags, comment=row.comment)
    writer.write_statistics(0, start_ns=1, end_ns=2, received=len(content), dropped=0)


def read(data: bytes) -> list[Packet]:
    return list(read_pcapng(Source(io.BytesIO(data), "x.pcapng")))


@given(rows)
def test_what_is_written_is_read(content: list[Row]) -> None:
    memory = Memory()
    write(memory, content)
    packets = read(b"".join(memory.blocks))
    assert [(p.time_ns, p.data, p.interface, p.comment) for p in packets] == [
        (r.time_ns, r.data, r.interface, r.comment) for r in content
    ]
    assert [p.number for p in packets] == list(range(1, len(content) + 1))
    assert all(p.link_type == (147, 148)[p.interface] for p in packets)
    assert all("bus=x" in p.description for p in packets)
    assert [p.direction for p in packets] == [("", "inbound", "outbound")[r.flags & 3] for r in content]


def test_one_write_a_block() -> None:
    memory = Memory()
    write(memory, [Row(5, b"abc", 0, 0, ""), Row(6, b"", 0, 0, "mark")])
    types = [struct.unpack_from("<I", block)[0] for block in memory.blocks]
    assert types == [0x0A0D0D0A, 1, 1, 6, 6, 5]
    for block in memory.blocks:  # 3.1: the total length stands at both ends, and is a multiple of four
        total = struct.unpack_from("<I", block, 4)[0]
        assert len(block) == total == struct.unpack("<I", block[-4:])[0]
        assert total % 4 == 0


def test_an_enhanced_packet_byte_by_byte() -> None:
    """Laid out by hand from the draft (4.3), for one short record with a comment."""
    memory = Memory()
    write(memory, [Row(0x0000000100000002, b"\xa5\x01\x90\x08\x00", 0, SHORT, "x")])
    assert memory.blocks[3].hex() == (
        "060000003c000000"  # type, 60 bytes
        "000000000100000002000000"  # interface, time high, time low
        "0500000005000000a501900800000000"  # captured, original, data and 3 of padding
        "0200040000000004"  # epb_flags: bit 26
        "0100010078000000"  # comment "x" and 3 of padding
        "000000003c000000"  # end of options, total length again
    )  # fmt: skip


SAMPLE = [
    Row(1_700_000_000_123_456_789, bytes.fromhex("a501900800f80000753001815d"), 0, 0, ""),
    Row(1_700_000_000_200_000_001, bytes.fromhex("a501900800f80000753001815e"), 0, CRC, "sum"),
    Row(1_700_000_001_000_000_000, bytes.fromhex("a5019008"), 1, SHORT | INBOUND, ""),
    Row(1_700_000_001_999_999_999, b"", 0, 0, "port lost: Kabel gezogen, schade"),
    Row(1_700_000_002_000_000_000, bytes(range(250)), 1, OUTBOUND, "naïve"),
]


@pytest.fixture
def sample(tmp_path: Path) -> Path:
    path = tmp_path / "sample.pcapng"
    with open_writer(path, application="dalyshark 9.9") as writer:
        writer.add_interface(tap("/dev/ttyUSB0", hardware="Acme 485 (1a86:7523)"))
        writer.add_interface(Interface(name="b", description="dalyshark bus=main B", link_type=147, speed=9600))
        for row in SAMPLE:
            writer.write_packet(row.time_ns, row.data, interface=row.interface, flags=row.flags, comment=row.comment)
        writer.write_statistics(0, start_ns=SAMPLE[0].time_ns, end_ns=SAMPLE[-1].time_ns, received=3, dropped=2)
    return path


def test_python_pcapng_reads_it(sample: Path) -> None:
    from pcapng import FileScanner
    from pcapng.blocks import EnhancedPacket, InterfaceDescription, InterfaceStatistics, SectionHeader

    with sample.open("rb") as file:
        blocks: list[Any] = list(FileScanner(file))
    header: Any = next(b for b in blocks if isinstance(b, SectionHeader))
    assert header.options["shb_userappl"] == "dalyshark 9.9"
    sides: list[Any] = [b for b in blocks if isinstance(b, InterfaceDescription)]
    assert sides[0].options["if_name"] == "/dev/ttyUSB0"
    assert sides[0].options["if_description"] == "dalyshark bus=main 9600 8N1 /dev/ttyUSB0"
    assert sides[0].options["if_speed"] == 9600
    assert sides[0].options["if_hardware"] == "Acme 485 (1a86:7523)"
    packets: list[Any] = [b for b in blocks if isinstance(b, EnhancedPacket)]
    assert [p.packet_data for p in packets] == [row.data for row in SAMPLE]
    assert [(p.timestamp_high << 32) + p.timestamp_low for p in packets] == [row.time_ns for row in SAMPLE]
    assert [p.options.get("opt_comment", "") for p in packets] == [row.comment for row in SAMPLE]
    flags: list[Any] = [p.options.get("epb_flags") for p in packets]
    assert [bool(f and f.err_crc) for f in flags] == [bool(row.flags & CRC) for row in SAMPLE]
    assert [bool(f and f.err_short) for f in flags] == [bool(row.flags & SHORT) for row in SAMPLE]
    assert [f.inout if f else "NA" for f in flags] == [("NA", "inbound", "outbound")[row.flags & 3] for row in SAMPLE]
    statistics: Any = next(b for b in blocks if isinstance(b, InterfaceStatistics))
    assert (statistics.options["isb_ifrecv"], statistics.options["isb_ifdrop"]) == (3, 2)


def test_we_read_it(sample: Path) -> None:
    told_interfaces: list[Interface] = []
    told_statistics: list[Statistics] = []
    packets = list(read_capture(sample, Told(told_interfaces.append, told_statistics.append)))
    assert [(p.data, p.time_ns, p.flags, p.comment, p.interface) for p in packets] == [
        (row.data, row.time_ns, row.flags, row.comment, row.interface) for row in SAMPLE
    ]
    assert told_interfaces == [
        tap("/dev/ttyUSB0", hardware="Acme 485 (1a86:7523)"),
        Interface(name="b", description="dalyshark bus=main B", link_type=147, speed=9600),
    ]
    assert told_statistics == [Statistics(0, SAMPLE[0].time_ns, SAMPLE[-1].time_ns, 3, 2)]


def test_scapy_reads_it(sample: Path) -> None:
    from scapy.utils import RawPcapNgReader

    reader: Any = RawPcapNgReader(str(sample))
    packets: list[Any] = list(reader)
    assert [data for data, _ in packets] == [row.data for row in SAMPLE]
    assert [(meta.tshigh << 32) + meta.tslow for _, meta in packets] == [row.time_ns for row in SAMPLE]
    assert [meta.tsresol for _, meta in packets] == [10**9] * len(SAMPLE)
    assert [meta.direction or 0 for _, meta in packets] == [row.flags & 3 for row in SAMPLE]  # all it has of the flags


def tshark(path: Path, *words: str) -> list[list[str]]:
    fields = [word for name in words for word in ("-e", name)]
    command = ["tshark", "-r", str(path), "-T", "fields", "-E", "separator=|", *fields]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return [line.split("|") for line in done.stdout.splitlines()]


def test_tshark_reads_it(sample: Path) -> None:
    lines = tshark(
        sample,
        "frame.time_epoch",
        "frame.len",
        "frame.comment",
        "frame.packet_flags_crc_error",
        "frame.packet_flags_packet_too_short_error",
        "frame.packet_flags_direction",
        "frame.interface_name",
        "frame.interface_description",
    )
    assert len(lines) == len(SAMPLE)
    for row, (time, length, comment, crc, short, direction, name, description) in zip(SAMPLE, lines, strict=True):
        seconds, _, nanoseconds = time.partition(".")
        assert int(seconds) * 10**9 + int(nanoseconds) == row.time_ns
        assert int(length) == len(row.data)
        assert comment == row.comment
        assert (crc in {"1", "True"}) == bool(row.flags & CRC)
        assert (short in {"1", "True"}) == bool(row.flags & SHORT)
        assert int(direction or "0", 0) == row.flags & 3
        assert name == ("/dev/ttyUSB0", "b")[row.interface]
        assert description.startswith("dalyshark bus=main")


def test_tshark_sees_the_bytes(sample: Path) -> None:
    done = subprocess.run(
        ["tshark", "-r", str(sample), "-T", "json", "-x"], capture_output=True, text=True, check=True, timeout=60
    )
    layers = [packet["_source"]["layers"] for packet in json.loads(done.stdout)]
    assert [bytes.fromhex(one["frame_raw"][0]) if "frame_raw" in one else b"" for one in layers] == [
        row.data for row in SAMPLE
    ]


def block(block_type: int, body: bytes, order: str = "<") -> bytes:
    body += bytes(-len(body) % 4)
    return struct.pack(order + "II", block_type, len(body) + 12) + body + struct.pack(order + "I", len(body) + 12)


def section(order: str = "<", major: int = 1) -> bytes:
    return block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, major, 0, -1), order)


def side(link_type: int = 147, snap: int = 0, options: bytes = b"", order: str = "<") -> bytes:
    return block(1, struct.pack(order + "HHI", link_type, 0, snap) + options, order)


def option(code: int, value: bytes, order: str = "<") -> bytes:
    return struct.pack(order + "HH", code, len(value)) + value + bytes(-len(value) % 4)


def packet(ticks: int = 0, data: bytes = b"abc", interface: int = 0, options: bytes = b"", order: str = "<") -> bytes:
    head = struct.pack(order + "IIIII", interface, ticks >> 32, ticks & 0xFFFFFFFF, len(data), len(data))
    return block(6, head + data + bytes(-len(data) % 4) + options, order)


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_byte_orders(order: str) -> None:
    options = option(9, b"\x09") + option(3, b"tap bus=q")
    data = (
        section(order) + side(options=options, order=order)
        + packet(7_000_000_001, options=option(2, struct.pack(order + "I", OUTBOUND), order), order=order)
    )  # fmt: skip
    if order == ">":  # options' heads too
        data = data.replace(option(9, b"\x09"), option(9, b"\x09", order)).replace(
            option(3, b"tap bus=q"), option(3, b"tap bus=q", order)
        )
    (one,) = read(data)
    assert (one.time_ns, one.data, one.direction, one.description) == (7_000_000_001, b"abc", "outbound", "tap bus=q")


@pytest.mark.parametrize(
    ("resolution", "ticks", "nanoseconds"),
    [
        (None, 1_500_000, 1_500_000_000),  # default: microseconds
        (6, 1_500_000, 1_500_000_000),
        (9, 1_500_000_001, 1_500_000_001),
        (3, 1_500, 1_500_000_000),
        (12, 1_500_000_000_999, 1_500_000_000),  # picoseconds: what is below a nanosecond goes
        (0x80 | 10, 1536, 1_500_000_000),  # 2^-10 s
        (0x80 | 32, 3 << 31, 1_500_000_000),  # NTP fractions
    ],
)
def test_every_time_resolution(resolution: int | None, ticks: int, nanoseconds: int) -> None:
    options = b"" if resolution is None else option(9, bytes([resolution]))
    (one,) = read(section() + side(options=options) + packet(ticks))
    assert one.time_ns == nanoseconds


def test_time_offset() -> None:
    (one,) = read(section() + side(options=option(14, struct.pack("<q", 100))) + packet(1))
    assert one.time_ns == 100 * 10**9 + 1000


def test_several_sections_have_interfaces_of_their_own() -> None:
    data = section() + side(147) + side(148) + packet(interface=1) + section(">") + side(1, order=">")
    packets = read(data + packet(order=">"))
    assert [(p.number, p.interface, p.link_type) for p in packets] == [(1, 1, 148), (2, 2, 1)]


def test_interfaces_without_end_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each is a bus to whoever reads on; a capture of nothing else would fill the memory."""
    monkeypatch.setattr(pcapng, "MOST_INTERFACES", 3)
    assert len(read(section() + side() * 3 + packet())) == 1
    with pytest.raises(CaptureError, match="more than 3 interfaces"):
        read(section() + side() * 2 + section() + side() * 2 + packet())


def test_simple_and_obsolete_packets_and_unknown_blocks() -> None:
    simple = block(3, struct.pack("<I", 9) + b"abcd")  # nine on the wire, snap length 4
    obsolete = block(2, struct.pack("<HHIIII", 0, 0, 0, 5, 2, 2) + b"xy\0\0" + option(2, struct.pack("<I", INBOUND)))
    data = section() + side(snap=4) + block(0x77, b"what") + simple + block(5, bytes(12)) + obsolete
    assert [(p.number, p.time_ns, p.data, p.direction) for p in read(data)] == [
        (1, 0, b"abcd", ""),
        (2, 5000, b"xy", "inbound"),
    ]


@pytest.mark.parametrize("kind", [0x9, 0xBAD, 0x40000BAD, 0x77])
def test_numbers_are_wiresharks(kind: int, tmp_path: Path) -> None:
    """Wireshark shows some blocks that hold no packet as one (journal, custom); the others it skips."""
    body = b"__REALTIME_TIMESTAMP=1\n" if kind == 9 else struct.pack("<I", 32473) + b"some"
    path = tmp_path / "x.pcapng"
    path.write_bytes(section() + side() + block(kind, body) + packet())
    theirs = [line[0] for line in tshark(path, "frame.number", "frame.protocols") if "user_dlt" in line[1]]
    assert [str(p.number) for p in read_capture(path)] == theirs


def test_several_comments() -> None:
    (one,) = read(section() + side() + packet(options=option(1, b"one") + option(1, b"two\xff") + bytes(4)))
    assert one.comment == "one\ntwo\ufffd"


def test_python_pcapng_writes_and_we_read() -> None:
    from pcapng import FileWriter
    from pcapng.blocks import EnhancedPacket, InterfaceDescription, SectionHeader

    stream = io.BytesIO()
    header: Any = SectionHeader(options={"shb_userappl": "x"}, endianness=">")
    described: Any = header.new_member(
        InterfaceDescription,
        link_type=147,
        options={"if_description": "other bus=z", "if_tsresol": b"\x09"},
    )
    writer: Any = FileWriter(stream, header)
    one: Any = header.new_member(EnhancedPacket, options={"opt_comment": "hello"})
    one.interface_id = 0
    one.timestamp_high, one.timestamp_low = 1, 2
    one.packet_data = b"\xa5\x40\x90"
    writer.write_block(one)
    assert described is not None
    (got,) = read(stream.getvalue())
    assert (got.data, got.comment, got.description) == (b"\xa5\x40\x90", "hello", "other bus=z")
    assert got.time_ns == (1 << 32) + 2


def test_editcap_writes_and_we_read(sample: Path, tmp_path: Path) -> None:
    """Wireshark's own writer, from our file: bytes, times, comments and directions stay."""
    out = tmp_path / "again.pcapng"
    subprocess.run(["editcap", "-F", "pcapng", str(sample), str(out)], check=True, timeout=60)
    assert list(read_capture(out)) == list(read_capture(sample))


def test_cut_anywhere() -> None:
    memory = Memory()
    write(memory, [Row(n, bytes([n]) * n, 0, 0, "c" * (n % 3)) for n in range(6)])
    data = b"".join(memory.blocks)
    packets_before = {0: 0}  # border of a block: packets before it
    end = whole = 0
    for one in memory.blocks:
        end += len(one)
        whole += one[:4] == b"\x06\0\0\0"
        packets_before[end] = whole
    for cut in range(1, len(data)):
        got: list[Packet] = []
        reading = read_pcapng(Source(io.BytesIO(data[:cut]), "x.pcapng"))
        if cut in packets_before:
            got = list(reading)
        else:
            with pytest.raises(TruncatedError, match=r"x\.pcapng: cut off .* whole packet"):
                got.extend(reading)
        assert len(got) == max(count for border, count in packets_before.items() if border <= cut)


@pytest.mark.parametrize(
    ("damaged", "what"),
    [
        (section() + struct.pack("<II", 1, 0xFFFFFFFC), "a block of 4294967292 bytes"),
        (section() + struct.pack("<II", 1, (16 << 20) + 4), "a block of 16777220 bytes"),
        (section() + bytes(64), "a block of 0 bytes"),
        (section() + struct.pack("<III", 1, 13, 0), "a block of 13 bytes"),
        (section() + struct.pack("<IIHHII", 1, 20, 147, 0, 0, 24), "two lengths"),
        (section() + block(1, b"\0\0\0\0"), "too short"),
        (section() + side() + packet(interface=1), "interface 1, which is not described"),
        (section() + packet(), "interface 0, which is not described"),
        (
            section() + side() + block(6, struct.pack("<IIIII", 0, 0, 0, 0xFFFFFFFF, 3) + b"abc"),
            "longer than its block",
        ),
        (section() + side() + block(6, struct.pack("<IIIII", 0, 0, 0, 5, 5) + b"abc"), "longer than its block"),
        (section() + side() + block(2, b"abcd"), "too short"),
        (section() + side() + block(3, struct.pack("<I", 5) + b"abcd"), "longer than its block"),
        (section() + side(options=struct.pack("<HH", 2, 400)), "an option longer than its block"),
        (section() + struct.pack("<III", 0x0A0D0D0A, 28, 0x11223344) + bytes(16), "byte-order magic"),
        (section(major=2), "version 2.0 is not known"),
    ],
)
def test_hostile_lengths_are_named(damaged: bytes, what: str) -> None:
    with pytest.raises(CaptureError, match=what) as caught:
        read(damaged)
    assert not isinstance(caught.value, TruncatedError)
    assert "\n" not in str(caught.value)


@settings(max_examples=300)
@given(st.binary(max_size=200), st.booleans())
def test_any_bytes_end_in_packets_or_one_kind_of_error(tail: bytes, big: bool) -> None:
    order = ">" if big else "<"
    with contextlib.suppress(CaptureError):
        read(section(order) + side(order=order) + tail)


@settings(max_examples=300)
@given(st.data())
def test_flipped_bytes_end_in_packets_or_one_kind_of_error(data: st.DataObject) -> None:
    memory = Memory()
    write(memory, SAMPLE)
    content = bytearray(b"".join(memory.blocks))
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(4, len(content) - 1))] = data.draw(st.integers(0, 255))
    with contextlib.suppress(CaptureError):
        read(bytes(content))


def test_a_dropped_packet_is_counted_on_the_next() -> None:
    """epb_dropcount (4.3): a pipe that took nothing for too long."""

    class Full(Memory):
        def write(self, block: bytes) -> bool:
            full = len(self.blocks) == 4
            self.blocks.append(b"" if full else block)
            return not full

    full = Full()
    writer = PcapngWriter(full)
    writer.add_interface(tap("x"))
    for number in range(5):
        writer.write_packet(number, b"abc")
    assert (writer.written, writer.lost) == (4, 1)
    dropped = struct.pack("<HHQ", 4, 8, 1)
    assert [dropped in one for one in full.blocks] == [False, False, False, False, False, True, False]


def test_a_long_comment_is_cut_between_characters() -> None:
    memory = Memory()
    write(memory, [Row(1, b"", 0, 0, "ä" * 40_000)])
    (one,) = read(b"".join(memory.blocks))
    assert one.comment == "ä" * 32767


def test_an_interface_must_be_described_first() -> None:
    with pytest.raises(ValueError, match="interface 0 was not described"):
        PcapngWriter(Memory()).write_packet(1, b"x")
