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
    from dalycapture.captured import CapturedPacket


@dataclass(slots=True, eq=False)
class Held:
    """A packet whose bytes are being decided."""

    packet: CapturedPacket
    data: bytearray
    undecided: int = 0
    """So many of its bytes belong to records that are not known yet."""


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
            if not self._pieces:
                raise OutOfStepError
            held, start, size = self._pieces.popleft()
            count = min(size, len(old) - at)
            if bytes(held.data[start : start + count]) != old[at : at + count]:
                raise OutOfStepError
            held.data[start : start + count] = new[at : at + count]
            held.undecided -= count
            at += count
            if count < size:
                self._pieces.appendleft((held, start + count, size - count))
