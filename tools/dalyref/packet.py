# SPDX-License-Identifier: GPL-2.0-or-later
"""A packet as a capture file holds it: the unit that Wireshark counts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Direction = Literal["", "inbound", "outbound"]

SERIAL_LINK_TYPES = range(147, 163)
"""USER0 to USER15: the link types that carry the bytes of a serial line."""


@dataclass(frozen=True, slots=True)
class Packet:
    """Some bytes with a time stamp (docs/records.md, section 1). A packet without bytes is an event."""

    number: int
    """From 1, as Wireshark counts."""
    time_ns: int
    """Nanoseconds since 1970 UTC: when the first byte began on the wire."""
    data: bytes
    interface: int = 0
    description: str = ""
    """The interface's description; ``bus=NAME`` in it joins interfaces to one bus."""
    direction: Direction = ""
    """From ``epb_flags``; empty where the file does not say."""
    comment: str = ""
    link_type: int = 147
