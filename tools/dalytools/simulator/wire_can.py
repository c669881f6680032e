# SPDX-License-Identifier: GPL-2.0-or-later
"""The same exchange on CAN (field notes c.1), as Wireshark captures it on can0: link type SocketCAN (227).

    identifier   18 | data ID | destination | source      request 18 90 01 40, reply 18 90 40 01
    packet       identifier u32 with flags, high byte first | length u8 | 0 0 0 | up to 8 bytes

CAN repeats damaged frames by itself and hears no echo of itself: what was damaged on the serial pair is an error frame
here, and a sleeping board that would echo is silent. Only A5 travels on CAN in this dialect. Foreign frames with an
identifier (inverters) are heard here alone.
"""

from __future__ import annotations

import heapq
from typing import TYPE_CHECKING, Final

from dalycapture.interface import Interface
from dalytools.problem import Problem
from dalytools.simulator.board import FRAME_BYTES, HOST_PC, LENGTH, START
from dalytools.simulator.wire import WirePacket

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dalytools.simulator.scenario import Foreign, Scenario
    from dalytools.simulator.sent import Sent

SOCKETCAN: Final = 227
EXTENDED: Final = 0x8000_0000
ERROR: Final = 0x2000_0000
BUS_ERROR: Final = ERROR | 0x80  # CAN_ERR_BUSERROR of Linux's can/error.h
BITRATE: Final = 250_000
STANDARD_MOST: Final = 0x7FF


class CanWire:
    """An interface such as can0."""

    def __init__(self, scenario: Scenario) -> None:
        for host in scenario.hosts:
            if host.dialect != "a5":
                raise Problem(
                    f"host {host.name} speaks {host.dialect}, which CAN does not carry: --wire uart, ble or tcp"
                )
        self.interface = Interface("can0", "made by dalyshark simulate", SOCKETCAN, BITRATE)
        self._asker = HOST_PC
        self._foreign = heapq.merge(*(_repeated(foreign) for foreign in scenario.foreign if foreign.can_id is not None))
        self._next_foreign = next(self._foreign, None)

    def feed(self, piece: Sent) -> Iterable[WirePacket]:
        """Take one piece; foreign frames up to it, and its own."""
        yield from self._foreign_until(piece.time_ns)
        data = piece.data
        whole = len(data) == FRAME_BYTES and data[0] == START and data[3] == LENGTH
        if not whole or sum(data[:12]) & 0xFF != data[12]:
            if data[:1] == bytes((START,)):
                yield WirePacket(piece.time_ns, _frame(BUS_ERROR, bytes(8)))
            return
        address, data_id = data[1], data[2]
        if address >= 0x20:
            if piece.sender.startswith("board"):
                return  # an echo: nothing on CAN hears itself
            board, self._asker = _parties(address)
            destination, source = board, self._asker
        else:
            destination, source = self._asker, address
        yield WirePacket(
            piece.time_ns, _frame(EXTENDED | 0x18 << 24 | data_id << 16 | destination << 8 | source, data[4:12])
        )

    def finish(self, end_ns: int) -> Iterable[WirePacket]:
        """Hand out the foreign frames up to the end."""
        yield from self._foreign_until(end_ns)

    def _foreign_until(self, time_ns: int) -> Iterator[WirePacket]:
        while self._next_foreign is not None and self._next_foreign.time_ns <= time_ns:
            yield self._next_foreign
            self._next_foreign = next(self._foreign, None)


def _parties(address: int) -> tuple[int, int]:
    """Return the board and the host of a request's address byte: on CAN every host of 40 to 4F is 40."""
    if 0x40 <= address <= 0x4F:
        return address - 0x3F, HOST_PC
    return 1, address


def _frame(identifier: int, data: bytes) -> bytes:
    return identifier.to_bytes(4) + bytes((len(data), 0, 0, 0)) + data


def _repeated(foreign: Foreign) -> Iterator[WirePacket]:
    identifier = foreign.can_id or 0
    frame = _frame(identifier | (EXTENDED if identifier > STANDARD_MOST else 0), foreign.data)
    period, at = int(foreign.period_s * 1e9), int(foreign.start_s * 1e9)
    while True:
        yield WirePacket(at, frame)
        at += period
