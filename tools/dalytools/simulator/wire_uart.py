# SPDX-License-Identifier: GPL-2.0-or-later
"""The serial pair as ``dalyshark capture`` writes it: one packet a record, raw bytes, link type USER0 (DESIGN 4)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalycapture.framing import Framer
from dalycapture.interface import tap
from dalycapture.sniffer import ERROR_FLAGS
from dalytools.simulator.bus import BITS_A_BYTE
from dalytools.simulator.wire import WirePacket

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dalycapture.framing import TimedRecord
    from dalytools.simulator.scenario import Scenario
    from dalytools.simulator.sent import Sent


class UartWire:
    """A tap on the pair that delivers each piece when its last byte has ended."""

    def __init__(self, scenario: Scenario) -> None:
        self.interface = tap("simulated", baud=scenario.baud, facts=["made by dalyshark simulate"])
        self._char_ns = BITS_A_BYTE * 1_000_000_000 / scenario.baud
        self._framer = Framer(scenario.baud)

    def feed(self, piece: Sent) -> Iterable[WirePacket]:
        """Take one piece; the records that are complete now."""
        end_ns = piece.time_ns + round(len(piece.data) * self._char_ns)
        return map(_packet, self._framer.feed(piece.data, end_ns))

    def finish(self, end_ns: int) -> Iterable[WirePacket]:  # noqa: ARG002 - a tap knows no end
        """Hand out what is incomplete."""
        return map(_packet, self._framer.flush())


def _packet(timed: TimedRecord) -> WirePacket:
    record = timed.record
    return WirePacket(timed.time_ns, record.data, ERROR_FLAGS.get(record.kind, 0))
