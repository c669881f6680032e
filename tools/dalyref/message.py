# SPDX-License-Identifier: GPL-2.0-or-later
"""What an A5 frame says and who says it, whichever wire it came over: a serial frame or a classic CAN frame.

          who asks whom                        what
serial    A5 | address |                       data ID | 08 | eight bytes | sum
CAN       18 | data ID | destination | source  ->            the same eight bytes
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from dalyref import addresses


@dataclass(frozen=True, slots=True)
class Route:
    """Who speaks to whom. A board of 0 is not known."""

    asks: bool
    """A host's request; else a board's reply."""
    address: int
    """Of a reply: the byte by which its board is remembered."""
    board: int
    """The board that is asked or that answers."""
    named: int = 0
    """Of a request: the board it names."""
    only: int = 0
    """Of a request: the one board whose reply it takes."""
    host: int = 0
    """Who asks; of a reply who is told, 0: any (a serial frame does not say)."""


class Message(NamedTuple):
    """One frame."""

    data_id: int
    content: bytes
    """The data bytes: eight, on CAN also fewer."""
    route: Route
    same: bytes
    """All of it: what is equal when a request comes again."""

    @property
    def whole(self) -> bool:
        """Tell whether it has all eight data bytes: else they have no meaning."""
        return len(self.content) == 8


def _serial_route(address: int) -> Route:
    board = addresses.board(address)
    if not addresses.is_request(address):
        return Route(False, address, board)
    return Route(
        True, address, board, addresses.named_board(address), addresses.only_board(address), addresses.host(address)
    )


_SERIAL = tuple(map(_serial_route, range(256)))


def from_serial(data: bytes) -> Message:
    """Return what the 13 bytes of an A5 frame say (docs/records.md, section 5)."""
    return Message(data[2], data[4:12], _SERIAL[data[1]], data)
