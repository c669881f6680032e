# SPDX-License-Identifier: GPL-2.0-or-later
"""Where in a packet of the capture the bytes of a line stand, by link type; all else in it is blanked, or kept.

147 .. 162        a serial line     all of it
250               RTAC serial       behind a header of 12 bytes, which is kept
227               CAN               each packet by itself (``can_frames``)
187, 201, 254     Bluetooth         values of attributes (``hci_packets``)
0, 1, 101 ...     networks          what TCP connections carry (``network_packets``)
any other                           blanked, all of it
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from dalycapture import rtac
from dalyref.packet import SERIAL_LINK_TYPES
from dalytools.redact import can_frames, hci_packets, network_packets
from dalytools.redact.addresses import Addresses
from dalytools.redact.lines import Line
from dalytools.redact.segments import Segments
from dalytools.redact.what import What
from dalytools.wires import can
from dalytools.wires.carriers import SOCKETCAN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.packet import Packet
    from dalytools.redact.a5_data import A5Data
    from dalytools.redact.blanker import Blanker
    from dalytools.redact.lines import Held

_RTAC_HEAD: Final = 12


class Carriers:
    """Takes the packets of one capture, in order."""

    def __init__(self, blanker: Blanker, a5: A5Data) -> None:
        self.lines: dict[tuple[int | str, str], Line] = {}
        """By interface, or connection; and direction."""
        self._blanker = blanker
        self._a5 = a5
        addresses = Addresses()
        self._segments = Segments(blanker, self._line)
        self._network = network_packets.NetworkPackets(blanker, addresses, self._segments)
        self._hci = hci_packets.HciPackets(blanker, addresses, self._line)

    def feed(self, held: Held) -> Sequence[Packet]:
        """Blank what stands around the bytes of lines; return what is for the decoder, its bytes put into lines."""
        packet = held.packet
        if packet.link_type in SERIAL_LINK_TYPES:
            return self._serial(held, packet, 0)
        if packet.link_type == rtac.LINK_TYPE:
            return self._serial(held, replace(rtac.unwrapped(packet), comment=""), _RTAC_HEAD)
        if packet.link_type == SOCKETCAN:
            held.data[:] = can_frames.blank(packet.data, packet.interface, self._a5, self._blanker)
            return can.frames(packet)
        if packet.link_type in hci_packets.LINK_TYPES:
            return self._hci.feed(held)
        if packet.link_type in network_packets.LINK_TYPES:
            return self._network.feed(held)
        held.data[:] = self._blanker.whole(packet.data, What.TRAFFIC, "packets of other link types")
        return ()

    def finish(self) -> Sequence[Packet]:
        """Take the end of the capture; return what was held back."""
        self._hci.finish()
        return self._segments.finish()

    def give_up(self, held: Held) -> None:
        """Blank what is undecided of a packet that has been held for too long."""
        for line in self.lines.values():
            line.give_up(held)
        held.gone = True

    def _line(self, name: int | str, direction: str) -> Line:
        return self.lines.setdefault((name, direction), Line())

    def _serial(self, held: Held, inner: Packet, start: int) -> Sequence[Packet]:
        if inner.data:
            self._line(inner.interface, inner.direction).add(held, start, len(inner.data))
        elif start:
            held.data[start:] = self._blanker.whole(held.packet.data[start:], What.TRAFFIC, "RTAC events")
        return (inner,)
