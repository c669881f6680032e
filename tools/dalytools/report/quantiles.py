# SPDX-License-Identifier: GPL-2.0-or-later
"""Quantiles of many times in little memory: a histogram whose bins grow by 1 %, so each answer is right within 1 %."""

from __future__ import annotations

import math
from collections import Counter

_GROWTH = math.log(1.01)
_LEAST_S = 1e-6


class Quantiles:
    """Times in seconds, from a microsecond on."""

    __slots__ = ("_bins", "count", "high", "low", "total")

    def __init__(self) -> None:
        self._bins: Counter[int] = Counter()
        self.count = 0
        self.total = self.low = self.high = 0.0

    def add(self, value: float) -> None:
        """Take one time, s."""
        self.low = value if not self.count else min(self.low, value)
        self.high = value if not self.count else max(self.high, value)
        self.count += 1
        self.total += value
        self._bins[math.floor(math.log(max(value, _LEAST_S)) / _GROWTH)] += 1

    def at(self, share: float) -> float:
        """Return the time that `share` (0..1) of all do not exceed, s; 0 where there is none."""
        wanted = share * self.count
        seen = 0
        for number, count in sorted(self._bins.items()):
            seen += count
            if seen >= wanted:
                return min(max(math.exp((number + 0.5) * _GROWTH), self.low), self.high)
        return self.high
