# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes that hold what another frame holds: copies, and what a board left in its buffer.

When a byte changes, its new value either stands in the newest payload of another place, at the same byte each time, or
it does not. What fits at the first few changes is a candidate; most go at the next change. One that changed while the
byte did not is not copied either: that would be a byte that follows it later.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterable

_LOOKED_FOR: Final = 4
"""New candidates are looked for at so many changes."""
_MOST: Final = 2000
_MOST_VALUES: Final = 32


class Source(Protocol):
    """A place whose bytes may be copied."""

    index: int
    """Its number among all."""
    last: bytes
    """Its newest payload."""


S = TypeVar("S", bound=Source)


@dataclass(slots=True)
class Candidate(Generic[S]):
    """A byte that may be the one that is copied."""

    source: S
    index: int
    hits: int = 0
    misses: int = 0
    """How often the two were different."""
    values: set[int] = field(default_factory=set[int])
    """Some of those with which it was equal."""


class Mirrors(Generic[S]):
    """Looks for the sources of every byte of one place."""

    __slots__ = ("_bytes", "_changes")

    def __init__(self, size: int) -> None:
        self._bytes: list[dict[tuple[int, int], Candidate[S]]] = [{} for _ in range(size)]
        self._changes = [0] * size

    def take(self, mine: S, before: bytes, after: bytes, others: Iterable[S]) -> None:
        """Take a payload, with the one before it. others: all places of the bus."""
        for index, value in enumerate(after):
            candidates, changed = self._bytes[index], before[index] != value
            if candidates:
                self._hold(candidates, value, changed=changed)
            if not changed:
                continue
            changes = self._changes[index] = self._changes[index] + 1
            if changes <= _LOOKED_FOR:
                self._look(candidates, mine, value, others, changes - 1)

    @staticmethod
    def _hold(candidates: dict[tuple[int, int], Candidate[S]], value: int, *, changed: bool) -> None:
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
        candidates: dict[tuple[int, int], Candidate[S]], mine: S, value: int, others: Iterable[S], missed: int
    ) -> None:
        for other in others:
            if other is mine or len(candidates) >= _MOST:
                continue
            index = other.last.find(value)
            while index >= 0:
                candidates.setdefault((other.index, index), Candidate(other, index, 1, missed, {value}))
                index = other.last.find(value, index + 1)

    def of(self, index: int) -> list[Candidate[S]]:
        """Return what a byte was found equal to."""
        return list(self._bytes[index].values())

    def changes(self, index: int) -> int:
        """Return how often a byte changed."""
        return self._changes[index]
