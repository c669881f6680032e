# SPDX-License-Identifier: GPL-2.0-or-later
"""What every family of rules has in common: it sees all packets and records, then says what it found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Generic, TypeVar

from dalytools.findings.limits import MOST_PLACES
from dalytools.findings.place import Place

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from dalyref.decoder import Decoded
    from dalyref.packet import Packet
    from dalytools.findings.finding import Finding

Group = TypeVar("Group")

OTHERS = Place(detail="others")


class Watch:
    """One family of rules, over one capture."""

    def packet(self, packet: Packet) -> None:
        """See a packet, before the records that end in it."""

    def record(self, record: Decoded, bus: str) -> None:
        """See a record. bus: its name, empty where the capture has one only."""

    def findings(self) -> Iterable[Finding]:
        """Say what was found, when all was seen."""
        return ()


class Groups(Generic[Group]):
    """Groups by place, a bounded number of them; the rest is one group."""

    def __init__(self, make: Callable[[], Group]) -> None:
        self._make = make
        self._groups: dict[Place, Group] = {}

    def __getitem__(self, place: Place) -> Group:
        group = self._groups.get(place)
        if group is None:
            if len(self._groups) >= MOST_PLACES and place is not OTHERS:
                return self[OTHERS]
            group = self._groups[place] = self._make()
        return group

    def items(self) -> Iterable[tuple[Place, Group]]:
        """Go through them, in the order in which they came up."""
        return self._groups.items()
