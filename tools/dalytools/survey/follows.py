# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes that move with a quantity that is understood.

Two series that both drift always look alike, so levels alone prove nothing: what is compared are the changes from one
payload to the next. A claim needs all of these (n: payloads at which one of the two changed):

- both changed at least 12 times, and 10 times together;
- the changes correlate with 0.6 or more, the levels with 0.8 or more;
- the ranks of the changes correlate so that, of all pairs that were looked at, one in a thousand surveys of bytes that
  have nothing to do with anything would show one such (Fisher's z, Bonferroni);
- where both go on smoothly, as the sun goes over a roof, their changes drift too: n counts for less by as much as the
  changes resemble those before (Bartlett), and the fourth differences, in which nothing is left of a smooth curve,
  correlate with 0.4 or more.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import atanh, isnan, sqrt
from operator import mul
from statistics import NormalDist
from typing import TYPE_CHECKING, Final

from dalytools.survey.claim import Claim
from dalytools.survey.known import COUNT, QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dalytools.survey.samples import Run
    from dalytools.survey.stream import Stream

LAGS: Final = range(-1, 9)
"""In payloads of the place that is looked at; -1: the quantity shows it in its next."""
_CHANGES, _TOGETHER = 12, 10
_CHANGE_R, _LEVEL_R = 0.6, 0.8
_CHANCE: Final = 0.001
_SHARP_R: Final = 0.4
_DISTANCES: Final = 12
_LAG_WINS: Final = 0.1
"""A delay is named where it fits the changes by so much better than none."""


@dataclass(frozen=True, slots=True)
class _Series:
    """Levels and changes of one series; one list a run."""

    levels: list[list[float]]
    changes: list[list[float]]

    @classmethod
    def of(cls, levels: list[list[float]]) -> _Series:
        return cls(levels, [[b - a for a, b in pairwise(run)] for run in levels])

    @property
    def moved(self) -> int:
        return sum(change != 0 for run in self.changes for change in run)


@dataclass(frozen=True, slots=True)
class _Found:
    first: int
    last: int
    quantity: int
    lag: int
    level: float
    change: float
    count: int


def follows(stream: Stream, looked_at: int, own: frozenset[int], pairs: Sequence[tuple[int, int]]) -> Iterator[Claim]:
    """Find the bytes, and the pairs of bytes, that move with a known quantity.

    looked_at: how many bytes of all places are held against quantities. own: quantities that this place itself tells.
    pairs: bytes that are known to be one number (first, last).
    """
    runs = [run for run in stream.samples.runs() if len(run.times) > 2 * len(LAGS)]
    if not runs:
        return
    quantities = _quantities(runs, own)
    if not quantities:
        return
    tests = max(1, looked_at) * len(QUANTITIES) * len(LAGS)
    limit = NormalDist().inv_cdf(1 - _CHANCE / (2 * tests))
    found: list[_Found] = []
    for first, last in _components(stream, pairs):
        series = _Series.of([_values(run, stream.place.size, first, last) for run in runs])
        if series.moved < _CHANGES:
            continue
        for quantity, told in quantities.items():
            one = _look(series, told, limit)
            if one is not None:
                found.append(_Found(first, last, quantity, *one))
    yield from _claims(found, stream.gaps.at(0.5))


def moving(stream: Stream) -> int:
    """Return how many bytes of a place moved often enough to be looked at."""
    return sum(changed >= _CHANGES for changed in stream.moves.changed)


def _components(stream: Stream, pairs: Sequence[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Give the bytes and numbers to look at: those known to be one number as such, else each byte and each two."""
    inside = {index for first, last in pairs for index in range(first, last + 1)}
    yield from pairs
    changed = stream.moves.changed
    for index in range(stream.place.size):
        if index in inside:
            continue
        if changed[index] >= _CHANGES:
            yield index, index
        if index + 1 < stream.place.size and index + 1 not in inside and changed[index] and changed[index + 1]:
            yield index, index + 1


def _values(run: Run, size: int, first: int, last: int) -> list[float]:
    data = run.data
    if first == last:
        return [float(value) for value in data[first::size]]
    return [float(int.from_bytes(data[at + first : at + last + 1])) for at in range(0, len(data), size)]


def _quantities(runs: Sequence[Run], own: frozenset[int]) -> dict[int, _Series]:
    """Return the quantities that moved, by number; before they were told for the first time, they stand still."""
    out: dict[int, _Series] = {}
    for quantity in range(COUNT):
        if quantity in own:
            continue
        levels = [list(run.known[quantity::COUNT]) for run in runs]
        told = next((value for run in levels for value in run if not isnan(value)), None)
        if told is None:
            continue
        series = _Series.of([[told if isnan(value) else value for value in run] for run in levels])
        if series.moved >= _CHANGES:
            out[quantity] = series
    return out


def _look(mine: _Series, told: _Series, limit: float) -> tuple[int, float, float, int] | None:
    """Hold a series against a quantity: (lag, correlation of levels, of changes, n), or None."""
    norm = sqrt(_square(mine.changes) * _square(told.changes))
    by_lag = {lag: _product(mine.changes, told.changes, lag) / norm for lag in LAGS}
    lag = max(LAGS, key=lambda one: (abs(by_lag[one]), -abs(one)))
    if abs(by_lag[lag]) - abs(by_lag[0]) < _LAG_WINS:
        lag = 0
    if abs(by_lag[lag]) < _CHANGE_R:
        return None
    change_pairs = [pair for pair in _pairs(mine.changes, told.changes, lag) if pair != (0.0, 0.0)]
    if sum(a != 0 and b != 0 for a, b in change_pairs) < _TOGETHER:
        return None
    level = _pearson(*_columns(_pairs(mine.levels, told.levels, lag)))
    if abs(level) < _LEVEL_R or level * by_lag[lag] < 0:
        return None
    ranked = _pearson(*(_ranks(column) for column in _columns(change_pairs)))
    if ranked * level < 0:
        return None
    if _sharp(mine.changes, told.changes, lag) * (1 if level > 0 else -1) < _SHARP_R:
        return None
    count = len(change_pairs) * _independent(mine.changes, told.changes)
    z = atanh(min(abs(ranked), 0.999999)) * sqrt(max(0.0, count - 3) / 1.06)
    if z < limit:
        return None
    return lag, level, by_lag[lag], len(change_pairs)


def _sharp(mine: list[list[float]], told: list[list[float]], lag: int) -> float:
    """Return the correlation of the fourth differences: nothing is left of a smooth curve in them, all of its steps."""
    one, other = mine, told
    for _ in range(3):
        one, other = ([[b - a for a, b in pairwise(run)] for run in runs] for runs in (one, other))
    norm = sqrt(_square(one) * _square(other))
    return _product(one, other, lag) / norm if norm else 0.0


def _independent(mine: list[list[float]], told: list[list[float]]) -> float:
    """Return which share of the changes counts as independent, 0 to 1 (Bartlett: by both series' likeness to themselves).

    What is summed up over many distances is what remains of a slow curve under the steps of its numbers.
    """
    longest = max(len(run) for run in mine)
    alike = 0.0
    norm = _square(mine) * _square(told)
    for distance in range(1, min(_DISTANCES, longest // 3) + 1):
        alike += _product(mine, mine, distance) * _product(told, told, distance) / norm
    return 1 / (1 + 2 * max(0.0, alike))


def _square(runs: list[list[float]]) -> float:
    return sum(sum(map(mul, run, run)) for run in runs)


def _shift(mine: list[float], told: list[float], lag: int) -> tuple[list[float], list[float]]:
    """Put what comes `lag` later beside what it may follow."""
    return (mine[lag:], told[: len(told) - lag]) if lag >= 0 else (mine[:lag], told[-lag:])


def _product(mine: list[list[float]], told: list[list[float]], lag: int) -> float:
    return sum(sum(map(mul, *_shift(a, b, lag))) for a, b in zip(mine, told, strict=True))


def _pairs(mine: list[list[float]], told: list[list[float]], lag: int) -> list[tuple[float, float]]:
    return [pair for a, b in zip(mine, told, strict=True) for pair in zip(*_shift(a, b, lag), strict=True)]


def _columns(pairs: list[tuple[float, float]]) -> tuple[list[float], list[float]]:
    return [a for a, _ in pairs], [b for _, b in pairs]


def _pearson(one: list[float], other: list[float]) -> float:
    count = len(one)
    if count < 3:
        return 0.0
    mean_one, mean_other = sum(one) / count, sum(other) / count
    a = [value - mean_one for value in one]
    b = [value - mean_other for value in other]
    norm = sqrt(sum(map(mul, a, a)) * sum(map(mul, b, b)))
    return sum(map(mul, a, b)) / norm if norm > 0 else 0.0


def _ranks(values: list[float]) -> list[float]:
    """Return the rank of each value; equal ones share the middle of their ranks."""
    order = sorted(range(len(values)), key=values.__getitem__)
    out = [0.0] * len(values)
    at = 0
    while at < len(order):
        end = at
        while end < len(order) and values[order[end]] == values[order[at]]:
            end += 1
        for place in range(at, end):
            out[order[place]] = (at + end - 1) / 2
        at = end
    return out


def _claims(found: list[_Found], poll_s: float) -> Iterator[Claim]:
    """Of overlapping bytes, keep those that fit best; name the best quantity, and those that do nearly as well."""
    by_bytes: dict[tuple[int, int], list[_Found]] = {}
    for one in found:
        by_bytes.setdefault((one.first, one.last), []).append(one)
    best = {where: max(ones, key=_fit) for where, ones in by_bytes.items()}
    # a pair must fit better than its bytes, or its lower byte is noise
    order = sorted(best, key=lambda where: (-_fit(best[where]) + (0.002 if where[0] != where[1] else 0.0), where))
    taken: set[int] = set()
    for where in order:
        inside = set(range(where[0], where[1] + 1))
        if inside & taken:
            continue
        taken |= inside
        one = best[where]
        also = [other for other in by_bytes[where] if other is not one and _fit(other) > 0.9 * _fit(one)]
        text = f"{'moves with' if one.level > 0 else 'moves against'} {QUANTITIES[one.quantity]}"
        if one.lag > 0:
            text += (
                f", {one.lag} polls later ({one.lag * poll_s:.3g} s)"
                if one.lag > 1
                else f", 1 poll later ({poll_s:.3g} s)"
            )
        text += f": r {one.level:+.2f}, of changes {one.change:+.2f}"
        if also:
            text += f"; {', '.join(QUANTITIES[other.quantity] for other in sorted(also, key=_fit, reverse=True))} too"
        yield Claim("follows", one.first, one.last, text, one.count, abs(one.level))


def _fit(one: _Found) -> float:
    return abs(one.level) * abs(one.change)
