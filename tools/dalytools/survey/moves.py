# SPDX-License-Identifier: GPL-2.0-or-later
"""What every byte of a series of payloads does: its values, its steps, the bits that flip, carries to its neighbour.

Exact over any number of payloads, in bounded memory: pairs of successive payloads are counted, and when there are many
different ones they are settled into tables of 256.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass
from typing import Final

_MOST_PAIRS: Final = 128
_BITS: Final = tuple(tuple(bit for bit in range(8) if value >> bit & 1) for value in range(256))


@dataclass(slots=True)
class Carries:
    """Whether a byte goes up and down when another one runs over: as two bytes of one number do."""

    steps: int = 0
    """How often the higher byte changed."""
    carries: int = 0
    """Of these: by one, with the lower byte running over in the fitting direction."""
    against: int = 0
    """Of these: by one, with the lower byte not running over so."""
    evidence: int = 0
    """Bits: what was seen is 2 to the so much less likely of bytes that have nothing to do with each other."""

    def take(self, high: int, low: int, times: int) -> None:
        """Take what the higher and the lower byte changed by (higher: not 0)."""
        self.steps += times
        if abs(high) != 1:
            return
        whole = abs(256 * high + low)
        if whole >= 256:
            self.against += times
            return
        self.carries += times
        self.evidence += times * (5 if whole <= 64 else 3 if whole <= 128 else 1)


class Moves:
    """Takes payload after payload, all of one length."""

    __slots__ = (
        "_last",
        "_pairs",
        "big",
        "changed",
        "count",
        "first",
        "flips",
        "little",
        "size",
        "steps",
        "values",
        "wraps",
    )

    def __init__(self, size: int) -> None:
        self.size = size
        self.count = 0
        """Payloads."""
        self.first = b""
        self._last = b""
        self._pairs: dict[tuple[bytes, bytes], int] = {}
        self.values: list[array[int]] = []
        """By byte: how often each of 256 values came. Empty until something moved."""
        self.steps: list[array[int]] = []
        """By byte: how often it went on by each step, modulo 256."""
        self.wraps = [0] * size
        """By byte: how often it ran over 255 or below 0, steps of up to 127 taken for small."""
        self.changed = [0] * size
        self.flips = [0] * (8 * size)
        """By byte and bit (bit 0 first): how often it flipped."""
        self.big = [Carries() for _ in range(size - 1)]
        """By byte: it as the higher, the next one as the lower."""
        self.little = [Carries() for _ in range(size - 1)]
        """By byte: it as the lower, the next one as the higher."""

    @property
    def last(self) -> bytes:
        """The newest payload."""
        return self._last

    def add(self, data: bytes) -> None:
        """Take the next payload."""
        self.count += 1
        if self.count == 1:
            self.first = self._last = data
            return
        pair = (self._last, data)
        pairs = self._pairs
        pairs[pair] = pairs.get(pair, 0) + 1
        self._last = data
        if len(pairs) > _MOST_PAIRS:
            self.settle()

    def settle(self) -> None:
        """Take what was counted into the tables: before they are read."""
        if not self.values and self._quiet():
            return
        if not self.values:
            self.values = [array("Q", bytes(2048)) for _ in range(self.size)]
            self.steps = [array("Q", bytes(2048)) for _ in range(self.size)]
            for index, value in enumerate(self.first):
                self.values[index][value] = 1
        for (before, after), times in self._pairs.items():
            self._take(before, after, times)
        self._pairs.clear()

    def _quiet(self) -> bool:
        return all(before == after for before, after in self._pairs)

    def _take(self, before: bytes, after: bytes, times: int) -> None:
        for index, (old, new) in enumerate(zip(before, after, strict=True)):
            self.values[index][new] += times
            self.steps[index][new - old & 0xFF] += times
            if old == new:
                continue
            self.changed[index] += times
            step = new - old
            if step > 127 or step < -127:
                self.wraps[index] += times
            for bit in _BITS[old ^ new]:
                self.flips[8 * index + bit] += times
            if index:
                self.little[index - 1].take(step, after[index - 1] - before[index - 1], times)
            if index + 1 < self.size:
                self.big[index].take(step, after[index + 1] - before[index + 1], times)

    def seen(self, index: int) -> dict[int, int]:
        """Return which values a byte had, each with how often."""
        if not self.values:
            return {self.first[index]: self.count} if self.count else {}
        return {value: times for value, times in enumerate(self.values[index]) if times}

    def stepped(self, index: int) -> dict[int, int]:
        """Return by how much a byte went on (modulo 256), each with how often."""
        if not self.steps:
            return {0: self.count - 1} if self.count > 1 else {}
        return {step: times for step, times in enumerate(self.steps[index]) if times}
