# SPDX-License-Identifier: GPL-2.0-or-later
"""A Bluetooth capture in the making; packets written by hand from the Bluetooth papers (docs/wires.md, 3)."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from tests.tools.dalytools.made import ANSWER, ASK, EPOCH_NS

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalyref.packet import Packet
from dalytools.wires.bluetooth import HCI_WITH_DIRECTION, LINUX_MONITOR
from dalytools.wires.carriers import Carriers
from dalytools.wires.choice import Choice, numbers

if TYPE_CHECKING:
    from pathlib import Path

    from dalyref.packet import Direction

SENT, RECEIVED = 0, 1
WRITE, NOTIFY = 0x0F, 0x11
HANDLE = 0x40

# Read By Type 2803 from 0001 to FFFF; two characteristics: declared at 000E and 0010, fff2 at 000F, fff1 at 0011
ASKED, TOLD = "080100ffff0328", "0907" + "0e00040f00f2ff" + "1000101100f1ff"
LONG = "00001000800000805f9b34fb"
"""The end of a short UUID's long form: xxxx-0000-1000-8000-00805F9B34FB, high byte first."""


def long_form(short: str) -> str:
    return bytes.fromhex("0000" + short + LONG)[::-1].hex()


def data(pdu: str, *, handle: int = HANDLE, first: bool = True, whole: int | None = None) -> bytes:
    """One HCI data packet, without its kind. whole: length of the L2CAP packet, where more of it follows."""
    body = bytes.fromhex(pdu)
    if first:
        body = struct.pack("<HH", len(body) if whole is None else whole, 4) + body
    return struct.pack("<HH", handle | (0x2000 if first else 0x1000), len(body)) + body


PLAIN, ENHANCED, ENHANCED_2 = 0x01, 0x0A, 0x29
"""LE Connection Complete, LE Enhanced Connection Complete, and its version 2 (Bluetooth Core 5.4 and later)."""
_LENGTHS = {PLAIN: 19, ENHANCED: 31, ENHANCED_2: 34}


def connected(handle: int = HANDLE, *, subevent: int = PLAIN, status: int = 0) -> bytes:
    """One of these events, without its kind: subevent, status, handle, and the rest as zeros."""
    inner = struct.pack("<BBH", subevent, status, handle).ljust(_LENGTHS[subevent], b"\0")
    return bytes((0x3E, len(inner))) + inner


class Air:
    """A capture in the making."""

    def __init__(self, link_type: int = HCI_WITH_DIRECTION) -> None:
        self.link_type = link_type
        self.packets: list[Packet] = []

    def put(self, received: int, body: bytes, *, event: bool = False, adapter: int = 0, at_ms: float = 0) -> None:
        kind = 4 if event else 2
        direction: Direction = ""
        if self.link_type == LINUX_MONITOR:
            whole = struct.pack(">HH", adapter, 3 if event else 4 + received) + body
        elif self.link_type == HCI_WITH_DIRECTION:
            whole = struct.pack(">IB", received, kind) + body
        else:
            whole, direction = bytes((kind,)) + body, "inbound" if received else "outbound"
        number = len(self.packets) + 1
        time_ns = EPOCH_NS + round((at_ms or 10 * number) * 1e6)
        self.packets.append(
            Packet(number=number, time_ns=time_ns, data=whole, direction=direction, link_type=self.link_type)
        )

    def discover(self, told: str = TOLD, adapter: int = 0) -> None:
        self.put(SENT, data(ASKED), adapter=adapter)
        self.put(RECEIVED, data(told), adapter=adapter)

    def speak(self, adapter: int = 0) -> None:
        self.put(SENT, data("520f00" + ASK.hex()), adapter=adapter)
        self.put(RECEIVED, data("1b1100" + ANSWER.hex()), adapter=adapter)

    def values(self, handles: str = "") -> list[tuple[int, str, bytes]]:
        carriers = Carriers(Choice(ble_handles=numbers(handles)) if handles else None)
        return [(one.number, one.direction, one.data) for each in self.packets for one in carriers.of(each)]

    def save(self, path: Path) -> str:
        """Write the capture to a file; return its name."""
        with open_writer(path) as writer:
            writer.add_interface(Interface("bluetooth0", "", self.link_type))
            for packet in self.packets:
                writer.write_packet(packet.time_ns, packet.data)
        path.chmod(0o644)
        return str(path)
