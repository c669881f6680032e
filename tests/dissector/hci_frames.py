# SPDX-License-Identifier: GPL-2.0-or-later
"""Bluetooth packets as a host's HCI captures hold them, built byte by byte; little-endian but for the pseudo-headers.

H4 (187)           type | packet
H4, direction (201)  direction u32 (0 sent, 1 received) | type | packet
monitor (254)      adapter u16 | opcode u16 | packet
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

from tests.dissector.dissection import P

H4, H4_DIRECTION, MONITOR = 187, 201, 254
SENT, RECEIVED = 0, 1
ACL, EVENT = 2, 4
MONITOR_OPCODE = {(EVENT, RECEIVED): 3, (ACL, SENT): 4, (ACL, RECEIVED): 5}

WRITE_REQUEST, WRITE, NOTIFY, INDICATE = 0x12, 0x52, 0x1B, 0x1D
PEER = bytes.fromhex("0201ccddeeff")
BASE_UUID = bytes.fromhex("fb349b5f8000008000100000")  # ends in the short UUID and two zeros


@dataclass
class Radio:
    """One host's HCI: each call adds a packet; `packets` is what was captured."""

    link_type: int = H4_DIRECTION
    connection: int = 0x40
    step: float = 0.01
    interface: int = 0
    adapter: int = 0
    packets: list[P] = field(default_factory=list[P])
    at: float = 0.0

    def hci(self, kind: int, direction: int, body: bytes) -> None:
        """Add one HCI packet."""
        heads = {
            H4: bytes((kind,)),
            H4_DIRECTION: struct.pack(">IB", direction, kind),
        }
        head = heads.get(self.link_type) or struct.pack(">HH", self.adapter, MONITOR_OPCODE[kind, direction])
        self.packets.append(P((head + body).hex(), round(self.at, 6), self.interface))
        self.at += self.step

    def complete(self, *, status: int = 0) -> None:
        """LE Connection Complete."""
        self.hci(
            EVENT, RECEIVED, bytes((0x3E, 19, 1, status)) + self._connected() + bytes.fromhex("180000004800") + b"\0"
        )

    def enhanced_complete(self) -> None:
        """LE Enhanced Connection Complete: two addresses more."""
        tail = bytes(12) + bytes.fromhex("180000004800") + b"\0"
        self.hci(EVENT, RECEIVED, bytes((0x3E, 31, 0x0A, 0)) + self._connected() + tail)

    def classic_complete(self) -> None:
        """Connection Complete of classic Bluetooth."""
        self.hci(EVENT, RECEIVED, bytes((3, 11, 0)) + struct.pack("<H", self.connection) + PEER + b"\x01\x00")

    def _connected(self) -> bytes:
        return struct.pack("<HBB", self.connection, 0, 0) + PEER

    def att(self, direction: int, pdu: bytes, *, pieces: tuple[int, ...] = ()) -> None:
        """Add an ATT packet; `pieces`: sizes of the ACL packets that it comes in, but the last."""
        data = struct.pack("<HH", len(pdu), 4) + pdu
        flags = 0x2000 if direction == RECEIVED else 0
        for size in (*pieces, len(data)):
            piece, data = data[:size], data[size:]
            self.hci(ACL, direction, struct.pack("<HH", self.connection | flags, len(piece)) + piece)
            flags = 0x1000

    def write(self, handle: int, value: str, *, opcode: int = WRITE, direction: int = SENT) -> None:
        self.att(direction, bytes((opcode,)) + struct.pack("<H", handle) + bytes.fromhex(value))

    def notify(self, handle: int, value: str, *, opcode: int = NOTIFY, pieces: tuple[int, ...] = ()) -> None:
        self.att(RECEIVED, bytes((opcode,)) + struct.pack("<H", handle) + bytes.fromhex(value), pieces=pieces)

    def discover(self, *found: tuple[int, int], asked: int = 0x2803, side: int = SENT, wide: bool = False) -> None:
        """Read By Type, and its response: (value's handle, UUID) of each characteristic."""
        self.att(side, struct.pack("<BHHH", 0x08, 1, 0xFFFF, asked))
        entries = [struct.pack("<HBH", handle - 1, 0x10, handle) + uuid(short, wide) for handle, short in found]
        self.att(1 - side, bytes((0x09, len(entries[0]))) + b"".join(entries))

    def find_information(self, *found: tuple[int, int], wide: bool = False) -> None:
        """Find Information, and its response: (attribute's handle, UUID)."""
        self.att(SENT, struct.pack("<BHH", 0x04, 1, 0xFFFF))
        entries = [struct.pack("<H", handle) + uuid(short, wide) for handle, short in found]
        self.att(RECEIVED, bytes((0x05, 2 if wide else 1)) + b"".join(entries))


def uuid(short: int, wide: bool = False) -> bytes:
    return BASE_UUID + struct.pack("<HH", short, 0) if wide else struct.pack("<H", short)


def btsnoop(radio: Radio) -> bytes:
    """What Android writes of packets of link type 201: btsnoop, data link 1002."""
    data = b"btsnoop\0" + struct.pack(">II", 1, 1002)
    epoch = 0x00DCDDB30F2F8000 + 1_700_000_000 * 1_000_000  # the format's microseconds begin in the year 0
    for packet in radio.packets:
        raw = bytes.fromhex(packet.hex)
        direction, body = raw[3], raw[4:]
        flags = direction | (2 if body[0] == EVENT else 0)
        data += struct.pack(">IIIIq", len(body), len(body), flags, 0, epoch + round(packet.at * 1e6)) + body
    return data
