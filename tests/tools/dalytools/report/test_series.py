# SPDX-License-Identifier: GPL-2.0-or-later
"""Thinning out keeps what a person would see: first, last, every extreme; quantiles are right within 1 %."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dalytools.report.quantiles import Quantiles
from dalytools.report.series import Counts, Series


@given(st.lists(st.tuples(st.floats(0, 5), st.floats(-1e6, 1e6)), min_size=1, max_size=300), st.integers(2, 20))
def test_extremes_first_and_last_are_kept_and_memory_is_bounded(steps: list[tuple[float, float]], most: int) -> None:
    series, time = Series(most), 0.0
    for step, value in steps:
        time += step
        series.add(time, value)
    times, values = series.points()
    given_values = [value for _, value in steps]
    assert len(values) <= 4 * 2 * most
    assert times == sorted(times)
    assert (min(values), max(values)) == (min(given_values), max(given_values)) == (series.low, series.high)
    assert values[-1] == given_values[-1]
    assert values[0] == given_values[0]


def test_a_spike_of_one_value_in_a_million_is_still_there() -> None:
    series = Series()
    for number in range(1_000_000):
        series.add(number * 0.0135, 5000.0 if number == 654_321 else 3300.0)
    times, values = series.points()
    (at,) = (time for time, value in zip(times, values, strict=True) if value == 5000.0)
    assert at == 654_321 * 0.0135
    assert len(values) < 9000


def test_a_short_series_is_shown_as_it_is() -> None:
    series = Series()
    for time, value in ((0.0, 1.0), (1.0, 5.0), (2.0, 2.0)):
        series.add(time, value)
    assert series.points() == ([0.0, 1.0, 2.0], [1.0, 5.0, 2.0])


def test_a_value_that_comes_back_at_once_is_the_last_one_too() -> None:
    series = Series()
    for value in (1.0, 0.0, 1.0):
        series.add(0.0, value)
    assert series.points() == ([0.0, 0.0, 0.0], [1.0, 0.0, 1.0])


def test_counts_lose_nothing_when_columns_are_joined() -> None:
    counts = Counts(most=4)
    for second in range(1000):
        counts.add(second, ("frame",) if second % 10 else ("frame", "junk"))
    columns = counts.columns()
    assert len(columns) <= 8
    assert sum(column["frame"] for _, column in columns) == 1000
    assert sum(column["junk"] for _, column in columns) == 100


@pytest.mark.parametrize("share", [0.5, 0.95, 0.99])
def test_quantiles_are_right_within_one_percent(share: float) -> None:
    r = random.Random(7)
    times = sorted(r.lognormvariate(-3, 0.6) for _ in range(20_000))
    quantiles = Quantiles()
    for time in times:
        quantiles.add(time)
    assert quantiles.at(share) == pytest.approx(times[int(share * len(times)) - 1], rel=0.011)
    assert (quantiles.low, quantiles.high, quantiles.count) == (times[0], times[-1], len(times))


@given(st.lists(st.tuples(st.integers(-4000, 4000), st.integers(-9, 9)), min_size=1, max_size=200), st.integers(2, 40))
def test_what_comes_out_of_order_is_drawn_in_order(given_values: list[tuple[int, int]], most: int) -> None:
    """Two captures of one time, or a clock that goes back: no line runs backwards, no extreme is lost."""
    series = Series(most)
    for time, value in given_values:
        series.add(time, value)
    times, values = series.points()
    assert times == sorted(times)
    assert (times[0], times[-1]) == (min(given_values)[0], max(given_values)[0])
    assert (min(values), max(values)) == (min(v for _, v in given_values), max(v for _, v in given_values))
    assert set(zip(times, values, strict=True)) <= set(given_values)
