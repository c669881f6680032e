# SPDX-License-Identifier: GPL-2.0-or-later
"""The trouble of tests/traffic.py on other wires (docs/wires.md), packet by packet, as capture files hold it.

    tcp   each packet of a side is a segment; some come again, in IP fragments, change places, or (with losses) never
    ble   each packet of a side is one or several ATT values, some over several HCI packets; other devices talk as well,
          some of other makers on the same attributes; connections break and begin anew, not always with a frame
    can   classic frames, both directions, HKMS registers, inverters, standard, remote, short and strange ones

Deterministic by seed. What a reader has to choose: PORT, CHOSEN.
"""

from __future__ import annotations

import itertools
import random
import struct
from typing import TYPE_CHECKING, NamedTuple

from tests.traffic import EPOCH_NS, QUIET_MS, RARELY_MS, Traffic

if TYPE_CHECKING:
    from collections.abc import Iterator

RAW_IP, HCI_WITH_DIRECTION, SOCKETCAN = 101, 201, 227
PORT = 4001
WRITE, NOTIFY, OTHER, CHOSEN = 0x0F, 0x11, 0x20, 0x30
"""Attributes: with Daly's UUIDs, with another, and one that is not in the discovery but chosen by the user."""
_CONNECTIONS = 4  # as many as tests/traffic.py has interfaces


class OnWire(NamedTuple):
    """One packet: time, bytes."""

    time_ns: int
    data: bytes


def segment(side: int, connection: int, sequence: int, data: bytes, acknowledged: int) -> bytes:
    """Lay bytes into an IPv4 packet with a TCP segment; checksums are left out."""
    ports = (50000 + connection, PORT) if side == 0 else (PORT, 50000 + connection)
    head = struct.pack(">HHIIBBHHH", *ports, sequence & 0xFFFFFFFF, acknowledged & 0xFFFFFFFF, 0x50, 0x18, 0x2000, 0, 0)
    ends = (bytes((192, 0, 2, 10)), bytes((192, 0, 2, 20)))
    length = 20 + len(head) + len(data)
    ip = struct.pack(">BBHHHBBH", 0x45, 0, length, 1, 0, 64, 6, 0) + ends[side] + ends[1 - side]
    return ip + head + data


def fragments(r: random.Random, packet: bytes, number: int) -> list[bytes]:
    """Cut an IPv4 packet into two or three fragments, in any order."""
    head, rest = packet[:20], packet[20:]
    cuts = [0, *sorted(r.sample(range(8, len(rest), 8), min(r.choice((1, 2)), (len(rest) - 1) // 8))), len(rest)]
    made = [
        head[:2]
        + struct.pack(">HHH", 20 + b - a, number, a // 8 | (0x2000 if b < len(rest) else 0))
        + head[8:]
        + rest[a:b]
        for a, b in itertools.pairwise(cuts)
    ]
    r.shuffle(made)
    return made


def _starts(r: random.Random) -> dict[tuple[int, int], int]:
    """Return where the sequence numbers of each connection and side start: half of them begin anew before long."""
    return {
        (connection, side): r.choice((1000, (1 << 32) - r.randrange(1, 20_000)))
        for connection in range(_CONNECTIONS)
        for side in range(2)
    }


def tcp(seed: int, *, lossy: bool = False, again: bool = True) -> Iterator[OnWire]:
    """Yield segments of four connections. lossy: some never come, and none change places; again: some come twice.

    Some come in IP fragments; of lossy ones, a fragment may never come. Each acknowledges what came before it: else
    Wireshark's relative sequence numbers would be those of the wire, and it would lose what spans their wrap
    (docs/wires.md 4).
    """
    r = random.Random(seed)
    following = _starts(r)
    came = dict(following)
    number = 0
    kept: tuple[tuple[int, int], int, bytes] | None = None
    for made in Traffic(seed).packets():
        if not made.data:
            continue
        key = (made.interface, made.direction - 1 if made.direction else r.randrange(2))
        sequence = following[key]
        following[key] = sequence + len(made.data)
        packet = segment(key[1], key[0], sequence, made.data, came[key[0], 1 - key[1]])
        luck = r.random()
        if lossy and luck < 0.01:
            continue
        if kept is not None and kept[0] != key:
            came[kept[0]] = kept[1]
            yield OnWire(made.time_ns, kept[2])
            kept = None
        if not lossy and luck < 0.02 and kept is None:
            kept = (key, following[key], packet)
            continue
        came[key] = following[key]
        if r.random() < 0.02:
            number = (number + 1) & 0xFFFF
            pieces = fragments(r, packet, number)
            if lossy and r.random() < 0.2:
                del pieces[-1]
            for piece in pieces:
                yield OnWire(made.time_ns, piece)
        else:
            yield OnWire(made.time_ns, packet)
        if again and luck > 0.98:
            yield OnWire(made.time_ns + 1000, packet)
        if kept is not None:
            yield OnWire(made.time_ns + 2000, kept[2])
            kept = None


def lossy_tcp(seed: int) -> Iterator[OnWire]:
    """Yield segments some of which never come."""
    return tcp(seed, lossy=True, again=False)


def lossy_tcp_again(seed: int) -> Iterator[OnWire]:
    """Yield segments some of which never come, and some twice: not every Wireshark can show these (docs/wires.md 4)."""
    return tcp(seed, lossy=True)


def _acl(received: int, connection: int, pdu: bytes, sizes: list[int]) -> Iterator[bytes]:
    """Cut an ATT packet into HCI data packets."""
    rest = struct.pack("<HH", len(pdu), 4) + pdu
    first = True
    while rest:
        size = sizes.pop() if sizes else len(rest)
        piece, rest = rest[: max(4, size)], rest[max(4, size) :]
        flags = 0x1000 if not first else 0x2000 if received else 0
        yield struct.pack(">I", received) + struct.pack("<BHH", 2, connection | flags, len(piece)) + piece
        first = False


def _discovery(connection: int, *, again: bool = False) -> Iterator[bytes]:
    """Make the discovery of a new connection; again: of the one that there is."""
    complete = struct.pack("<BBBBHBB6sHHHB", 0x3E, 19, 1, 0, connection, 0, 0, bytes(6), 24, 0, 72, 0)
    if not again:
        yield struct.pack(">I", 1) + b"\x04" + complete
    yield from _acl(0, connection, struct.pack("<BHHH", 0x08, 1, 0xFFFF, 0x2803), [])
    found = b"".join(
        struct.pack("<HBHH", handle - 1, 0x14, handle, uuid)
        for handle, uuid in ((WRITE, 0xFFF2), (NOTIFY, 0xFFF1), (OTHER, 0x2A19))
    )
    yield from _acl(1, connection, b"\x09\x07" + found, [])


def ble(seed: int) -> Iterator[OnWire]:
    """Yield HCI packets of four connections with a board's module, of two with others like it, and of other devices."""
    r = random.Random(seed)
    for connection in range(6):
        for data in _discovery(0x40 + connection):
            yield OnWire(EPOCH_NS - 1_000_000_000, data)
    for made in Traffic(seed).packets():
        if not made.data:
            continue
        connection = 0x40 + made.interface
        board = made.direction - 1 if made.direction else r.randrange(2)
        luck = r.random()
        if luck < 0.005:
            for data in _discovery(connection, again=luck < 0.001):
                yield OnWire(made.time_ns, data)
            for data in itertools.chain.from_iterable(_before(r, connection) for _ in range(r.randrange(4))):
                yield OnWire(made.time_ns, data)
        elif luck < 0.02:
            for data in _acl(1, connection, struct.pack("<BH", 0x1B, OTHER) + made.data, []):
                yield OnWire(made.time_ns, data)
        elif luck < 0.03:
            text = r.choice((b"AT+VER=?\r\n", b"+VER:1\r\n", b"OK", b"HiLink", b"ERROR x"))
            for data in _acl(board, connection, _head(r, board) + text, []):
                yield OnWire(made.time_ns, data)
        elif luck < 0.06:
            another = 0x44 + r.randrange(2)
            if r.random() < 0.3:
                for data in _discovery(another):
                    yield OnWire(made.time_ns, data)
            for data in _before(r, another):
                yield OnWire(made.time_ns, data)
        size = r.choice((20, 20, 244))
        for at in range(0, len(made.data), size):
            for data in _value(r, board, connection, _head(r, board) + made.data[at : at + size]):
                yield OnWire(made.time_ns, data)


def _before(r: random.Random, connection: int) -> Iterator[bytes]:
    """Make a value as it may come before a board's first frame, or instead of one: many near the border of the rule."""
    board = r.randrange(2)
    luck = r.random()
    if luck < 0.5:
        data = r.choice(_OTHER_MAKERS)
    elif luck < 0.9:
        data = r.choice(_HEADS)
        data = r.choice((data, data + r.randbytes(r.randrange(16)), b"\0" + data, data[: r.randrange(len(data) + 1)]))
    else:
        data = r.randbytes(r.randrange(30))
    head = struct.pack("<BH", 0x1B if board else 0x52, CHOSEN) if r.random() < 0.03 else _head(r, board)
    if r.random() < 0.05:
        board = 1 - board  # the host is somebody's device itself
    return _value(r, board, connection, head + data)


_OTHER_MAKERS = (
    b"ATZ\r",
    b"\r\rELM327 v1.5\r\r>",
    b"41 0C 1A F8 \r\r>",
    b"AT+VER=?\r\n",
    b"OK",
    bytes.fromhex("dda50300fffd77"),
    bytes.fromhex("dd03001b1700000002d003e80000207800000000"),
    bytes.fromhex("00001048030f020b760b82fbff77"),
    bytes.fromhex("81100f05000200000000876a"),
)
_HEADS = (
    bytes.fromhex("a5019508"),
    bytes.fromhex("a5019508010ce40ce50ce600"),
    bytes.fromhex("a5409008000000000000000000"),
    bytes.fromhex("d2037c"),
    bytes.fromhex("5103040ce40ce5"),
    bytes.fromhex("6003fa"),
    bytes.fromhex("d203fc"),
    bytes.fromhex("d203fe"),
    bytes.fromhex("51030b"),
    bytes.fromhex("d20300"),
    bytes.fromhex("81037c"),
    bytes.fromhex("d203020001fc"),
    bytes.fromhex("d203000c000157aa"),
)


def _value(r: random.Random, received: int, connection: int, pdu: bytes) -> Iterator[bytes]:
    """Put an ATT packet into HCI packets, now and then several, and of these now and then not all."""
    pieces = list(_acl(received, connection, pdu, [r.choice((7, 12, 27))] if r.random() < 0.05 else []))
    if len(pieces) > 1 and r.random() < 0.2:
        del pieces[-1]  # a piece is missing
    yield from pieces


def _head(r: random.Random, board: int) -> bytes:
    if board:
        return struct.pack("<BH", r.choice((0x1B, 0x1B, 0x1D)), NOTIFY)
    return struct.pack("<BH", r.choice((0x52, 0x52, 0x12)), WRITE)


_KEEP_ALIVE = 0x0400FF80
_WRITTEN = (0x182A, 0x182C, 0x161E, 0x181E)
_INVERTERS = (0x351, 0x355, 0x356, 0x359, 0x35C, 0x35E, 0x4200, 0x4210, 0x7310, 0x0400FF81, 0x18DA10F1, 0x7DF)


def can(seed: int) -> Iterator[OnWire]:
    """Yield frames of a bus; without a keep-alive for the first half of a thousand."""
    r = random.Random(seed)
    source = Traffic(seed).packets()
    now = EPOCH_NS
    count = 0
    while True:
        count += 1
        now += r.choice(RARELY_MS if r.random() < 0.02 else QUIET_MS) * 1_000_000 + r.randrange(900_000)
        luck = r.random()
        if luck < 0.55:
            data = next(source).data
            for at in range(0, len(data) - 12, 13):
                if data[at] != 0xA5:
                    break
                board, host = r.choice((1, 1, 2, 16, data[at + 1])), r.choice((*(0x40,) * 8, 0x41, 0x80, 0x20))
                ends = (board, host) if data[at + 1] >= 0x20 else (host, board)
                identifier = 0x18 << 24 | data[at + 2] << 16 | ends[0] << 8 | ends[1]
                yield OnWire(now, _frame(r, identifier, data[at + 4 : at + 12]))
                now += r.choice((0, 1, 20)) * 1_000_000
        elif luck < 0.6 and count > 500:
            yield OnWire(now, _frame(r, _KEEP_ALIVE, bytes(8), plain=True))
        elif luck < 0.85:
            register = r.choice((*range(0x400, 0x40F), 0x400, 0x400, 0x401, 0x408, 0x40E, *_WRITTEN))
            ends = r.choice(((0x80, 1), (0xFF, 1), (1, 0x80), (0x80, 2), (2, 0x40)))
            payload = bytearray(r.randbytes(8))
            if register in (0x400, 0x401, 0x40E):
                payload[0] = r.choice((0, 1, 1, 2, 2, 3, 4, 5, 6, 0xFF))
            if register == 0x408 and r.random() < 0.8:
                payload[:2] = bytes((r.choice((4, 8, 16)), r.choice((1, 2, 8))))
            yield OnWire(now, _frame(r, register << 16 | ends[0] << 8 | ends[1], bytes(payload)))
        else:
            identifier = r.choice(_INVERTERS) if r.random() < 0.7 else r.getrandbits(29)
            yield OnWire(now, _frame(r, identifier, r.randbytes(8)))


def _frame(r: random.Random, identifier: int, data: bytes, *, plain: bool = False) -> bytes:
    """One SocketCAN packet; now and then shorter, remote, an error frame, CAN FD, or cut off."""
    flags = 0x80000000 if identifier > 0x7FF or r.random() < 0.1 else 0
    fd, said = 0, None
    luck = 1.0 if plain else r.random()
    if luck < 0.03:
        data = data[: r.randrange(8)]
    elif luck < 0.04:
        flags |= 0x40000000
        said = r.choice((0, 0, 3, 8))
        data = bytes(said if r.random() < 0.8 else said // 2)
    elif luck < 0.045:
        flags |= 0x20000000
    elif luck < 0.05:
        fd = 4
    packet = (flags | identifier).to_bytes(4, "big") + bytes((len(data) if said is None else said, fd, 0, 0)) + data
    return packet[:-2] if 0.05 <= luck < 0.055 else packet
