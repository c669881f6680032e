# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes, and numbers of two bytes, that move with a quantity that is understood (how that is found out: ``alike``)."""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan
from statistics import NormalDist
from typing import TYPE_CHECKING, Final

from dalytools.survey import alike
from dalytools.survey.claim import Claim
from dalytools.survey.known import COUNT, QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dalytools.survey.alike import Likeness
    from dalytools.survey.samples import Run
    from dalytools.survey.stream import Stream

_CHANCE: Final = 0.001


@dataclass(frozen=True, slots=True)
class _Found:
    first: int
    last: int
    quantity: int
    likeness: Likeness

    @property
    def fit(self) -> float:
        return abs(self.likeness.level * self.likeness.change)


def follows(stream: Stream, looked_at: int, own: frozenset[int], pairs: Sequence[tuple[int, int]]) -> Iterator[Claim]:
    """Find the bytes, and the pairs of bytes, that move with a known quantity.

    looked_at: how many bytes of all places are held against quantities. own: quantities that this place itself tells.
    pairs: bytes that are known to be one number (first, last).
    """
    runs = stream.samples.runs()
    if len(runs) > 1:  # all of one length
        runs = [run for run in runs if len(run.times) == len(runs[0].times)]
    if not runs or len(runs[0].times) < alike.LEAST:
        return
    quantities = _quantities(runs, own)
    if not quantities:
        return
    tests = max(1, looked_at) * len(QUANTITIES) * 2 * len(alike.WHOLE)
    limit = NormalDist().inv_cdf(1 - _CHANCE / (2 * tests))
    found: list[_Found] = []
    for first, last in _components(stream, pairs):
        series = alike.Series.of([_values(run, stream.place.size, first, last) for run in runs])
        if series.moved < alike.LEAST_CHANGES:
            continue
        for quantity, (told, midway) in quantities.items():
            likeness = alike.follows(series, told, midway, limit)
            if likeness is not None:
                found.append(_Found(first, last, quantity, likeness))
    yield from _claims(found, stream.gaps.at(0.5))


def moving(stream: Stream) -> int:
    """Return how many bytes of a place moved often enough to be looked at."""
    return sum(changed >= alike.LEAST_CHANGES for changed in stream.moves.changed)


def _components(stream: Stream, pairs: Sequence[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Give the bytes and numbers to look at: those known to be one number as such, else each byte and each two."""
    inside = {index for first, last in pairs for index in range(first, last + 1)}
    yield from pairs
    changed = stream.moves.changed
    for index in range(stream.place.size):
        if index in inside:
            continue
        if changed[index] >= alike.LEAST_CHANGES:
            yield index, index
        if index + 1 < stream.place.size and index + 1 not in inside and changed[index] and changed[index + 1]:
            yield index, index + 1


def _values(run: Run, size: int, first: int, last: int) -> list[float]:
    data = run.data
    if first == last:
        return [float(value) for value in data[first::size]]
    return [float(int.from_bytes(data[at + first : at + last + 1])) for at in range(0, len(data), size)]


def _quantities(runs: Sequence[Run], own: frozenset[int]) -> dict[int, tuple[alike.Series, alike.Series]]:
    """Return the quantities that moved, by number, and half a payload later.

    Before it was told for the first time, a quantity stands still.
    """
    out: dict[int, tuple[alike.Series, alike.Series]] = {}
    for quantity in range(COUNT):
        if quantity in own:
            continue
        levels = [list(run.known[quantity::COUNT]) for run in runs]
        first = next((value for run in levels for value in run if not isnan(value)), None)
        if first is None:
            continue
        series = alike.Series.of([[first if isnan(value) else value for value in run] for run in levels])
        if series.moved >= alike.LEAST_CHANGES:
            out[quantity] = (series, series.midway())
    return out


def _claims(found: list[_Found], poll_s: float) -> Iterator[Claim]:
    """Of overlapping bytes, keep those that fit best; name the best quantity, and those that do nearly as well."""
    by_bytes: dict[tuple[int, int], list[_Found]] = {}
    for one in found:
        by_bytes.setdefault((one.first, one.last), []).append(one)
    best = {where: max(ones, key=lambda one: one.fit) for where, ones in by_bytes.items()}
    # a pair must fit better than its bytes, or its lower byte is noise
    order = sorted(best, key=lambda where: (-best[where].fit + (0.002 if where[0] != where[1] else 0.0), where))
    taken: set[int] = set()
    for where in order:
        inside = set(range(where[0], where[1] + 1))
        if inside & taken:
            continue
        taken |= inside
        one = best[where]
        also = sorted((other for other in by_bytes[where] if other is not one), key=lambda other: -other.fit)
        names = [QUANTITIES[other.quantity] for other in also if other.fit > 0.9 * one.fit]
        yield _claim(one, names, poll_s)


def _claim(one: _Found, also: Sequence[str], poll_s: float) -> Claim:
    likeness = one.likeness
    text = f"{'moves with' if likeness.level > 0 else 'moves against'} {QUANTITIES[one.quantity]}"
    if likeness.delay > 0:
        polls = "1 poll" if likeness.delay == 1 else f"{likeness.delay:g} polls"
        text += f", {polls} later ({likeness.delay * poll_s:.2g} s)"
    text += f": r {likeness.level:+.2f}, of changes {likeness.change:+.2f}"
    if also:
        text += f"; {', '.join(also)} too"
    return Claim("follows", one.first, one.last, text, likeness.count, abs(likeness.level))
