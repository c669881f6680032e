# SPDX-License-Identifier: GPL-2.0-or-later
"""Which reader takes a packet, by its link type (docs/wires.md, the table at its head).

What carries Bluetooth and TCP is loaded when the first such packet comes: it needs scapy, an extra
(``pip install dalyshark[wires]``), which a Raspberry Pi that only captures can do without.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalyref.packet import SERIAL_LINK_TYPES
from dalytools.wires import can
from dalytools.wires.choice import Choice

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.packet import Packet

SOCKETCAN: Final = 227


class Carriers:
    """Takes the packets of one capture, in order."""

    def __init__(self, choice: Choice | None = None) -> None:
        self._choice = choice or Choice()

    def of(self, packet: Packet) -> Sequence[Packet]:
        """Return what a packet holds for the decoder: nothing where it can't be Daly's."""
        if packet.link_type in SERIAL_LINK_TYPES:
            return (packet,)
        if packet.link_type == SOCKETCAN:
            return can.frames(packet)
        return ()

    def finish(self) -> Sequence[Packet]:
        """Take the end of the capture; return what was held back."""
        return ()

    @staticmethod
    def reads(link_type: int) -> bool:
        """Tell whether packets of a link type can hold Daly's bytes."""
        return link_type in SERIAL_LINK_TYPES or link_type == SOCKETCAN


NOT_READ: Final = "a Daly bus is captured as 147 (USER0) to 162 (USER15), SocketCAN, Bluetooth HCI or TCP"
"""Said of a file with nothing but other link types."""
