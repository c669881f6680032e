# SPDX-License-Identifier: GPL-2.0-or-later
"""Whether one series follows another: by their changes, and held against the same two series with other delays.

Two series that both drift look alike in their levels, two smooth curves also in their changes, and two that repeat
themselves alike at every turn. What these have in common: they look as much alike when one is shifted by any time. So

    changes of the bytes      ..|....|.|......|...|..        correlate at one delay, and at all the other shifts
    changes of the quantity   |....|.|......|...|....        of the one against the other they do not

A find needs all of these:

- both changed at least 12 times, and in 8 events or more of like size together (one great jump proves nothing);
- at some delay the changes correlate with 0.6 or more, and so do the levels, with 0.8 or more;
- at no shift that can't be a delay they do so two thirds as well, and all of these together so badly that chance would
  give one find in a thousand surveys (their spread taken as a normal distribution's, Bonferroni).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from operator import mul
from typing import Final

WHOLE: Final = range(-1, 9)
"""Delays that are tried, in payloads; and those half-way. -1: the quantity is told after the bytes."""
LEAST_CHANGES: Final = 12
MARGIN: Final = 13
"""Shifts as short as this may be delays, or what is left of them."""
LEAST_SHIFTS: Final = 30
LEAST: Final = 2 * MARGIN + LEAST_SHIFTS + 1
"""Payloads in a row that are needed."""
_MOST_SHIFTS: Final = 150
_EVENTS: Final = 8
_CHANGE_R, _LEVEL_R = 0.6, 0.8
_DELAY_WINS: Final = 0.1
"""A delay is named where it fits the changes by so much better than none."""
_STANDS_OUT: Final = 1.5

Runs = list[list[float]]


@dataclass(frozen=True, slots=True)
class Series:
    """Levels and changes of one series; one list a run of successive payloads."""

    levels: Runs
    changes: Runs

    @classmethod
    def of(cls, levels: Runs) -> Series:
        """Make a series of its levels."""
        return cls(levels, [[b - a for a, b in pairwise(run)] for run in levels])

    @property
    def moved(self) -> int:
        """Return how often it changed."""
        return sum(change != 0 for run in self.changes for change in run)

    def midway(self) -> Series:
        """Return the series half a payload later."""
        return Series.of([[(b + a) / 2 for a, b in pairwise([run[0], *run])] for run in self.levels])


@dataclass(frozen=True, slots=True)
class Likeness:
    """How one series follows another."""

    delay: float
    """In payloads."""
    level: float
    """Correlation of the levels."""
    change: float
    """Correlation of the changes."""
    count: int
    """Payloads at which one of the two changed."""


def follows(mine: Series, told: Series, midway: Series, limit: float) -> Likeness | None:
    """Find out whether a series follows another; None: it can't be said.

    midway: the other one half a payload later. limit: by how many standard deviations it has to stand out.
    """
    by_delay: dict[float, tuple[float, Series, int]] = {}
    for series, half in ((told, 0.0), (midway, 0.5)):
        norm = sqrt(_square(mine.changes) * _square(series.changes))
        for shift in WHOLE if not half else WHOLE[:-1]:
            by_delay[shift + half] = (_product(mine.changes, series.changes, shift) / norm, series, shift)
    delay = max(by_delay, key=lambda one: (abs(by_delay[one][0]), -abs(one)))
    nearest = round(delay)
    for simpler in (0, nearest):
        if abs(by_delay[delay][0]) - abs(by_delay[simpler][0]) < _DELAY_WINS:
            delay = simpler
            break
    change, series, shift = by_delay[delay]
    if abs(change) < _CHANGE_R:
        return None
    together = _pairs(mine.changes, series.changes, shift)
    products = [a * b for a, b in together]
    if sum(map(abs, products)) ** 2 < _EVENTS * sum(map(mul, products, products)):
        return None
    level = _pearson(_pairs(mine.levels, series.levels, shift))
    if abs(level) < _LEVEL_R or level * change < 0:
        return None
    if not _stands_out(abs(change), mine.changes, series.changes, limit):
        return None
    return Likeness(delay, level, change, sum(pair != (0.0, 0.0) for pair in together))


def _stands_out(found: float, mine: Runs, told: Runs, limit: float) -> bool:
    """Tell whether a correlation is none that other shifts, round and round, give too."""
    shortest = min(map(len, mine))
    shifts = range(MARGIN, shortest - MARGIN, max(1, (shortest - 2 * MARGIN) // _MOST_SHIFTS))
    if len(shifts) < LEAST_SHIFTS:
        return False
    norm = sqrt(_square(mine) * _square(told))
    others = [
        sum(sum(map(mul, a, b[shift:] + b[:shift])) for a, b in zip(mine, told, strict=True)) / norm for shift in shifts
    ]
    spread = sqrt(sum(map(mul, others, others)) / len(others))
    return found >= limit * spread and found >= _STANDS_OUT * max(map(abs, others))


def _square(runs: Runs) -> float:
    return sum(sum(map(mul, run, run)) for run in runs)


def _shift(mine: list[float], told: list[float], shift: int) -> tuple[list[float], list[float]]:
    """Put what comes `shift` later beside what it may follow."""
    return (mine[shift:], told[: len(told) - shift]) if shift >= 0 else (mine[:shift], told[-shift:])


def _product(mine: Runs, told: Runs, shift: int) -> float:
    return sum(sum(map(mul, *_shift(a, b, shift))) for a, b in zip(mine, told, strict=True))


def _pairs(mine: Runs, told: Runs, shift: int) -> list[tuple[float, float]]:
    return [pair for a, b in zip(mine, told, strict=True) for pair in zip(*_shift(a, b, shift), strict=True)]


def _pearson(pairs: list[tuple[float, float]]) -> float:
    count = len(pairs)
    mean_one, mean_other = sum(a for a, _ in pairs) / count, sum(b for _, b in pairs) / count
    one = [a - mean_one for a, _ in pairs]
    other = [b - mean_other for _, b in pairs]
    norm = sqrt(sum(map(mul, one, one)) * sum(map(mul, other, other)))
    return sum(map(mul, one, other)) / norm if norm > 0 else 0.0
