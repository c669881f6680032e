# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes that hold what another frame holds: copies, and what a board left in its buffer.

When a byte changes, its new value either stands in the newest payload of another place, at the same byte each time, or
it does not. What fits at the first few changes is a candidate; most go at the next change. One that changed while the
byte did not is not copied either: that would be a byte that follows it later.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Generic

from dalytools.survey.newest import Source

if TYPE_CHECKING:
    from dalytools.survey.newest import Newest

_LOOKED_FOR: Final = 4
"""New candidates are looked for at so many changes."""
_TRIED: Final = 16
"""Or at the first so many, where most new values stand everywhere."""
_COMMON: Final = 300
"""A value that stands in more bytes than this tells nothing."""
_MOST_VALUES: Final = 32


@dataclass(slots=True)
class Candidate(Generic[Source]):
    """A byte that may be the one that is copied."""

    source: Source
    index: int
    hits: int = 0
    misses: int = 0
    """How often the two were different."""
    values: set[int] = field(default_factory=set[int])
    """Some of those with which it was equal."""


class Mirrors(Generic[Source]):
    """Looks for the sources of every byte of one place."""

    __slots__ = ("_bytes", "_changes", "_looked")

    def __init__(self, size: int) -> None:
        self._bytes: list[dict[tuple[int, int], Candidate[Source]]] = [{} for _ in range(size)]
        self._changes = [0] * size
        self._looked = [0] * size

    def take(self, mine: Source, before: bytes, after: bytes, newest: Newest[Source]) -> None:
        """Take a payload, with the one before it. newest: of all places of the bus."""
        for index, value in enumerate(after):
            candidates, changed = self._bytes[index], before[index] != value
            if candidates:
                self._hold(candidates, value, changed=changed)
            if not changed:
                continue
            changes = self._changes[index] = self._changes[index] + 1
            if self._looked[index] < _LOOKED_FOR and changes <= _TRIED and newest.count(value) <= _COMMON:
                self._looked[index] += 1
                self._look(candidates, mine, value, newest, changes - 1)

    @staticmethod
    def _hold(candidates: dict[tuple[int, int], Candidate[Source]], value: int, *, changed: bool) -> None:
        gone: list[tuple[int, int]] = []
        for key, candidate in candidates.items():
            if candidate.source.last[candidate.index] == value:
                if not changed:
                    continue
                candidate.hits += 1
                if len(candidate.values) < _MOST_VALUES:
                    candidate.values.add(value)
            else:
                candidate.misses += 1
                if 20 * (candidate.misses - 3) > candidate.hits:
                    gone.append(key)
        for key in gone:
            del candidates[key]

    @staticmethod
    def _look(
        candidates: dict[tuple[int, int], Candidate[Source]],
        mine: Source,
        value: int,
        newest: Newest[Source],
        missed: int,
    ) -> None:
        for other, index in newest.where(value):
            if other is not mine:
                candidates.setdefault((other.index, index), Candidate(other, index, 1, missed, {value}))

    def of(self, index: int) -> list[Candidate[Source]]:
        """Return what a byte was found equal to."""
        return list(self._bytes[index].values())

    def changes(self, index: int) -> int:
        """Return how often a byte changed."""
        return self._changes[index]
