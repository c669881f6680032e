# SPDX-License-Identifier: GPL-2.0-or-later
"""CAN: SocketCAN packets (link type 227), and the logs of candump, which are read as such."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalycapture import socketcan
from dalyref.packet import CanFrame

if TYPE_CHECKING:
    from dalyref.packet import Packet


def frames(packet: Packet) -> tuple[CanFrame, ...]:
    """Return the frame in a packet: none where it is an error frame, CAN FD, or cut off (docs/wires.md, 2)."""
    found = socketcan.unpack(packet.data)
    if found is None:
        return ()
    frame = CanFrame(
        number=packet.number,
        time_ns=packet.time_ns,
        data=found.data,
        interface=packet.interface,
        direction=packet.direction,
        comment=packet.comment,
        link_type=packet.link_type,
        transport="can",
        identifier=found.identifier,
        extended=found.extended,
        remote=found.remote,
    )
    return (frame,)
