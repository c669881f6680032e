# SPDX-License-Identifier: GPL-2.0-or-later
"""A UART in bits: what a receiver makes of a line at another speed, another format, or with its wires swapped."""

from __future__ import annotations

from bisect import bisect_right
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable


class Line:
    """Levels over time. Idle is high."""

    def __init__(self) -> None:
        self._edges: list[float] = [0.0]  # times in s, rising
        self._levels: list[int] = [1]
        self.now = 0.01

    def _set(self, level: int) -> None:
        if self._levels[-1] != level:
            self._edges.append(self.now)
            self._levels.append(level)

    def send(self, data: bytes, baud: int, parity: str = "N") -> None:
        """Put bytes on it, back to back, then 30 ms of idle."""
        for byte in data:
            bits = [0, *(byte >> number & 1 for number in range(8))]
            if parity != "N":
                bits.append((byte.bit_count() + (parity == "O")) % 2)
            for bit in (*bits, 1):
                self._set(bit)
                self.now += 1 / baud
        self.now += 0.03

    def level(self, at: float, *, swapped: bool) -> int:
        """Level at this time."""
        return self._levels[bisect_right(self._edges, at) - 1] ^ swapped

    def falls(self, after: float, *, swapped: bool) -> float | None:
        """When the level next goes from high to low."""
        for index in range(bisect_right(self._edges, after), len(self._edges)):
            if self._levels[index] ^ swapped == 0:
                return self._edges[index]
        return None

    def received(self, baud: int, parity: str = "N", *, swapped: bool = False) -> Iterable[tuple[int, bool]]:
        """Yield (byte, whether it was bad: no stop bit, or wrong parity)."""
        at = 0.0
        while (start := self.falls(at, swapped=swapped)) is not None:
            bits = [self.level(start + (number + 1.5) / baud, swapped=swapped) for number in range(8)]
            value = sum(bit << number for number, bit in enumerate(bits))
            bad = False
            stop_at = start + 9.5 / baud
            if parity != "N":
                bad = self.level(stop_at, swapped=swapped) != (value.bit_count() + (parity == "O")) % 2
                stop_at += 1 / baud
            bad = bad or not self.level(stop_at, swapped=swapped)
            yield value, bad
            at = stop_at
