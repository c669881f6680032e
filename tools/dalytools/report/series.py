# SPDX-License-Identifier: GPL-2.0-or-later
"""Values over time in bounded memory, for drawing: what does not fit is thinned out, its extremes kept.

    time      |----|----|----|----|----|----|            pieces of equal length; too many: two become one
    a piece   first value, lowest, highest, last, each with its own time

A line through these looks as the line through all values would, at the width of a screen: a spike of one value is
still there.
"""

from __future__ import annotations

from array import array
from collections import Counter

_MOST_PIECES = 1000
_SHORTEST_S = 0.001
_WORDS = 9  # number of the piece, then time and value of first, lowest, highest, last


class Series:
    """One quantity. Times in seconds, mostly ascending; one that steps back stands where it belongs."""

    __slots__ = ("_length", "_most", "_pieces", "count", "high", "low")

    def __init__(self, most: int = _MOST_PIECES) -> None:
        self._most = most
        self._length = _SHORTEST_S
        self._pieces = array("d")
        self.count = 0
        """How many values were added."""
        self.low = self.high = 0.0

    def add(self, time: float, value: float) -> None:
        """Take the next value."""
        self.low = value if not self.count else min(self.low, value)
        self.high = value if not self.count else max(self.high, value)
        self.count += 1
        pieces, number = self._pieces, time // self._length
        after = len(pieces)
        if pieces and number <= pieces[-_WORDS]:
            after = self._behind(number)
            if after and pieces[after - _WORDS] == number:
                _join(pieces, after - _WORDS, (time, value, time, value, time, value, time, value))
                return
        pieces[after:after] = array("d", (number, time, value, time, value, time, value, time, value))
        while len(pieces) > 2 * self._most * _WORDS:
            self._halve()
            pieces = self._pieces

    def _behind(self, number: float) -> int:
        """Return where the first piece begins whose number is greater; the newest are looked at first."""
        pieces = self._pieces
        low, high = 0, len(pieces) // _WORDS - 1
        if number == pieces[-_WORDS]:
            return len(pieces)
        while low < high:
            middle = (low + high) // 2
            if pieces[middle * _WORDS] > number:
                high = middle
            else:
                low = middle + 1
        return low * _WORDS

    def _halve(self) -> None:
        """Make pieces twice as long."""
        self._length *= 2
        old, new = self._pieces, array("d")
        for at in range(0, len(old), _WORDS):
            number = old[at] // 2
            if new and new[-_WORDS] == number:
                _join(new, len(new) - _WORDS, tuple(old[at + 1 : at + _WORDS]))
            else:
                new.append(number)
                new.extend(old[at + 1 : at + _WORDS])
        self._pieces = new

    def points(self) -> tuple[list[float], list[float]]:
        """Return times and values of the line to draw, in the order of time."""
        times: list[float] = []
        values: list[float] = []
        pieces = self._pieces
        for at in range(0, len(pieces), _WORDS):
            some = {(pieces[at + i], pieces[at + i + 1]) for i in (3, 5)}
            first, last = (pieces[at + 1], pieces[at + 2]), (pieces[at + 7], pieces[at + 8])
            between = sorted(some - {first, last})
            for time, value in (first, *between, *([last] if between or last != first else [])):
                times.append(time)
                values.append(value)
        return times, values


def _join(pieces: array[float], at: int, other: tuple[float, ...]) -> None:
    """Join what else there was (first, lowest, highest, last; time and value each) to the piece that begins at `at`."""
    first_time, first, low_time, low, high_time, high, last_time, last = other
    if first_time < pieces[at + 1]:
        pieces[at + 1], pieces[at + 2] = first_time, first
    if low < pieces[at + 4]:
        pieces[at + 3], pieces[at + 4] = low_time, low
    if high > pieces[at + 6]:
        pieces[at + 5], pieces[at + 6] = high_time, high
    if last_time >= pieces[at + 7]:
        pieces[at + 7], pieces[at + 8] = last_time, last


class Counts:
    """How often each of a few names came, over time."""

    __slots__ = ("_columns", "_length", "_most")

    def __init__(self, most: int = 300) -> None:
        self._most = most
        self._length = 1.0
        self._columns: dict[int, Counter[str]] = {}

    def add(self, time: float, names: tuple[str, ...]) -> None:
        """Count names at a time (s)."""
        number = int(time // self._length)
        column = self._columns.get(number)
        if column is None:
            column = self._columns[number] = Counter()
            while len(self._columns) > 2 * self._most:
                self._halve()
                column = self._columns.setdefault(int(time // self._length), Counter())
        column.update(names)

    def _halve(self) -> None:
        self._length *= 2
        old, self._columns = self._columns, {}
        for number, column in old.items():
            self._columns.setdefault(number // 2, Counter()).update(column)

    @property
    def length(self) -> float:
        """How long a column is, s."""
        return self._length

    def columns(self) -> list[tuple[float, Counter[str]]]:
        """Return when each column begins (s), and what came in it; columns in which nothing came are left out."""
        return [(number * self._length, column) for number, column in sorted(self._columns.items())]
