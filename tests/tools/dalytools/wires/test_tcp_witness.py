# SPDX-License-Identifier: GPL-2.0-or-later
"""TCP by the reference against a plain reading of the same page, and against what was sent, on made traffic."""

from __future__ import annotations

import random
import struct
from collections import defaultdict
from typing import NamedTuple

import pytest
from tests.tools.dalytools.made import EPOCH_NS
from tests.tools.dalytools.wires.tcp_witness import Witness

from dalyref.packet import Packet
from dalytools.wires.carriers import Carriers
from dalytools.wires.choice import Choice, numbers

PORT = 8899
TURN = 1 << 32
ETHERNET, RAW_IP, COOKED, COOKED_2 = 1, 101, 113, 276
FIN, SYN, RST, ACK = 1, 2, 4, 16


class Segment(NamedTuple):
    """A segment on its way: due in the capture at some time."""

    time_ns: int
    side: int
    sequence: int
    acknowledged: int
    flags: int
    data: bytes
    cut: int = 0
    """Bytes that the snap length takes away."""


def ip(r: random.Random, client: int, one: Segment, version: int) -> bytes:
    ports = (40000 + client, PORT) if one.side == 0 else (PORT, 40000 + client)
    acknowledged = one.acknowledged % TURN if one.flags & ACK else 0
    tcp = struct.pack(
        ">HHIIBBHHH", *ports, one.sequence % TURN, acknowledged, 0x60, one.flags, r.choice((0, 8192)), 0, 0
    )
    tcp += b"\x01\x01\x01\x00" + one.data
    long = 16 if version == 6 else 4
    ends = [bytes(long - 1) + bytes((5 + end,)) for end in (one.side, 1 - one.side)]
    if version == 6:
        return struct.pack(">IHBB", 6 << 28, len(tcp), 6, 64) + ends[0] + ends[1] + tcp
    return struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(tcp), 0, 0, 64, 6, 0) + ends[0] + ends[1] + tcp


def below(link_type: int, version: int) -> bytes:
    kind = b"\x86\xdd" if version == 6 else b"\x08\x00"
    return {
        ETHERNET: bytes(12) + b"\x81\x00\x00\x05" + kind,
        RAW_IP: b"",
        COOKED: bytes(14) + kind,
        COOKED_2: kind + bytes(18),
    }[link_type]


def conversation(r: random.Random, trouble: float, *, opened: bool) -> tuple[list[Segment], tuple[bytes, bytes]]:
    """Make one connection: what is captured of it, in any order, and what was sent in each direction."""
    sent: tuple[bytearray, bytearray] = (bytearray(), bytearray())
    starts = [r.choice((r.randrange(TURN), TURN - r.randrange(1, 300))) for _ in range(2)]
    at = r.randrange(3_000_000_000)
    out: list[Segment] = []
    if opened or r.random() < 0.6:
        out += [
            Segment(at, 0, starts[0] - 1, 0, SYN, b""),
            Segment(at + 1000, 1, starts[1] - 1, starts[0], SYN | ACK, b""),
        ]
        if r.random() < 0.3:
            out.append(out[0]._replace(time_ns=at + 900_000_000))
    for _ in range(r.randrange(2, 25)):
        at += r.choice((1_000_000, 20_000_000, 400_000_000, 3_000_000_000))
        side = r.randrange(2)
        data = r.randbytes(r.choice((1, 8, 13, 40, 300)))
        whole = Segment(at, side, starts[side] + len(sent[side]), starts[1 - side] + len(sent[1 - side]), ACK, data)
        sent[side].extend(data)
        out += troubled(r, whole) if r.random() < trouble else [whole]
        answer = Segment(at + 200_000, 1 - side, whole.acknowledged, whole.sequence + len(data), ACK, b"")
        if r.random() < 0.5:
            out.append(answer)
        if r.random() < trouble / 4:
            out.append(answer._replace(time_ns=at + 45_000_000_000, sequence=answer.sequence - 1, data=b"\x00"))
    ending = r.choice((FIN | ACK, RST, RST | ACK))
    out.append(
        Segment(at + 500_000, 0, starts[0] + len(sent[0]), starts[1] + len(sent[1]), ending, b"no" * (ending & RST))
    )
    return out, (bytes(sent[0]), bytes(sent[1]))


def troubled(r: random.Random, whole: Segment) -> list[Segment]:
    """Return what may become of a segment."""
    later = whole.time_ns + r.choice((1_000, 25_000_000, 900_000_000, 1_500_000_000, 6_000_000_000, 70_000_000_000))
    size = len(whole.data)
    half, tail = r.randrange(size), r.randrange(size)
    other = bytes(byte ^ 0xFF for byte in whole.data)
    return r.choice(
        (
            [],
            [whole._replace(time_ns=later)],
            [whole, whole._replace(time_ns=later)],
            [whole, whole._replace(time_ns=later, data=other)],
            [whole._replace(data=whole.data[:half]), whole._replace(time_ns=later)],
            [whole._replace(sequence=whole.sequence + half, data=whole.data[half:]), whole._replace(time_ns=later)],
            [
                whole._replace(sequence=whole.sequence + tail, data=whole.data[tail:]),
                whole._replace(time_ns=later, data=whole.data[: max(half, tail)]),
            ],
            [whole._replace(data=whole.data[:1]), whole._replace(time_ns=later)],  # a probe of a closed window
            [whole._replace(cut=tail)],
        )
    )


def capture(r: random.Random, trouble: float) -> tuple[list[Packet], dict[tuple[int, int], list[bytes]]]:
    """Make packets of some clients, one connection after the other from the same port."""
    packets: list[tuple[int, int, bytes]] = []
    sent: dict[tuple[int, int], list[bytes]] = defaultdict(list)
    for client in range(3):
        after = 0
        version, link_type = r.choice((4, 6)), r.choice((ETHERNET, RAW_IP, COOKED, COOKED_2))
        for turn in range(r.randrange(1, 3)):
            # Without a SYN, and nothing lost, nobody could tell a second connection from bytes that are lost.
            segments, streams = conversation(r, trouble, opened=turn > 0 and not trouble)
            for one in segments:
                data = below(link_type, version) + ip(r, client, one, version)
                packets.append((after + one.time_ns, link_type, data[: len(data) - one.cut]))
            after += max(one.time_ns for one in segments) + 1_000_000
            for side in range(2):
                sent[client, side].append(streams[side])
    packets.sort(key=lambda packet: packet[0])
    made = [
        Packet(number=number, time_ns=EPOCH_NS + at, data=data, link_type=link_type)
        for number, (at, link_type, data) in enumerate(packets, 1)
    ]
    return made, sent


def handed(packets: list[Packet]) -> list[Packet]:
    carriers = Carriers(Choice(tcp_ports=numbers(str(PORT))))
    given = [one for packet in packets for one in carriers.of(packet)]
    return [*given, *carriers.finish()]


Row = tuple[int, str, str, str, bool]


def by_stream(rows: list[Row]) -> dict[tuple[str, str], list[tuple[int, str, bool]]]:
    """Sort into streams; what one packet brings without a division is one."""
    streams: dict[tuple[str, str], list[tuple[int, str, bool]]] = defaultdict(list)
    for number, connection, direction, data, divided in rows:
        stream = streams[connection, direction]
        if stream and stream[-1][0] == number and not divided:
            stream[-1] = (number, stream[-1][1] + data, stream[-1][2])
        else:
            stream.append((number, data, divided))
    return streams


@pytest.mark.parametrize("seed", [*range(100), 477])
def test_both_hand_over_the_same(seed: int) -> None:
    r = random.Random(seed)
    packets, _ = capture(r, r.choice((0.1, 0.4, 0.8)))
    witness = Witness()
    for packet in packets:
        witness.feed(packet.number, packet.time_ns, packet.link_type, packet.data)
    told: list[Row] = []
    for given in witness.finish():
        inbound = "inbound" if given.source[1] == PORT.to_bytes(2) and given.source[0][-1] == 6 else "outbound"
        told.append((given.number, f"tcp {given.connection}", inbound, given.data.hex(), given.divided))
    found: list[Row] = [
        (one.number, one.connection, one.direction, one.data.hex(), one.after_gap) for one in handed(packets)
    ]
    assert by_stream(found) == by_stream(told)
    assert len(found) > 5


@pytest.mark.parametrize("seed", range(40))
def test_what_was_sent_comes_out(seed: int) -> None:
    """Nothing lost: each direction's bytes, put together, are those that were sent, once, in order."""
    packets, sent = capture(random.Random(seed), 0)
    found: dict[tuple[str, str], bytes] = defaultdict(bytes)
    for one in handed(packets):
        found[one.connection, one.direction] += one.data
        assert not one.after_gap
    assert sorted(found.values()) == sorted(data for streams in sent.values() for data in streams if data)
