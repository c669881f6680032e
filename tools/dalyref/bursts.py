# SPDX-License-Identifier: GPL-2.0-or-later
"""Answers in several frames, numbered in data byte 0 (docs/records.md, section 8).

    request 95   reply 1   reply 2   reply 3   reply 4   reply 5   request 96 ...
                |<------------------ burst ----------------->|
                                                table (14 cells known)

Numbers begin at 0 by the vendor's paper, at 1 on every device seen (field notes, fact 1).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Generic, TypeVar

from dalyref import cells

if TYPE_CHECKING:
    from dalyref.values import Fields

IDS = frozenset((cells.CELLS, cells.TEMPERATURES, 0x55, 0x56, 0x57, 0x62, 0x63, 0x6A))
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
    asked: int
    """How many requests for this ID had been seen when its last frame came."""
    last: int
    """Its last, which is its highest, frame number."""
    end_ns: int
    """End of its last frame."""
    owner: T
    """The record of its last frame."""
    whole: bool
    """No number is missing so far."""
    voltages: dict[int, tuple[int, ...]] = field(default_factory=dict[int, tuple[int, ...]])
    """95 only: frame number to slots, mV."""

    def continues(self, data_id: int, address: int, start_ns: int, longest_ns: int) -> bool:
        """Tell whether a reply is of the same kind and near enough to go on with this burst."""
        return self.data_id == data_id and self.address == address and start_ns - self.end_ns <= longest_ns

    @property
    def needs_end(self) -> bool:
        """Tell whether the table is known only when the burst has ended."""
        return self.data_id == cells.CELLS and self.whole and not self.count

    def table(self) -> Fields:
        """Return the ``daly.cells.*`` fields of what was seen (all frames from the base on were)."""
        voltages = [slot for number in sorted(self.voltages) for slot in self.voltages[number]]
        return cells.table(voltages[: self.count] if self.count else voltages)


def skipped(data_id: int, number: int, base: int) -> bool:
    """Tell whether a frame is no part of any burst: invalid, or numbered beyond what its ID can have."""
    if number == INVALID:
        return True
    last = cells.LAST_FRAME.get(data_id)
    return last is not None and number > last - 1 + base
