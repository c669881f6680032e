# SPDX-License-Identifier: GPL-2.0-or-later
"""Records and events of several sides, in the order of time.

Each side's records come in order, but a side whose record is still under way, or whose adapter holds bytes back, may
yet bring an older one. So what came first is held until no other side can bring anything older::

    host   |== request ==|                      |== ...
    bms                       |== reply, under way
                              ^ horizon of bms: nothing that began before comes from it any more
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalycapture.framing import TimedRecord

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened, at a time of the same clock as the records'. side: on which interface it is told."""

    time_ns: int
    text: str
    side: int = 0


@dataclass(order=True, slots=True)
class _Held:
    time_ns: int
    number: int
    item: TimedRecord | Event = field(compare=False)


class Order:
    """What was heard and is not handed on yet."""

    def __init__(self) -> None:
        self._held: list[_Held] = []
        self._count = 0

    def __len__(self) -> int:
        return len(self._held)

    @property
    def oldest_ns(self) -> int | None:
        """Time of what is handed on next."""
        return self._held[0].time_ns if self._held else None

    def put(self, item: TimedRecord | Event) -> None:
        """Take a record or an event."""
        self._count += 1
        heapq.heappush(self._held, _Held(item.time_ns, self._count, item))

    def due(self, horizons: Sequence[int]) -> Iterator[TimedRecord | Event]:
        """Hand on, in order, what nothing older can come before any more.

        horizons: of each side, the time before which nothing begins that it may yet bring. A record's own side does not
        hold it back; an event waits for all.
        """
        while self._held:
            item = self._held[0].item
            own = item.side if isinstance(item, TimedRecord) else -1
            if any(horizon < item.time_ns for side, horizon in enumerate(horizons) if side != own):
                return
            yield heapq.heappop(self._held).item

    def rest(self) -> Iterator[TimedRecord | Event]:
        """Hand on all, in order: nothing more comes."""
        while self._held:
            yield heapq.heappop(self._held).item
