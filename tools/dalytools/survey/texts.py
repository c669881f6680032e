# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes that are letters."""

from __future__ import annotations

import string
from typing import TYPE_CHECKING, Final

from dalytools.survey.claim import Claim

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dalytools.survey.stream import Stream

_LEAST: Final = 6
_PLAIN: Final = frozenset((string.ascii_letters + string.digits + " _-./:").encode())


def texts(stream: Stream) -> Iterator[Claim]:
    """Find runs of bytes that never were anything but letters, digits and the signs of names."""
    moves = stream.moves
    fits = [moves.count > 0 and all(value in _PLAIN for value in moves.seen(index)) for index in range(moves.size)]
    for first, last in _stretches(fits):
        shown = stream.last[first : last + 1].decode("ascii")
        if _is_text(shown):
            moved = any(moves.changed[first : last + 1])
            yield Claim("text", first, last, f"text: {shown!r}{', newest' if moved else ''}", moves.count, 1.0)


def _stretches(fits: Sequence[bool]) -> Iterator[tuple[int, int]]:
    first = -1
    for index, good in enumerate((*fits, False)):
        if good and first < 0:
            first = index
        elif not good and first >= 0:
            if index - first >= _LEAST:
                yield first, index - 1
            first = -1


def _is_text(shown: str) -> bool:
    return len(set(shown)) >= 3 and sum(character.isalnum() for character in shown) >= 0.6 * len(shown)


def register_texts(streams: Sequence[Stream]) -> dict[int, Claim]:
    """Find texts that go over several registers, two characters each: by the number of the stream they begin in.

    streams: registers of one board, dialect and direction, in order of their numbers.
    """
    out: dict[int, Claim] = {}
    run: list[Stream] = []

    def end() -> None:
        shown = b"".join(stream.last for stream in run).decode("ascii", "replace")
        if len(shown) >= _LEAST and _is_text(shown):
            where = f"registers {run[0].place.number:04X} to {run[-1].place.number:04X}"
            text = f"{where}: text: {shown!r}"
            out[run[0].index] = Claim("text", 0, 1, text, min(stream.count for stream in run), 1.0)
        run.clear()

    for stream in streams:
        if run and stream.place.number != run[-1].place.number + 1:
            end()
        moves = stream.moves
        if moves.size == 2 and all(value in _PLAIN for index in (0, 1) for value in moves.seen(index)):
            run.append(stream)
        else:
            end()
    end()
    return out
