# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes that are a date or a clock: year .. second as numbers or as BCD; and numbers that go on with the time."""

from __future__ import annotations

import statistics
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Final

from dalytools.survey.claim import Claim
from dalytools.survey.stream import NANO

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dalytools.survey.stream import Stream

_LEAST: Final = 12
_OFF_S: Final = 2.0


def clocks(stream: Stream) -> Iterator[Claim]:
    """Find clocks, and dates that do not move."""
    taken = -1
    for first in range(stream.place.size - 5):
        if first <= taken:
            continue
        for binary, words in ((True, "as numbers"), (False, "as BCD")):
            claim = _clock(stream, first, binary=binary, words=words)
            if claim is not None:
                yield claim
                taken = first + 5
                break
    for first in range(stream.place.size - 3):
        if first > taken and not any(stream.moves.changed[first : first + 4]):
            day = _long_date(stream.last[first : first + 4])
            if day:
                yield Claim("date", first, first + 3, f"date, as BCD: {day}", stream.count, 1.0)
                taken = first + 3


def _clock(stream: Stream, first: int, *, binary: bool, words: str) -> Claim | None:
    """Tell whether six bytes are year .. second: valid each time, and, where they move, as fast as the time."""
    size = stream.place.size
    moments: list[tuple[int, float]] = []
    for run in stream.samples.runs():
        for place, time_ns in enumerate(run.times):
            moment = _moment(run.data[place * size + first : place * size + first + 6], binary=binary)
            if moment is None:
                return None
            moments.append((time_ns, moment))
    if not moments:
        return None
    shown = f"{datetime.fromtimestamp(moments[-1][1], UTC):%Y-%m-%d %H:%M:%S}"
    if len({moment for _, moment in moments}) < _LEAST:
        if any(stream.moves.changed[first : first + 6]):
            return None  # moved, but too little to tell
        return Claim("date", first, first + 5, f"date and time, {words}: {shown}, stands still", stream.count, 1.0)
    offsets = [moment - time_ns / NANO for time_ns, moment in moments]
    middle = statistics.median(offsets)
    good = sum(abs(offset - middle) <= _OFF_S for offset in offsets)
    if good < 0.95 * len(offsets):
        return None
    text = f"clock, {words}: {shown} in the newest, goes with the time of the capture"
    return Claim("clock", first, first + 5, text, len(offsets), good / len(offsets))


def _moment(data: Sequence[int], *, binary: bool) -> float | None:
    numbers = list(data) if binary else [_bcd(value) for value in data]
    if not 20 <= numbers[0] <= 39:
        return None
    try:
        return datetime(2000 + numbers[0], *numbers[1:6], tzinfo=UTC).timestamp()
    except ValueError:
        return None


def _bcd(value: int) -> int:
    tens, ones = divmod(value, 16)
    return 10 * tens + ones if tens < 10 and ones < 10 else -1


def _long_date(data: bytes) -> str:
    """Read a date with its century, 20 24 03 15 in BCD; empty where it is none."""
    century, year, month, day = map(_bcd, data)
    if century != 20 or not 10 <= year <= 39:
        return ""
    try:
        return f"{datetime(2000 + year, month, day, tzinfo=UTC):%Y-%m-%d}"
    except ValueError:
        return ""
