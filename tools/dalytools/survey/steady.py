# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes and numbers that go up or down evenly with the time: seconds since start, Unix time, and the like."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

from dalytools.survey.claim import Claim
from dalytools.survey.stream import NANO

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dalytools.survey.samples import Run
    from dalytools.survey.stream import Stream

_LEAST: Final = 16
_OFF: Final = 1.5
"""Counts that a value may be away from the line: one of its own step, half of the poll's moment."""
_TEN_YEARS_S: Final = 315_360_000


def steady(stream: Stream, pairs: Sequence[tuple[int, int]], counted: frozenset[int]) -> Iterator[Claim]:
    """Find what goes evenly with the time. pairs: bytes that are one number. counted: bytes that count polls."""
    inside = {index for first, last in pairs for index in range(first, last + 1)}
    single = [(index, index) for index in range(stream.place.size) if index not in inside | counted]
    for first, last in (*pairs, *single):
        if stream.moves.changed[last] < _LEAST:
            continue
        size = 8 * (last - first + 1)
        rate, count, changes = _rate(stream, first, last, size)
        if changes < _LEAST or rate == 0:
            continue
        text = f"goes {'up' if rate > 0 else 'down'} evenly with the time, by {abs(rate):.2g} a second"
        value = int.from_bytes(stream.last[first : last + 1])
        if size == 32 and abs(value - stream.last_ns / NANO) < _TEN_YEARS_S and 0.95 < rate < 1.05:
            text += ": Unix time"
        yield Claim("steady", first, last, text, count, 1.0)


def _rate(stream: Stream, first: int, last: int, bits: int) -> tuple[float, int, int]:
    """Return counts a second, how many values that is from, and how many changes; zeros where it is not even."""
    lines = [_unwrapped(run, stream.place.size, first, last, bits) for run in stream.samples.runs()]
    lines = [line for line in lines if len(line) > 2]
    spans = [(line[-1][0] - line[0][0], line[-1][1] - line[0][1]) for line in lines]
    length = sum(span for span, _ in spans)
    if length <= 0:
        return 0.0, 0, 0
    rise = sum(rise for _, rise in spans)
    rate = rise / length
    changes = 0
    for line in lines:
        start_s, start = line[0]
        if any(abs(value - start - rate * (time_s - start_s)) > _OFF for time_s, value in line):
            return 0.0, 0, 0
        changes += sum(a[1] != b[1] for a, b in pairwise(line))
    if abs(rise) < _LEAST:  # to and fro
        return 0.0, 0, 0
    return rate, sum(map(len, lines)), changes


def _unwrapped(run: Run, size: int, first: int, last: int, bits: int) -> list[tuple[float, int]]:
    """Return (time in s, value) with overruns taken out."""
    whole, out, before = 1 << bits, [(0.0, 0)], 0
    for place, time_ns in enumerate(run.times):
        at = place * size
        value = int.from_bytes(run.data[at + first : at + last + 1])
        if not place:
            before = value
            continue
        step = (value - before + whole // 2) % whole - whole // 2
        out.append(((time_ns - run.times[0]) / NANO, out[-1][1] + step))
        before = value
    return out
