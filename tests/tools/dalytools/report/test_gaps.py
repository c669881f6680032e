# SPDX-License-Identifier: GPL-2.0-or-later
"""No line is drawn over a time of which nothing is known; and none that is known is lost."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dalytools.report.gaps import broken, gaps

SECOND_BY_SECOND = [float(second) for second in range(20)]


@pytest.mark.parametrize(
    ("times", "behind"),
    [
        ([*SECOND_BY_SECOND, *(3600 + second for second in SECOND_BY_SECOND)], [19]),
        ([60.0 * minute for minute in range(30)], []),  # polled once a minute
        ([60.0 * (number // 3) + 0.2 * (number % 3) for number in range(90)], []),  # three at once, once a minute
        ([*SECOND_BY_SECOND, 28.0, 29.0], []),  # nine seconds are nothing
        ([*SECOND_BY_SECOND, 3600.0], []),  # one alone could not be seen
        ([0.0, 3600.0], []),
        ([], []),
    ],
)
def test_where_gaps_are(times: list[float], behind: list[int]) -> None:
    assert gaps(times) == behind


@given(st.lists(st.integers(0, 10_000), max_size=60))
def test_every_value_is_drawn_with_a_neighbour(given_times: list[int]) -> None:
    times = sorted(float(time) for time in given_times)
    shown, said = broken(times, times)
    assert [value for value in said if value is not None] == times
    assert len(shown) == len(said)
    runs = "".join(" " if value is None else "." for value in said).split()
    assert len(times) < 2 or min(map(len, runs)) > 1
