# SPDX-License-Identifier: GPL-2.0-or-later
"""What the reference decoder is fed: bytes of a serial line, of Bluetooth or TCP connections; frames of a CAN bus."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Direction = Literal["", "inbound", "outbound"]
Transport = Literal["uart", "can", "ble", "tcp"]

SERIAL_LINK_TYPES = range(147, 163)
"""USER0 to USER15: the link types that carry the bytes of a serial line."""


@dataclass(frozen=True, slots=True)
class Packet:
    """Some bytes with a time stamp (docs/records.md, section 1). A serial packet without bytes is an event.

    Of Bluetooth and TCP, what Daly sent in a packet of the capture: see `connection`.
    """

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
    transport: Transport = "uart"
    connection: str = ""
    """Bluetooth, TCP: names the connection, which is one bus; `direction` tells its two sides apart."""
    after_gap: bool = False
    """Bluetooth, TCP: bytes before these are lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CanFrame(Packet):
    """A frame of a CAN bus (docs/wires.md, 2). `data`: its bytes, of a remote frame none. Error frames are not such."""

    identifier: int
    """11 or 29 bits."""
    extended: bool = True
    remote: bool = False
