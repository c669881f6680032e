# SPDX-License-Identifier: GPL-2.0-or-later
"""Old captures cut into records again: no byte lost or moved, and what the packets carried goes along."""

from __future__ import annotations

import random
import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.capture.bus import SAMPLES, a5, real_uart_frames

from dalycapture.captured import CapturedPacket, Statistics, Told
from dalycapture.create import new_capture, open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import Interface, tap
from dalycapture.pcapng import CRC_ERROR, INBOUND, OUTBOUND, SYMBOL_ERROR, TOO_SHORT
from dalycapture.reader import read_capture
from dalycapture.reframe import Reframer, raw_packets
from dalyref.decoder import decode
from dalyref.options import Options

if TYPE_CHECKING:
    from pathlib import Path

FRAME = bytes.fromhex("a501900800f80000753001815d")  # cpy-90 of the real frames
OTHER = a5(0x40, 0x94)
BAD = FRAME[:-1] + b"\x00"
EPOCH = 1_700_000_000_000_000_000
MS = 1_000_000
BYTE_NS = 1_041_667  # ten bits at 9600 baud


@dataclass
class P:
    """A packet of an old capture: bytes, ms after the epoch, interface, flags, comment, losses before it."""

    data: bytes
    at: float = 0.0
    interface: int = 0
    flags: int = 0
    comment: str = ""
    dropped: int = 0


def reframed(folder: Path, packets: list[P], *interfaces: Interface, bus: str = "") -> list[CapturedPacket]:
    """Write an old capture, reframe it, and read what came of it."""
    old, new = folder / "old.pcapng", folder / "new.pcapng"
    with open_writer(old) as writer:
        for interface in interfaces or (Interface("/dev/ttyX", "somebody's sniffer"),):
            writer.add_interface(interface)
        for p in packets:
            writer.write_packet(
                EPOCH + round(p.at * MS),
                p.data,
                interface=p.interface,
                flags=p.flags,
                comment=p.comment,
                dropped=p.dropped,
            )
    run(old, new, bus=bus)
    return list(read_capture(new))


def run(old: Path, new: Path, *, bus: str = "") -> Reframer:
    with new_capture(new) as writer:
        reframer = Reframer(writer, bus=bus)
        for packet in read_capture(old, reframer.told):
            reframer.feed(packet)
        reframer.finish()
    return reframer


def cut(stream: bytes, chance: random.Random) -> list[bytes]:
    pieces: list[bytes] = []
    while stream:
        size = chance.choice([1, 2, 5, 13, 32, 62])
        pieces.append(stream[:size])
        stream = stream[size:]
    return pieces


@pytest.mark.parametrize("seed", range(6))
def test_cut_anywhere_it_is_the_same(seed: int, tmp_path: Path) -> None:
    """What is expected stands here by hand: the parts, one behind the other at the pace of the wire."""
    chance = random.Random(seed)
    parts = [*real_uart_frames()[:30], BAD, FRAME, b"\xff\xff", OTHER, FRAME, FRAME[:7], OTHER, b"junk", *[FRAME] * 5]
    stream = b"".join(parts)
    packets: list[P] = []
    at = 0
    for piece in cut(stream, chance):
        packets.append(P(piece, at * BYTE_NS / MS))
        at += len(piece)
    got = reframed(tmp_path, packets)
    assert [p.data for p in got] == parts
    starts = [sum(map(len, parts[:index])) for index in range(len(parts))]
    for packet, start in zip(got, starts, strict=True):
        assert abs(packet.time_ns - EPOCH - start * BYTE_NS) < 100_000
    flags = {BAD: CRC_ERROR, FRAME[:7]: TOO_SHORT}
    assert [p.flags for p in got] == [flags.get(part, 0) for part in parts]


packets_of_anything = st.lists(
    st.tuples(
        st.sampled_from([FRAME, OTHER, BAD, FRAME[:9], FRAME[9:], b"\xa5", b"\x00" * 5, b""]) | st.binary(max_size=30),
        st.sampled_from([0.0, 1.0, 14.0, 300.0, 2000.0]),
        st.integers(0, 1),
        st.sampled_from([0, INBOUND, OUTBOUND]),
    ),
    max_size=30,
)


@settings(max_examples=60, deadline=None)
@given(packets_of_anything)
def test_no_byte_is_lost_or_moved_whatever_came(rows: list[tuple[bytes, float, int, int]]) -> None:
    """By stream, the bytes are the same in the same order; times never go back; once more changes nothing."""
    written: list[CapturedPacket] = []
    names: tuple[Any, ...] = ("", "inbound", "outbound")
    clock, old = 0.0, list[CapturedPacket]()
    for number, (data, wait, interface, direction) in enumerate(rows, 1):
        clock += wait
        old.append(
            CapturedPacket(
                number, EPOCH + round(clock * MS), data, interface, direction=names[direction], flags=direction
            )
        )

    class Memory:
        def add_interface(self, _: Interface) -> int:
            return 0

        def write_packet(self, time_ns: int, data: bytes, **more: Any) -> None:
            more.pop("dropped")
            direction = names[more["flags"] & 3]
            written.append(CapturedPacket(len(written) + 1, time_ns, data, direction=direction, **more))

        def write_statistics(self, interface: int, **counts: int) -> None: ...

    def once(packets: list[CapturedPacket]) -> list[CapturedPacket]:
        written.clear()
        memory: Any = Memory()
        reframer = Reframer(memory)
        for _ in range(2):
            reframer.told.interface(tap("x"))
        for packet in packets:
            reframer.feed(packet)
        reframer.finish()
        return list(written)

    def streams(packets: list[CapturedPacket]) -> dict[Any, bytes]:
        found: dict[Any, bytes] = {}
        for packet in packets:
            key = packet.interface, packet.direction
            found[key] = found.get(key, b"") + packet.data
        return {key: data for key, data in found.items() if data}

    first = once(old)
    assert streams(first) == streams(old)
    assert sum(not p.data for p in first) == sum(not p.data for p in old)


def test_what_packets_carry_goes_along(tmp_path: Path) -> None:
    """A comment and losses with the packet's first byte, line errors with all its bytes."""
    got = reframed(
        tmp_path,
        [
            P(FRAME[:6], 0, comment="first", dropped=3),
            P(FRAME[6:] + OTHER[:5], 6 * 1.0417, comment="second", flags=SYMBOL_ERROR),
            P(OTHER[5:], 18 * 1.0417, comment="third"),
            P(BAD, 40, flags=TOO_SHORT, comment="the old one was wrong about it"),
        ],
    )
    assert [(p.data, p.flags, p.comment, p.dropped) for p in got] == [
        (FRAME, SYMBOL_ERROR, "first\nsecond", 3),
        (OTHER, SYMBOL_ERROR, "third", 0),
        (BAD, CRC_ERROR, "the old one was wrong about it", 0),
    ]


def test_two_sides_in_order_of_time(tmp_path: Path) -> None:
    """Each side in chunks that came late, as adapters with a latency timer give them."""
    host, bms = tap("/dev/ttyA", bus="x"), tap("/dev/ttyB", bus="x")
    got = reframed(
        tmp_path,
        [
            P(OTHER[:4], 0, 0, OUTBOUND),
            P(FRAME[:3], 20, 1, INBOUND),
            P(OTHER[4:], 4.2, 0, OUTBOUND),
            P(b"", 21, 0, comment="mark"),
            P(FRAME[3:], 23.2, 1, INBOUND),
            P(OTHER, 60, 0, OUTBOUND),
        ],
        host,
        bms,
    )
    assert [(p.data, p.interface, p.flags, p.direction, p.comment) for p in got] == [
        (OTHER, 0, OUTBOUND, "outbound", ""),
        (FRAME, 1, INBOUND, "inbound", ""),
        (b"", 0, 0, "", "mark"),
        (OTHER, 0, OUTBOUND, "outbound", ""),
    ]
    assert got[0].description == host.description  # ours is kept as it is


def test_a_clock_that_steps_back_moves_no_byte(tmp_path: Path) -> None:
    """While the other side holds all up, this side's records wait together: they stay in their order."""
    got = reframed(
        tmp_path,
        [P(FRAME[:3], 0, 1), P(OTHER, 90, 0), P(FRAME, 40, 0), P(FRAME[3:], 3.1, 1)],
        tap("x"),
        tap("y"),
    )
    assert [p.data for p in got if p.interface == 0] == [OTHER, FRAME]
    assert [p.time_ns - EPOCH for p in got if p.interface == 0] == [90 * MS, 40 * MS]


def test_interfaces_are_kept_and_ours_is_said(tmp_path: Path) -> None:
    """A silent one too; a stranger's is told to be a serial line for our dissector."""
    told: list[Interface] = []
    silent = Interface("eth0", "cable", 1)
    reframed(tmp_path, [P(FRAME)], Interface("ttyX", "tap", 150, 19200, "Acme"), silent, bus="garage")
    list(read_capture(tmp_path / "new.pcapng", Told(told.append)))
    assert told == [
        Interface("ttyX", "dalyshark bus=garage 19200 8N1 ttyX; reframed; was: tap", 150, 19200, "Acme"),
        silent,
    ]


def test_other_link_types_go_through(tmp_path: Path) -> None:
    ethernet = bytes(range(60))
    got = reframed(tmp_path, [P(FRAME[:5]), P(ethernet, 2, 1), P(FRAME[5:], 6)], tap("x"), Interface("eth0", "", 1))
    assert [(p.data, p.link_type) for p in got] == [(FRAME, 147), (ethernet, 1)]


def test_statistics_keep_times_and_losses(tmp_path: Path) -> None:
    old, new = tmp_path / "old.pcapng", tmp_path / "new.pcapng"
    with open_writer(old) as writer:
        writer.add_interface(tap("x"))
        writer.write_packet(EPOCH, FRAME + OTHER)
        writer.write_statistics(0, start_ns=EPOCH - 5, end_ns=EPOCH + 99, received=4, dropped=3, os_dropped=2)
    run(old, new)
    told: list[Statistics] = []
    list(read_capture(new, Told(statistics=told.append)))
    assert told == [Statistics(0, EPOCH - 5, EPOCH + 99, 2 + 3, 3, 2)]


def test_rtac_captures(tmp_path: Path) -> None:
    """LINKTYPE_RTAC_SERIAL, laid out by hand: time, event, lines, footer; then the bytes."""

    def rtac(event: int, data: bytes) -> bytes:
        return struct.pack(">IIBBH", 1_700_000_000, 0, event, 0, 0) + data

    got = reframed(
        tmp_path,
        [P(rtac(1, OTHER[:8])), P(rtac(1, OTHER[8:]), 8.4), P(rtac(2, FRAME), 20), P(rtac(7, b""), 40), P(b"\x01", 41)],
        Interface("rtac", "", 250),
    )
    assert [(p.data, p.direction, p.comment, p.link_type) for p in got] == [
        (OTHER, "outbound", "", 147),
        (FRAME, "inbound", "", 147),
        (b"", "", "RTAC: framing error", 147),
        (b"", "", "RTAC: no whole header", 147),
    ]


@pytest.mark.parametrize(
    "name", ["made-raw-chunked.pcapng", "made-damaged-bus.pcapng", "made-events.pcapng", "made-classic.pcap"]
)
def test_samples_mean_the_same(name: str, tmp_path: Path) -> None:
    """What the reference decoder reads in them stays, but for the numbers of the packets.

    And but for waits: where a record's pieces came with a pause between them, only its start is kept.
    """
    run(SAMPLES / name, tmp_path / "new.pcapng")
    other = ("_in", ".response_time")

    def meaning(path: Path) -> list[Any]:
        return [
            (r.kind, r.data, r.comment, {name: v for name, v in r.fields.items() if not name.endswith(other)})
            for r in decode(read_capture(path), Options())
        ]

    assert meaning(tmp_path / "new.pcapng") == meaning(SAMPLES / name)


def test_a_raw_log(tmp_path: Path) -> None:
    raw = tmp_path / "port.bin"
    parts = [b"\xff", *real_uart_frames() * 10, b"junk"]
    raw.write_bytes(b"".join(parts))
    assert raw.stat().st_size > 5000  # several pieces
    with new_capture(tmp_path / "new.pcapng") as writer:
        reframer = Reframer(writer)
        for packet in raw_packets(raw, Options(), reframer.told):
            reframer.feed(packet)
        reframer.finish()
    event, *got = read_capture(tmp_path / "new.pcapng")
    assert event.comment.startswith("raw log: no times are known")
    assert [p.data for p in got] == parts
    assert got[-1].time_ns == pytest.approx(sum(map(len, parts[:-1])) * 10e9 / 9600, abs=1000)


def test_an_old_output_stays_when_it_fails(tmp_path: Path) -> None:
    (tmp_path / "new.pcapng").write_bytes((SAMPLES / "made-events.pcapng").read_bytes())
    (tmp_path / "bad.pcapng").write_bytes(b"\x0a\x0d\x0d\x0a")
    before = (tmp_path / "new.pcapng").read_bytes()
    with pytest.raises(CaptureError):
        run(tmp_path / "bad.pcapng", tmp_path / "new.pcapng")
    assert (tmp_path / "new.pcapng").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 2
