# SPDX-License-Identifier: GPL-2.0-or-later
"""Where in a packet of the capture the bytes of a line stand, by link type; all else in it is blanked, or kept, here.

147 .. 162   a serial line          all of it
250          RTAC serial            behind a header of 12 bytes, which is kept
227          CAN                    each packet by itself (``can_frames``)
any other                           blanked, all of it
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final, NamedTuple

from dalycapture import rtac
from dalyref.packet import SERIAL_LINK_TYPES
from dalytools.redact.what import What
from dalytools.wires import can
from dalytools.wires.carriers import SOCKETCAN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalycapture.captured import CapturedPacket
    from dalyref.packet import Packet
    from dalytools.redact.blanker import Blanker

_RTAC_HEAD: Final = 12


class Carried(NamedTuple):
    """What is fed to the decoder, and where its bytes stand in the packet; -1: it is a record by itself."""

    packet: Packet
    start: int


def carried(packet: CapturedPacket) -> Sequence[Carried]:
    """Return what a packet holds for the decoder."""
    if packet.link_type in SERIAL_LINK_TYPES:
        return (Carried(packet, 0),)
    if packet.link_type == rtac.LINK_TYPE:
        inner = replace(rtac.unwrapped(packet), comment="")
        return (Carried(inner, _RTAC_HEAD),)
    if packet.link_type == SOCKETCAN:
        return [Carried(frame, -1) for frame in can.frames(packet)]
    return ()


def around(packet: CapturedPacket, carried_size: int, blanker: Blanker) -> bytes:
    """Blank what stands around the bytes of a line. carried_size: how many of them there are, at the packet's end."""
    data = packet.data
    if packet.link_type in SERIAL_LINK_TYPES:
        return data
    if packet.link_type == rtac.LINK_TYPE:
        end = len(data) - carried_size
        if carried_size:
            return data
        return data[:_RTAC_HEAD] + blanker.whole(data[_RTAC_HEAD:end], What.FOREIGN, "RTAC events")
    return blanker.whole(data, What.FOREIGN, "packets of other link types")
