# SPDX-License-Identifier: GPL-2.0-or-later
"""Where a line is not to be drawn: over a time of which nothing is known.

values   ....      ....        every second, then not for an hour: no line between
values   .    .    .    .      once a minute: one line
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

_SHORTEST_S = 10.0
LONGER = 10
"""A gap is so many times as long as nine of ten steps."""


def gaps(times: Sequence[float]) -> list[int]:
    """Return the places of the values behind which a gap begins; times in seconds, ascending.

    A value alone between two gaps stays joined to one of its neighbours: alone it could not be seen.
    """
    steps = [later - earlier for earlier, later in pairwise(times)]
    longest = longest_step(times)
    found: list[int] = []
    for place, step in enumerate(steps):
        alone = place == 0 or found[-1:] == [place - 1] or place + 1 == len(steps)
        if step > longest and not alone and steps[place + 1] <= longest:
            found.append(place)
    return found


def longest_step(times: Sequence[float]) -> float:
    """Return the longest time between two values that is no gap, s."""
    steps = sorted(later - earlier for earlier, later in pairwise(times))
    return max(_SHORTEST_S, LONGER * steps[len(steps) * 9 // 10]) if steps else _SHORTEST_S


def broken(times: Sequence[float], values: Sequence[float]) -> tuple[list[float], list[float | None]]:
    """Return times and values with a None in each gap, where plotly.js lets the line end."""
    behind = set(gaps(times))
    shown: list[float] = []
    said: list[float | None] = []
    for place, (time, value) in enumerate(zip(times, values, strict=True)):
        shown.append(time)
        said.append(value)
        if place in behind:
            shown.append(time)
            said.append(None)
    return shown, said
