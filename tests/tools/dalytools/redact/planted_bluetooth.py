# SPDX-License-Identifier: GPL-2.0-or-later
"""The planted exchanges over Bluetooth, as HCI captures hold them; with names, addresses and keys of the link."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from tests.tools.dalytools.made import EPOCH_NS
from tests.tools.dalytools.redact.planted import CODE, NAME, PASSWORD, SERIAL, exchanges

from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

PHONE, DONGLE, OTHER = (bytes.fromhex(text) for text in ("5cf370a1b2c3", "a4c138d9e7f6", "7e11c0ffee42"))
KEY = bytes.fromhex("d1ceb00cfeedf00d5eaf00d1badc0de5")
SENT, RECEIVED = 0, 1
COMMAND, DATA, EVENT = 1, 2, 4

Row = tuple[int, int, bytes]
"""Direction, kind, packet."""


def l2cap(direction: int, content: bytes, *, channel: int = 4, size: int = 255, connection: int = 0x40) -> list[Row]:
    """Give the data packets of an L2CAP packet, of up to `size` bytes each."""
    whole = struct.pack("<HH", len(content), channel) + content
    rows: list[Row] = []
    for at in range(0, len(whole), size):
        flags = 0x1000 if at else 0x2000 if direction == RECEIVED else 0
        part = whole[at : at + size]
        rows.append((direction, DATA, struct.pack("<HH", connection | flags, len(part)) + part))
    return rows


def value(direction: int, content: bytes, **how: int) -> list[Row]:
    """Give what is written to fff2 (000F), or notified from fff1 (0011)."""
    opcode, handle = (0x52, 0x0F) if direction == SENT else (0x1B, 0x11)
    return l2cap(direction, struct.pack("<BH", opcode, handle) + content, **how)


def advertising(address: bytes, name: bytes) -> Row:
    content = bytes((len(name) + 1, 9)) + name
    body = b"\x02\x01\x00\x01" + address[::-1] + bytes((len(content),)) + content + b"\xc5"
    return RECEIVED, EVENT, bytes((0x3E, len(body))) + body


def connected(address: bytes, handle: int = 0x40) -> Row:
    body = struct.pack("<BBHBB6sHHHB", 1, 0, handle, 0, 1, address[::-1], 24, 0, 72, 0)
    return RECEIVED, EVENT, bytes((0x3E, len(body))) + body


def command(opcode: int, content: bytes) -> Row:
    return SENT, COMMAND, struct.pack("<HB", opcode, len(content)) + content


def discovery() -> list[Row]:
    found = struct.pack("<HBHHHBHH", 0x0E, 4, 0x0F, 0xFFF2, 0x10, 0x10, 0x11, 0xFFF1)
    return [
        *l2cap(SENT, struct.pack("<BHHH", 8, 1, 0xFFFF, 0x2803)),
        *l2cap(RECEIVED, b"\x09\x07" + found),
        *l2cap(SENT, struct.pack("<BHH", 0x12, 0x12, 1)),
        *l2cap(RECEIVED, b"\x13"),
    ]


def rows(*, discovered: bool = True, size: int = 255) -> Iterator[Row]:
    """Give the whole story; `size`: of data packets."""
    yield advertising(DONGLE, NAME[:12])
    yield advertising(OTHER, b"Jane's " + SERIAL[:9])
    yield command(0x200D, b"\x60\0\x30\0\0\0" + DONGLE[::-1] + b"\0" + bytes(12))
    yield connected(DONGLE)
    if discovered:
        yield from discovery()
    yield from l2cap(SENT, b"\x0a\x03\x00")
    yield from l2cap(RECEIVED, b"\x0b" + NAME)
    yield from l2cap(SENT, struct.pack("<BHHH", 8, 1, 0xFFFF, 0x2A25))
    yield from l2cap(RECEIVED, bytes((9, 2 + len(SERIAL), 0x21, 0)) + SERIAL)
    yield from l2cap(SENT, b"\x08" + KEY, channel=6)
    yield command(0x2019, b"\x40\0" + bytes(10) + KEY)
    yield from value(SENT, b"AT+NAME=" + CODE[:12])
    yield from value(RECEIVED, b"+NAME=" + CODE[:14])
    for pieces in exchanges():
        yield from value(SENT, pieces[0], size=size)
        answer = b"".join(pieces[1:])
        for at in range(0, len(answer), 20):
            yield from value(RECEIVED, answer[at : at + 20], size=size)
        if not discovered:
            continue
        yield from l2cap(RECEIVED, b"\x1b\x30\x00" + PASSWORD * 2)  # of another attribute
    yield from l2cap(RECEIVED, b"\x1b\x11\x00" + SERIAL, size=9)[:-1]  # never ends
    yield RECEIVED, EVENT, b"\x05\x04\x00\x40\x00\x13"


def capture(path: Path, *, discovered: bool = True, size: int = 255) -> Path:
    """Write it under link type 201, half a second from each to the next."""
    with open_writer(path, application="test") as writer:
        writer.add_interface(Interface("bluetooth0", NAME.decode(), 201))
        for number, (direction, kind, packet) in enumerate(rows(discovered=discovered, size=size)):
            writer.write_packet(
                EPOCH_NS + number * 500_000_000, struct.pack(">IB", direction, kind) + packet, comment=NAME.decode()
            )
    return path


def btsnoop(path: Path) -> Path:
    """Write it as Android does (H4)."""
    out = b"btsnoop\0" + struct.pack(">II", 1, 1002)
    for number, (direction, kind, packet) in enumerate(rows()):
        data = bytes((kind,)) + packet
        flags = direction | (2 if kind != DATA else 0)
        time_us = 0x00E03AB44A676000 + 700_000_000_000_000 + number * 500_000
        out += struct.pack(">IIIIq", len(data), len(data), flags, 0, time_us) + data
    path.write_bytes(out)
    return path


def monitor(path: Path) -> Path:
    """Write it as BlueZ does: adapter and opcode in front, and what it says of the adapter itself."""
    opcodes = {(SENT, COMMAND): 2, (RECEIVED, EVENT): 3, (SENT, DATA): 4, (RECEIVED, DATA): 5}
    with open_writer(path, application="test") as writer:
        writer.add_interface(Interface("", "", 254))
        writer.write_packet(EPOCH_NS, struct.pack(">HH", 0, 0) + b"\0\1" + PHONE[::-1] + NAME[:8])
        writer.write_packet(EPOCH_NS, struct.pack(">HH", 0xFFFF, 13) + b"jane on " + SERIAL)
        for number, (direction, kind, packet) in enumerate(rows(), 1):
            opcode = opcodes[direction, kind]
            writer.write_packet(EPOCH_NS + number * 500_000_000, struct.pack(">HH", 0, opcode) + packet)
    return path
