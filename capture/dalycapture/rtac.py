# SPDX-License-Identifier: GPL-2.0-or-later
"""RTAC serial captures (LINKTYPE_RTAC_SERIAL, 250): a serial line's bytes behind a header of twelve.

    0          4          8       9        10       12
    | seconds  | microsec | event | lines  | footer | data ...      big-endian; the packet has the time already

Events 01 and 02 carry bytes that the RTAC sent and received (03, 04: their ends). The others are told as events.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from dalycapture.pcapng import INBOUND, OUTBOUND

if TYPE_CHECKING:
    from dalycapture.captured import CapturedPacket
    from dalyref.packet import Direction

LINK_TYPE: Final = 250

_HEADER = 12
_SIDES: Final[dict[int, tuple[Direction, int]]] = {
    1: ("outbound", OUTBOUND),
    2: ("inbound", INBOUND),
    3: ("outbound", OUTBOUND),
    4: ("inbound", INBOUND),
}
_EVENTS: Final = {
    0: "status change",
    5: "capture data lost",
    6: "capture complete",
    7: "framing error",
    8: "parity error",
    9: "break",
    10: "overflow",
}


def unwrapped(packet: CapturedPacket) -> CapturedPacket:
    """Take the header off: a packet of a serial line with its direction, or an event."""
    event = packet.data[8] if len(packet.data) >= _HEADER else -1
    data = packet.data[_HEADER:]
    if event in _SIDES and data:
        direction, flags = _SIDES[event]
        return replace(packet, data=data, direction=direction, flags=packet.flags & ~3 | flags, link_type=147)
    name = _EVENTS.get(event, f"event {event}" if event >= 0 else "no whole header")
    said = f"RTAC: {name}" + (f" ({data.hex()})" if data else "")
    comment = f"{packet.comment}\n{said}" if packet.comment else said
    return replace(packet, data=b"", comment=comment, link_type=147)
