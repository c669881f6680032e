# SPDX-License-Identifier: GPL-2.0-or-later
"""Which reader takes a packet, by its link type (docs/wires.md), and that what they give stays in the file's order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalyref.packet import SERIAL_LINK_TYPES
from dalytools.terminal_text import counted
from dalytools.wires import can
from dalytools.wires.bluetooth import LINK_TYPES as BLUETOOTH
from dalytools.wires.bluetooth import Bluetooth
from dalytools.wires.choice import Choice
from dalytools.wires.left_out import LeftOut
from dalytools.wires.network import LINK_TYPES as NETWORK
from dalytools.wires.tcp import Tcp

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.packet import Packet

SOCKETCAN: Final = 227
_MOST_BEHIND: Final = 16384
_MOST_BYTES_BEHIND: Final = 1 << 22
"""Packets, and bytes of them, that wait until a gap of a TCP connection is closed."""


class Carriers:
    """Takes the packets of one capture, in order."""

    def __init__(self, choice: Choice | None = None) -> None:
        """Raise Problem where a package is missing that the choice needs."""
        choice = choice or Choice()
        self._ports = choice.tcp_ports
        self._tcp = Tcp(choice.tcp_ports) if choice.tcp_ports else None
        self._bluetooth = Bluetooth(choice.ble_handles)
        self._behind: list[Packet] = []
        self._bytes_behind = 0
        self._others = False  # packets of wires that need no choice
        self._network = False

    @property
    def lost(self) -> bool:
        """Tell whether bytes of a TCP connection are missing."""
        return self._tcp is not None and self._tcp.lost

    @property
    def late(self) -> set[str]:
        """TCP connections with segments out of order, by name."""
        return self._tcp.late if self._tcp is not None else set()

    @property
    def again(self) -> set[str]:
        """TCP connections with segments that came twice, by name."""
        return self._tcp.again if self._tcp is not None else set()

    @property
    def connection(self) -> str:
        """Name the TCP connection of the latest packet; empty: it was no segment of ours."""
        return self._tcp.latest if self._tcp is not None else ""

    @property
    def cut(self) -> bool:
        """Tell whether the latest packet is a TCP segment that the snap length cut bytes off."""
        return self._tcp is not None and self._tcp.cut

    @property
    def nothing(self) -> str:
        """Say what a user may have chosen wrongly, where no packet so far was of a bus; empty: some were, or may be."""
        if self._others or self._bluetooth.found or (self._tcp is not None and self._tcp.found):
            return ""
        if self._bluetooth.others:
            handles = ", ".join(map(str, sorted(self._bluetooth.others)))
            if self._bluetooth.before:
                values = counted(self._bluetooth.before, "value")
                return (
                    f"no frame of Daly's in {values} of Bluetooth attributes fff1, fff2, ff01 and ff02, which other "
                    f"makers use too; if one is Daly's, say which with --ble-handles, of {handles}"
                )
            return (
                "no Bluetooth attribute in it is known to be Daly's: its discovery is not in the capture; "
                f"say which it is with --ble-handles, of {handles}"
            )
        if self._tcp is not None and self._network:
            return (
                f"no TCP segment in it is from or to port {self._ports}; tshark -q -z conv,tcp -r FILE lists the ports "
                "there are: choose with --tcp-ports"
            )
        return ""

    @property
    def left_out(self) -> list[LeftOut]:
        """Tell what was found so far and left out, beside what `nothing` says."""
        before = 0 if self.nothing else self._bluetooth.before
        counts = (LeftOut("ble_values", before), LeftOut("ble_packets", self._bluetooth.incomplete))
        return [one for one in counts if one.count]

    def of(self, packet: Packet) -> Sequence[Packet]:
        """Return what has come for the decoder: of this packet, and of those that waited for it; often nothing."""
        tcp = self._tcp
        self._others = self._others or packet.link_type in SERIAL_LINK_TYPES or packet.link_type == SOCKETCAN
        self._network = self._network or packet.link_type in NETWORK
        if tcp is not None:
            tcp.latest, tcp.cut = "", False
        if tcp is None or not (tcp.waits or packet.link_type in NETWORK):
            return self._at_once(packet)
        given = tcp.feed(packet) if packet.link_type in NETWORK else tcp.pass_time(packet.time_ns)
        self._hold(given)
        if packet.link_type not in NETWORK:
            self._hold(self._at_once(packet))
        if len(self._behind) > _MOST_BEHIND or self._bytes_behind > _MOST_BYTES_BEHIND:
            self._hold(tcp.give_up())
        return () if tcp.waits else self._release()

    def finish(self) -> Sequence[Packet]:
        """Take the end of the capture; return what was held back."""
        if self._tcp is not None:
            self._hold(self._tcp.give_up())
        return self._release()

    def reads(self, link_type: int) -> bool:
        """Tell whether packets of a link type can hold Daly's bytes."""
        return (
            link_type in SERIAL_LINK_TYPES
            or link_type == SOCKETCAN
            or link_type in BLUETOOTH
            or (self._tcp is not None and link_type in NETWORK)
        )

    def _at_once(self, packet: Packet) -> Sequence[Packet]:
        if packet.link_type in SERIAL_LINK_TYPES:
            return (packet,)
        if packet.link_type == SOCKETCAN:
            return can.frames(packet)
        if packet.link_type in BLUETOOTH:
            return self._bluetooth.values(packet)
        return ()

    def _hold(self, packets: Sequence[Packet]) -> None:
        self._behind += packets
        self._bytes_behind += sum(len(one.data) for one in packets)

    def _release(self) -> Sequence[Packet]:
        released = sorted(self._behind, key=lambda packet: packet.number)
        self._behind = []
        self._bytes_behind = 0
        return released


NOT_READ: Final = (
    "what is read is a serial line, as 147 (USER0) to 162 (USER15), CAN, as SocketCAN, Bluetooth, as HCI, and, "
    "with --tcp-ports, TCP"
)
"""Said of a file with nothing but other link types."""
