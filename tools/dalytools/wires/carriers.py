# SPDX-License-Identifier: GPL-2.0-or-later
"""Which reader takes a packet, by its link type (docs/wires.md). Bluetooth and TCP have none yet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalyref.packet import SERIAL_LINK_TYPES
from dalytools.wires import can

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.packet import Packet

SOCKETCAN: Final = 227


class Carriers:
    """Takes the packets of one capture, in order."""

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


NOT_READ: Final = "what is read is a serial line, as 147 (USER0) to 162 (USER15), and CAN, as SocketCAN"
"""Said of a file with nothing but other link types."""
