# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about CAN as such: not-polled, whose frames those are (field notes, c.1 and c.3), and line-errors."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalycapture import socketcan
from dalyref import can_foreign
from dalytools.findings.finding import Tally
from dalytools.findings.place import Place
from dalytools.findings.rules import found
from dalytools.findings.watch import Watch
from dalytools.terminal_text import counted
from dalytools.wires.carriers import SOCKETCAN

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalyref.packet import Packet
    from dalytools.findings.finding import Finding

_LEAST = 3
"""Fewer frames say nothing about a bus."""
_MOST_IDS, _MOST_SHOWN = 256, 12
_ERRORS = "compare the bit rates (Daly: 250 kbit/s); check both 120 ohm terminations, ground and cable"


@dataclass(slots=True)
class _Owner:
    frames: int = 0
    ids: dict[str, None] = field(default_factory=dict[str, None])


class CanIds(Watch):
    """Counts identifiers by whose they are, and whether anything was Daly's."""

    def __init__(self) -> None:
        self._all = Tally()
        self._errors = Tally()
        self._owners: dict[str, _Owner] = {}
        self._ours = False

    def packet(self, packet: Packet) -> None:
        """Count a CAN frame."""
        if packet.link_type != SOCKETCAN:
            return
        if int.from_bytes(packet.data[:4].ljust(4, b"\0")) & socketcan.ERROR:
            self._errors.add(packet.number, packet.time_ns)
            return
        frame = socketcan.unpack(packet.data)
        if frame is None:
            return
        self._all.add(packet.number, packet.time_ns)
        name = can_foreign.name(frame.identifier, extended=frame.extended) or "unknown"
        owner = self._owners.setdefault(name, _Owner())
        owner.frames += 1
        if len(owner.ids) < _MOST_IDS:
            owner.ids[f"{frame.identifier:08X}" if frame.extended else f"{frame.identifier:03X}"] = None

    def record(self, record: Decoded, bus: str) -> None:
        """See whether Daly's dialects are spoken at all."""
        del bus
        self._ours = self._ours or (record.transport == "can" and "daly.direction" in record.fields)

    def findings(self) -> Iterator[Finding]:
        """Say whose frames they are, if nobody asked a board of Daly's; and how many errors the controller saw."""
        if self._errors.count:
            text = f"{counted(self._errors.count, 'error frame')}: the CAN controller saw errors on the bus"
            yield found("line-errors", Place(detail="CAN"), self._errors, text, advice=_ERRORS)
        if self._ours or self._all.count < _LEAST:
            return
        said = [
            f"{counted(owner.frames, 'frame')} of {name} ({_listed(owner.ids)})" for name, owner in self._owners.items()
        ]
        text = f"nobody asks: no frame of {self._all.count} is a request to a Daly board, or of one; {'; '.join(said)}"
        yield found("not-polled", Place(detail="CAN"), self._all, text)


def _listed(ids: dict[str, None]) -> str:
    shown = sorted(ids)
    return ", ".join(shown[:_MOST_SHOWN]) + (
        f" and {len(shown) - _MOST_SHOWN} more" if len(shown) > _MOST_SHOWN else ""
    )
