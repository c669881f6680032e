# SPDX-License-Identifier: GPL-2.0-or-later
"""CAN frames as SocketCAN captures hold them (link type 227), made by scapy."""

from __future__ import annotations

from scapy.layers.can import CAN, CANFD
from tests.dissector.dissection import P

SOCKETCAN = 227


def can(identifier: int, data: str = "", *, flags: str = "extended", at: float = 0.0, interface: int = 0) -> P:
    """Build a frame; data is hex. Flags: extended, remote_transmission_request, error, joined by +; none: standard."""
    frame = CAN(flags=flags, identifier=identifier, data=bytes.fromhex(data))
    return P(bytes(frame).hex(), at, interface)


def canfd(identifier: int, data: str, *, at: float = 0.0) -> P:
    """Build a CAN FD frame of an extended identifier."""
    return P(bytes(CANFD(flags="extended", identifier=identifier, data=bytes.fromhex(data))).hex(), at)


def request(data_id: int, *, board: int = 1, host: int = 0x40, data: str = "00" * 8, at: float = 0.0, on: int = 0) -> P:
    """Build a classic request."""
    return can(0x18 << 24 | data_id << 16 | board << 8 | host, data, at=at, interface=on)


def reply(data_id: int, data: str, *, board: int = 1, host: int = 0x40, at: float = 0.0, on: int = 0) -> P:
    """Build a classic reply."""
    return can(0x18 << 24 | data_id << 16 | host << 8 | board, data, at=at, interface=on)


def hkms(register: int, data: str, *, board: int = 1, host: int = 0x80, at: float = 0.0) -> P:
    """Build a frame that a board of the HKMS dialect streams."""
    return can(register << 16 | host << 8 | board, data, at=at)


def keep_alive(at: float = 0.0) -> P:
    return can(0x0400FF80, "00" * 8, at=at)
