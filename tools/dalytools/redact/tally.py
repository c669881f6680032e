# SPDX-License-Identifier: GPL-2.0-or-later
"""What was blanked in a capture, counted."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from dalytools.redact.what import What

_MOST_ROWS: Final = 1024


@dataclass(slots=True)
class Row:
    """One kind of thing in one place."""

    records: int = 0
    bytes: int = 0
    _last: int = -1

    def add(self, record: int, count: int) -> None:
        """Count bytes of a record."""
        self.records += record != self._last
        self._last = record
        self.bytes += count


@dataclass(slots=True)
class Tally:
    """What was blanked. Call ``next_record`` before each record."""

    rows: dict[tuple[What, str], Row] = field(default_factory=dict["tuple[What, str]", Row])
    packets: int = 0
    records: int = 0
    interfaces: int = 0
    """Names, descriptions and hardware of so many were replaced."""
    comments: int = 0
    """So many were taken out."""
    blocks: int = 0
    """So many blocks that are no packets, but that Wireshark counts as such, were left out."""
    _record: int = 0

    def next_record(self) -> None:
        """Go on to the next record, or packet."""
        self._record += 1

    def blanked(self, what: What, where: str, count: int) -> None:
        """Count bytes that were blanked in the present record."""
        if (what, where) not in self.rows and len(self.rows) >= _MOST_ROWS:
            where = "elsewhere"
        self.rows.setdefault((what, where), Row()).add(self._record, count)
