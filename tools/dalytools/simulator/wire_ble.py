# SPDX-License-Identifier: GPL-2.0-or-later
"""The same exchange through a Bluetooth dongle (field notes e), as HCI captures hold it: link type 201.

    direction u32 | 02 | connection, flags u16 | length u16 | L2CAP: length u16, channel 0004 | ATT ..

    host to board   52 write command      handle 000F (fff2)   what the app asks, one request a value
    board to host   1B notification       handle 0011 (fff1)   what the board's UART says, 20 bytes at a time

The capture begins with the connection and the discovery of these two characteristics. Little-endian, but the direction.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final

from dalycapture.interface import Interface
from dalytools.simulator.bus import BITS_A_BYTE, CLIENT
from dalytools.simulator.wire import WirePacket

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dalytools.simulator.scenario import Scenario
    from dalytools.simulator.sent import Sent

HCI_WITH_DIRECTION: Final = 201
SENT, RECEIVED = 0, 1
CONNECTION: Final = 0x0040
NOTIFY_HANDLE, WRITE_HANDLE = 0x0011, 0x000F  # as on old dongles, which are known by handle
PEER: Final = bytes.fromhex("0201ccddeeff")  # the address of a dongle that is none
VALUE_BYTES: Final = 20  # of a notification at the smallest ATT size
_STEP_NS: Final = 30_000_000  # a connection interval
_PAUSE_NS: Final = 20_000_000  # of the board's UART, after which the dongle sends what it has


class BleWire:
    """The radio of the host that runs the app."""

    def __init__(self, scenario: Scenario) -> None:
        self.interface = Interface("bluetooth0", "made by dalyshark simulate", HCI_WITH_DIRECTION)
        self._char_ns = BITS_A_BYTE * 1_000_000_000 / scenario.baud
        self._hosts = {host.name for host in scenario.hosts} | {CLIENT}
        self._hosts |= {event.sender for event in scenario.events if event.what == "send"}
        self._opened = False
        self._ahead = b""  # of the board's UART, not sent yet
        self._ahead_ns = 0  # when its last byte had come

    def feed(self, piece: Sent) -> Iterable[WirePacket]:
        """Take one piece; what went over the air by then."""
        if not self._opened:
            self._opened = True
            yield from _opening(piece.time_ns)
        if piece.sender in self._hosts:
            yield from self._rest()
            yield WirePacket(piece.time_ns, _att(SENT, b"\x52" + struct.pack("<H", WRITE_HANDLE) + piece.data))
            return
        if piece.time_ns > self._ahead_ns + _PAUSE_NS:
            yield from self._rest()
        begin = piece.time_ns
        for at, byte in enumerate(piece.data, 1):
            self._ahead += bytes((byte,))
            self._ahead_ns = begin + round(at * self._char_ns)
            if len(self._ahead) == VALUE_BYTES:
                yield from self._rest()

    def finish(self, end_ns: int) -> Iterable[WirePacket]:  # noqa: ARG002 - the radio knows no end
        """Hand out what the dongle still has."""
        return self._rest()

    def _rest(self) -> Iterator[WirePacket]:
        if self._ahead:
            yield WirePacket(self._ahead_ns, _att(RECEIVED, b"\x1b" + struct.pack("<H", NOTIFY_HANDLE) + self._ahead))
            self._ahead = b""


def _att(direction: int, pdu: bytes) -> bytes:
    """Wrap one ATT packet up to HCI."""
    flags = 0x2000 if direction == RECEIVED else 0  # the beginning of an L2CAP packet, as each side marks it
    l2cap = struct.pack("<HH", len(pdu), 4) + pdu
    return struct.pack(">I", direction) + struct.pack("<BHH", 2, CONNECTION | flags, len(l2cap)) + l2cap


def _opening(first_ns: int) -> Iterator[WirePacket]:
    """Connect, discover, switch notifications on; it ends before the first byte, which may be at 0."""
    complete = struct.pack("<BBBBHBB6sHHHB", 0x3E, 19, 1, 0, CONNECTION, 0, 0, PEER, 24, 0, 72, 0)
    characteristic = struct.Struct("<HBHH")  # declaration's handle, properties, value's handle, UUID
    found = characteristic.pack(WRITE_HANDLE - 1, 0x04, WRITE_HANDLE, 0xFFF2)
    found += characteristic.pack(NOTIFY_HANDLE - 1, 0x10, NOTIFY_HANDLE, 0xFFF1)
    steps = (
        struct.pack(">I", RECEIVED) + b"\x04" + complete,
        _att(SENT, struct.pack("<BHHH", 0x08, 0x0001, 0xFFFF, 0x2803)),
        _att(RECEIVED, bytes((0x09, characteristic.size)) + found),
        _att(SENT, struct.pack("<BHHH", 0x08, NOTIFY_HANDLE, 0xFFFF, 0x2803)),
        _att(RECEIVED, struct.pack("<BBHB", 0x01, 0x08, NOTIFY_HANDLE, 0x0A)),
        _att(SENT, struct.pack("<BHH", 0x12, NOTIFY_HANDLE + 1, 1)),
        _att(RECEIVED, b"\x13"),
    )
    for left, packet in zip(range(len(steps), 0, -1), steps, strict=True):
        yield WirePacket(first_ns - left * _STEP_NS, packet)
