# SPDX-License-Identifier: GPL-2.0-or-later
"""How a place is put in words: how often and how spaced, what a byte held, names beside bytes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalytools.survey.names import shortened

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalytools.survey.findings import Finding
    from dalytools.survey.stream import Stream


def spacing(stream: Stream) -> str:
    """Say how often it came, and how far apart: median, and what 5 % and 95 % do not exceed."""
    if stream.count < 2:
        return "once"
    gaps = stream.gaps
    if stream.count < 6:
        return f"{stream.count} times, {seconds(gaps.low)} to {seconds(gaps.high)} apart"
    middle, low, high = gaps.at(0.5), gaps.at(0.05), gaps.at(0.95)
    return f"{stream.count} times, every {seconds(middle)} (90 % within {seconds(low)} to {seconds(high)})"


def seconds(value: float) -> str:
    """Say a time, in ms below a second."""
    if value < 1:
        return f"{1000 * value:.3g} ms"
    return f"{value:.3g} s" if value < 1000 else f"{value:.0f} s"


def held(stream: Stream, index: int) -> tuple[str, str]:
    """Say what a byte held: its range in hex, and how many values that was (none for one)."""
    seen = stream.moves.seen(index)
    low, high = min(seen), max(seen)
    return (f"{low:02X}", "") if low == high else (f"{low:02X}-{high:02X}", str(len(seen)))


def named(finding: Finding) -> Iterator[tuple[int, int, str]]:
    """Give stretches of bytes with the same names: (first, last, names)."""
    first = 0
    all_names = finding.names
    for index in range(1, len(all_names) + 1):
        if index < len(all_names) and all_names[index] == all_names[first]:
            continue
        if all_names[first]:
            yield first, index - 1, shortened(all_names[first])
        first = index
