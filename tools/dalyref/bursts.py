# SPDX-License-Identifier: GPL-2.0-or-later
"""Answers in several frames, numbered in data byte 0 (docs/records.md, section 8).

    request 95   reply 1   reply 2   reply 3   reply 4   reply 5   request 96 ...
                |<------------------ burst ----------------->|
                                                table (14 cells known), which the others link to

Numbers begin at 0 by the vendor's paper, at 1 on every device seen (field notes, fact 1).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Generic, TypeVar

from dalyref import cells, texts

if TYPE_CHECKING:
    from dalyref.values import Fields

IDS = frozenset((cells.CELLS, cells.TEMPERATURES, *texts.FIELDS))
INVALID = 0xFF
"""The frame number of a frame without content (paper, 95)."""

T = TypeVar("T")


@dataclass(slots=True, eq=False)
class Burst(Generic[T]):
    """A burst that has begun."""

    data_id: int
    address: int
    base: int
    """0 or 1: what its frames are counted from."""
    count: int
    """Cells or sensors known at its first frame, 0: not known."""
    request: int
    """Number of the request it answers, 0: none."""
    owner: T
    """The record of its last frame."""
    owner_number: int = 0
    """Packet of its last frame."""
    asked: int = 0
    """How many requests for this ID had been seen when its last frame came."""
    last: int = field(init=False)
    """Its last, which is its highest, frame number; before the first the number before its base."""
    end_ns: int = 0
    """End of its last frame."""
    open_until_ns: int = 0
    """It ends when a record begins later."""
    settled: bool = False
    """Its records, all that came so far, are final."""
    whole: bool = True
    """No number is missing so far."""
    parts: list[T] = field(default_factory=list[T])
    """Its records that are not linked to the whole yet, without those that carry it."""
    whole_in: int = 0
    """Packet of the record that carries the table or text, 0: none so far."""
    values: dict[int, tuple[int, ...]] = field(default_factory=dict[int, tuple[int, ...]])
    """Frame number to slots: of 95 in mV, of 96 as sent."""
    text: dict[int, bytes] = field(default_factory=dict[int, bytes])
    """Frame number to characters, of a text."""

    def __post_init__(self) -> None:
        self.last = self.base - 1

    def continues(self, data_id: int, address: int, start_ns: int, longest_ns: int) -> bool:
        """Tell whether a reply is of the same kind and near enough to go on with this burst."""
        return self.data_id == data_id and self.address == address and start_ns - self.end_ns <= longest_ns

    @property
    def needs_end(self) -> bool:
        """Tell whether what it carries as a whole is known only when it has ended."""
        return self.whole and not self.count

    @property
    def cut_off(self) -> bool:
        """Tell whether its last cell or sensor is known to be missing."""
        per_frame = cells.SLOTS.get(self.data_id, 0)
        return per_frame * (self.last - self.base + 1) < self.count

    def reaches_end(self, number: int) -> bool:
        """Tell whether frame `number` holds the last cell or sensor."""
        per_frame = cells.SLOTS[self.data_id]
        first = per_frame * (number - self.base) + 1
        return first <= self.count < first + per_frame

    def slots(self) -> list[int]:
        """Return all cells or sensors that were seen, those that are known not to be one left out."""
        seen = [slot for number in sorted(self.values) for slot in self.values[number]]
        return seen[: self.count] if self.count else seen

    def table(self) -> Fields:
        """Return the fields of the whole (all frames from the base on were seen)."""
        if self.data_id == cells.CELLS:
            return cells.table(self.slots())
        if self.data_id == cells.TEMPERATURES:
            return cells.sensor_table(self.slots())
        text = texts.whole(self.data_id, self.text)
        return {texts.FIELDS[self.data_id]: text} if text else {}


def skipped(data_id: int, number: int, base: int) -> bool:
    """Tell whether a frame is no part of any burst: invalid, or numbered beyond what its ID can have."""
    if number == INVALID:
        return True
    last = cells.LAST_FRAME.get(data_id)
    return last is not None and number > last - 1 + base
