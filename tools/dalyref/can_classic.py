# SPDX-License-Identifier: GPL-2.0-or-later
"""Classic CAN: the eight data bytes of A5 under an identifier (docs/protocol.md, c.1; docs/wires.md, 2).

    bit   28 .. 24      23 .. 16        15 .. 8          7 .. 0
        |       18 (29 bits) | data ID | destination | source |

Board is 01 to 10; host is 20, 40 to 4F, 80. Who receives stands first.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from dalyref import addresses
from dalyref.message import Message, Route

if TYPE_CHECKING:
    from dalyref.packet import CanFrame

PAPER = range(0x90, 0x99)
"""Data IDs of the paper, which no other traffic was seen to carry between a board and a host."""
_NEVER = (0xF0, 0xF1)
"""Deye's, when board and host fit."""


def is_board(address: int) -> bool:
    """Tell a board's address."""
    return 0x01 <= address <= 0x10


def is_host(address: int) -> bool:
    """Tell the address of one that asks."""
    return address in (0x20, 0x80) or 0x40 <= address <= 0x4F


def fits(identifier: int) -> bool:
    """Tell whether an identifier has the shape of a classic frame, with any data ID."""
    destination, source = identifier >> 8 & 0xFF, identifier & 0xFF
    between = (is_board(destination) and is_host(source)) or (is_host(destination) and is_board(source))
    return between and identifier >> 24 == 0x18 and data_id(identifier) not in _NEVER


def data_id(identifier: int) -> int:
    """Return the data ID."""
    return identifier >> 16 & 0xFF


@cache
def _route(destination: int, source: int) -> Route:
    if is_host(source):
        return Route(True, 0, destination, destination, destination, addresses.host(source))
    return Route(False, source, source, host=addresses.host(destination))


def message(frame: CanFrame) -> Message:
    """Return what a frame says of which ``fits`` holds."""
    identifier = frame.identifier
    route = _route(identifier >> 8 & 0xFF, identifier & 0xFF)
    return Message(data_id(identifier), frame.data, route, identifier.to_bytes(4) + frame.data)
