# SPDX-License-Identifier: GPL-2.0-or-later
"""Where the bytes of a record stand: in one packet, or in parts of several; and packets held until all are decided.

packet   |---- 13 ----|--- 7 ---|--------- 19 ---------|
record   |-- frame ---|---- frame ----|-- frame --|junk|
taken                  |-- 7 ---|- 6 -|
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalycapture.captured import CapturedPacket


@dataclass(slots=True, eq=False)
class Held:
    """A packet whose bytes are being decided."""

    packet: CapturedPacket
    data: bytearray
    undecided: int = 0
    """So many of its bytes belong to records that are not known yet."""
    close: Callable[[bytearray], None] | None = None
    """What is to be done when all bytes are decided: check sums."""
    gone: bool = False
    """It was given up: what is decided now comes too late."""


class OutOfStepError(Exception):
    """The records are not the bytes of the packets: a defect of the program."""


@dataclass(slots=True)
class Line:
    """One stream: the bytes that are in no record yet, in order."""

    _pieces: deque[tuple[Held, int, int]] = field(default_factory=deque["tuple[Held, int, int]"])

    def add(self, held: Held, start: int, size: int) -> None:
        """Put bytes of a packet behind those that are there."""
        held.undecided += size
        self._pieces.append((held, start, size))

    def replace(self, old: bytes, new: bytes) -> None:
        """Decide the next bytes: they are `old`, and become `new`. Raises OutOfStepError where they are not."""
        at = 0
        while at < len(old):
            held, start, count = self._next(len(old) - at)
            if held.packet.data[start : start + count] != old[at : at + count]:
                raise OutOfStepError
            if not held.gone:
                held.data[start : start + count] = new[at : at + count]
                held.undecided -= count
            at += count

    def move(self, size: int, other: Line) -> None:
        """Hand the next bytes over to another line. Raises OutOfStepError where there are not so many."""
        while size:
            held, start, count = self._next(size)
            other._pieces.append((held, start, count))
            size -= count

    def give_up(self, held: Held) -> None:
        """Blank what is undecided of a packet."""
        for one, start, size in self._pieces:
            if one is held:
                held.data[start : start + size] = bytes(size)

    def _next(self, most: int) -> tuple[Held, int, int]:
        """Take the next piece, or a part of it."""
        if not self._pieces:
            raise OutOfStepError
        held, start, size = self._pieces.popleft()
        if size > most:
            self._pieces.appendleft((held, start + most, size - most))
            return held, start, most
        return held, start, size
