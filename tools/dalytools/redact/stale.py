# SPDX-License-Identifier: GPL-2.0-or-later
"""What a board may have left in bytes that it does not set (docs/protocol.md, fact 2).

Older boards answer out of one buffer of eight bytes: a byte that a reply does not set is the one that the reply before
had in the same place.

    57 (code)   | n | D  C  2  3  0  7  1 |     places 1 to 7: secret
    91          | 3 B 0 C 1 A |      - -   |    places 0 to 5 set; 6 and 7 still hold 7 1: blanked
    90          | all eight set            |    nothing secret is left
    91          | 3 B 0 C 1 A |      - -   |    6 and 7 are the SOC of the 90: kept
"""

from __future__ import annotations

from enum import Enum, auto
from typing import TYPE_CHECKING, Final

from dalytools.redact.a5_layout import SIZE

if TYPE_CHECKING:
    from collections.abc import Iterable

_MOST_BOARDS: Final = 4096


class Left(Enum):
    """What a place of the buffer holds."""

    HARMLESS = auto()
    SECRET = auto()
    UNSEEN = auto()
    """From before the capture."""


class Buffers:
    """The reply buffers of all boards of a capture, by any key that tells boards apart."""

    def __init__(self) -> None:
        self._buffers: dict[object, list[Left]] = {}
        self._new = [Left.UNSEEN] * SIZE

    def of(self, board: object) -> list[Left]:
        """Return a board's buffer, to look at and to change."""
        if len(self._buffers) >= _MOST_BOARDS and board not in self._buffers:
            self._buffers.clear()
            self._new = [Left.SECRET] * SIZE
        return self._buffers.setdefault(board, self._new.copy())

    def secret(self, places: Iterable[int] = range(SIZE)) -> None:
        """Note that a secret went over the wire outside a reply of A5: any board may have it there."""
        at = list(places)
        for buffer in (self._new, *self._buffers.values()):
            for place in at:
                buffer[place] = Left.SECRET
