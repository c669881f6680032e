# SPDX-License-Identifier: GPL-2.0-or-later
"""What is to be said of bytes that hold what another frame holds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools.survey.claim import Claim

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalytools.survey.mirrors import Candidate
    from dalytools.survey.stream import Stream

_LEAST: Final = 10
_VALUES: Final = 4
_SHARE: Final = 0.95


def copies(stream: Stream) -> Iterator[Claim]:
    """Find bytes that changed to what another place held, each time; neighbours that do so together are one claim.

    A neighbour that changed too seldom to be sure of by itself goes with one that is sure, if it never differed.
    """
    size, index = stream.place.size, 0
    while index < size:
        found = _widest(stream, index)
        if found is None:
            index += 1
            continue
        first, last, best = found
        source, shift = best.source.place, best.index - index
        where = f"{source.name} {source.bytes_name(first + shift, last + shift)}".removesuffix(" all")
        often = "each time" if not best.misses else f"{best.hits} of {best.hits + best.misses} times"
        text = f"changes to what {where} holds, {often}"
        if not shift and size == source.size == 8 and stream.place.direction == source.direction:
            text += "; the same place: left in the buffer?"
        yield Claim("mirror", first, last, text, best.hits, best.hits / (best.hits + best.misses))
        index = last + 1


def _widest(stream: Stream, index: int) -> tuple[int, int, Candidate[Stream]] | None:
    """Return the copy around a byte: the widest, then the best fit, then that at the same place, then the newest."""

    def fit(found: tuple[int, int, Candidate[Stream]]) -> tuple[int, int, bool, int]:
        first, last, one = found
        return last - first, one.hits - 20 * one.misses, one.index == index, -_age_ns(stream, one.source)

    sure = [one for one in stream.mirrors.of(index) if _is_sure(one)]
    return max(((*_stretch(stream, one, index), one) for one in sure), key=fit, default=None)


def _is_sure(one: Candidate[Stream]) -> bool:
    together = one.hits + one.misses
    return one.hits >= _LEAST and len(one.values) >= _VALUES and one.hits >= _SHARE * together


def _stretch(stream: Stream, sure: Candidate[Stream], index: int) -> tuple[int, int]:
    """Return first and last byte of a copy around one that is sure."""
    shift = sure.index - index
    first = last = index
    while first > 0 and _goes_with(stream, sure, first - 1, shift) is not None:
        first -= 1
    at = index + 1
    while at < stream.place.size and (moves := _goes_with(stream, sure, at, shift)) is not None:
        if moves:
            last = at
        at += 1
    while first < index and not stream.moves.changed[first]:
        first += 1
    return first, last


def _goes_with(stream: Stream, sure: Candidate[Stream], index: int, shift: int) -> bool | None:
    """Tell whether a neighbour is copied too: True it moves so, False both stand still and are equal, None no."""
    source = sure.source
    there = index + shift
    if not 0 <= there < source.place.size:
        return None
    if not stream.moves.changed[index]:
        still = not source.moves.changed[there] and source.last[there] == stream.last[index]
        return False if still else None
    good = any(
        one.source is source and one.index == there and one.misses <= sure.misses for one in stream.mirrors.of(index)
    )
    return True if good else None


def _age_ns(stream: Stream, source: Stream) -> int:
    """Return how long before this place's newest payload the other's came, as far as the last of each tell."""
    age = stream.last_ns - source.last_ns
    return age if age >= 0 else age + round(1e9 * stream.gaps.at(0.5))
