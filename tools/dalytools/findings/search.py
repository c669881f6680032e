# SPDX-License-Identifier: GPL-2.0-or-later
"""All watches over one capture: feed it packets and records, then take what was found, worst first."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dalytools.findings.answers import Answers
from dalytools.findings.can_ids import CanIds
from dalytools.findings.effects import Effects
from dalytools.findings.limits import Limits
from dalytools.findings.misread import Misread
from dalytools.findings.replies import Replies
from dalytools.findings.requests import Requests
from dalytools.findings.values import Values
from dalytools.findings.wire import Wire
from dalytools.findings.written import Written

if TYPE_CHECKING:
    from dalyref.decoder import Decoded
    from dalyref.packet import Packet
    from dalytools.findings.finding import Finding
    from dalytools.findings.watch import Watch

_BUS_NAME = re.compile(r"bus=([^\s,;]+)")  # docs/records.md 5
_MOST_INTERFACES = 4096
_FOLLOWS = frozenset(("unanswered", "write-unconfirmed"))
"""They say ID by ID what another finding of the same severity may say once."""


class Search:
    """Finds what went wrong in one capture.

    Give it every packet before the records that end in it; whether all packets come first does not matter.
    """

    def __init__(self, limits: Limits | None = None) -> None:
        limits = limits or Limits()
        self._buses: dict[int, str] = {}  # by interface
        self._names: set[str] = set()
        self._watches: tuple[Watch, ...] = (
            Requests(),
            Replies(limits),
            Answers(),
            Values(),
            Misread(),
            Written(),
            Effects(),
            CanIds(),
            Wire(limits),
        )

    def packet(self, packet: Packet) -> None:
        """Take a packet."""
        if packet.interface not in self._buses and len(self._buses) < _MOST_INTERFACES:
            named = _BUS_NAME.search(packet.description)
            bus = f"bus {named[1]}" if named else f"interface {packet.interface}"
            self._buses[packet.interface] = bus
            self._names.add(bus)
        for watch in self._watches:
            watch.packet(packet)

    def record(self, record: Decoded) -> None:
        """Take a record."""
        bus = self._buses.get(record.interface, "") if len(self._names) > 1 else ""
        for watch in self._watches:
            watch.record(record, bus)

    def findings(self) -> list[Finding]:
        """Return what was found: the worst first, a cause before what follows from it, then in the capture's order."""
        out = [finding for watch in self._watches for finding in watch.findings()]
        return sorted(
            out,
            key=lambda finding: (
                -finding.severity,
                finding.rule in _FOLLOWS,
                finding.tally.first_packet,
                finding.rule,
            ),
        )
