# SPDX-License-Identifier: GPL-2.0-or-later
"""Small captures written by hand: frames at given milliseconds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref import a5
from dalyref.decoder import Decoded, Options, decode
from dalyref.packet import Packet

if TYPE_CHECKING:
    from dalyref.packet import Direction

EPOCH_NS = 1_700_000_000_000_000_000
FRAME_MS = 13 * 10 / 9.6
"""A frame on the wire: 13 characters of 10 bits at 9600 baud, 13.54 ms."""


def at(ms: float) -> int:
    return EPOCH_NS + round(ms * 1_000_000)


def frame(address: int, data_id: int, *content: int) -> bytes:
    """Return a frame whose data bytes are `content`, filled up with zeros."""
    return a5.build(address, data_id, bytes(content) + bytes(8 - len(content)))


class Capture:
    """A capture in the making: one packet a call."""

    def __init__(self) -> None:
        self.packets: list[Packet] = []

    def put(self, ms: float, data: bytes, interface: int = 0, description: str = "", side: Direction = "") -> int:
        """Add a packet that begins at `ms`; return its number."""
        number = len(self.packets) + 1
        self.packets.append(Packet(number, at(ms), data, interface, description, side))
        return number

    def read(self, options: Options | None = None) -> list[Decoded]:
        return list(decode(self.packets, options))

    def field(self, name: str) -> list[object]:
        """Return one field of all records, None where it is absent."""
        return [decoded.fields.get(name) for decoded in self.read()]
