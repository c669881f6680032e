# SPDX-License-Identifier: GPL-2.0-or-later
"""All payloads of one place: how often they come, and what their bytes do."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalytools.report.quantiles import Quantiles
from dalytools.survey.mirrors import Mirrors
from dalytools.survey.moves import Moves
from dalytools.survey.samples import Samples

if TYPE_CHECKING:
    from array import array

    from dalytools.survey.newest import Newest
    from dalytools.survey.place import Place

NANO = 1_000_000_000


class Stream:
    """One place."""

    __slots__ = ("first_ns", "gaps", "index", "last", "last_ns", "mirrors", "moves", "place", "samples", "unknown")

    def __init__(self, place: Place, index: int) -> None:
        self.place = place
        self.index = index
        """Its number among all."""
        self.moves = Moves(place.size)
        self.mirrors: Mirrors[Stream] = Mirrors(place.size)
        self.samples = Samples()
        self.gaps = Quantiles()
        """From one to the next, s."""
        self.first_ns = self.last_ns = 0
        self.last = b""
        """The newest payload."""
        self.unknown = False
        """The reference says that no source knows its ID."""

    @property
    def count(self) -> int:
        """How many payloads there were."""
        return self.moves.count

    def add(self, time_ns: int, data: bytes, known: array[float], newest: Newest[Stream]) -> None:
        """Take the next payload. known: of the battery, at this moment. newest: of all places of the bus."""
        if self.moves.count:
            self.gaps.add(max(0, time_ns - self.last_ns) / NANO)
            self.mirrors.take(self, self.last, data, newest)
        else:
            self.first_ns = time_ns
        self.last_ns = time_ns
        if data != self.last or not self.moves.count:
            self.last = data
            newest.put(self)
        self.moves.add(data)
        if data:
            self.samples.add(time_ns, data, known)
