# SPDX-License-Identifier: GPL-2.0-or-later
"""The same exchange through a serial server (ser2net raw, ESP-Link, EW11): one TCP connection, link type Ethernet.

    client 192.0.2.10:50000  -->  server 192.0.2.20:8899     what the first host asks, a request a segment
                             <--                             all else that is heard on the pair

Handshake, acknowledgements and end are there; the server sends what it has when its UART pauses, or 64 bytes.
Addresses are of RFC 5737, for documentation.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final

from dalycapture.interface import Interface
from dalytools.simulator.bus import BITS_A_BYTE, CLIENT, HOST
from dalytools.simulator.wire import WirePacket

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from dalytools.simulator.scenario import Scenario
    from dalytools.simulator.sent import Sent

ETHERNET: Final = 1
PORT: Final = 8899  # of an EW11 as delivered
SEGMENT_BYTES: Final = 64
FIN, SYN, PUSH, ACK = 0x01, 0x02, 0x08, 0x10
_PAUSE_NS: Final = 10_000_000
_TRAVEL_NS: Final = 400_000  # one way through the network


class _End:
    """One end of the connection: its addresses and its next sequence number."""

    def __init__(self, mac: str, address: str, port: int, sequence: int) -> None:
        self.mac = bytes.fromhex(mac)
        self.address = bytes(map(int, address.split(".")))
        self.port = port
        self.sequence = sequence
        self.packets = 0


class TcpWire:
    """The network between a program and a serial server."""

    def __init__(self, scenario: Scenario) -> None:
        self.interface = Interface("eth0", f"made by dalyshark simulate; serial server on port {PORT}", ETHERNET)
        self._char_ns = BITS_A_BYTE * 1_000_000_000 / scenario.baud
        first = next((host.name for host in scenario.hosts), HOST)
        sends = {event.sender for event in scenario.events if event.what == "send"}
        others = {host.name for host in scenario.hosts} - {first}
        self._through = ({first, CLIENT} | sends) - others  # whose bytes come from the network
        self._client = _End("020000000001", "192.0.2.10", 50000, 1000)
        self._server = _End("020000000002", "192.0.2.20", PORT, 5000)
        self._opened = False
        self._ahead = b""
        self._ahead_ns = 0

    def feed(self, piece: Sent) -> Iterable[WirePacket]:
        """Take one piece; the segments that went by then."""
        if not self._opened:
            self._opened = True
            yield from self._handshake(piece.time_ns)
        if piece.sender in self._through:
            yield from self._rest()
            yield from self._carried(self._client, self._server, piece.data, piece.time_ns)
            return
        if piece.time_ns > self._ahead_ns + _PAUSE_NS:
            yield from self._rest()
        for start in range(0, len(piece.data), SEGMENT_BYTES):
            part = piece.data[start : start + SEGMENT_BYTES]
            if len(self._ahead) + len(part) > SEGMENT_BYTES:
                yield from self._rest()
            self._ahead += part
            self._ahead_ns = piece.time_ns + round((start + len(part)) * self._char_ns)

    def finish(self, end_ns: int) -> Iterable[WirePacket]:
        """Hand out the rest, and close."""
        yield from self._rest()
        if self._opened:
            at = max(end_ns, self._ahead_ns + _PAUSE_NS)
            yield self._segment(self._client, self._server, FIN | ACK, b"", at)
            yield self._segment(self._server, self._client, FIN | ACK, b"", at + _TRAVEL_NS)
            yield self._segment(self._client, self._server, ACK, b"", at + 2 * _TRAVEL_NS)

    def _rest(self) -> Iterator[WirePacket]:
        if self._ahead:
            yield from self._carried(self._server, self._client, self._ahead, self._ahead_ns)
            self._ahead = b""

    def _carried(self, sender: _End, receiver: _End, data: bytes, at_ns: int) -> Iterator[WirePacket]:
        yield self._segment(sender, receiver, PUSH | ACK, data, at_ns)
        yield self._segment(receiver, sender, ACK, b"", at_ns + _TRAVEL_NS)

    def _handshake(self, first_ns: int) -> Iterator[WirePacket]:
        at = first_ns - 10 * _TRAVEL_NS
        yield self._segment(self._client, self._server, SYN, b"", at)
        yield self._segment(self._server, self._client, SYN | ACK, b"", at + _TRAVEL_NS)
        yield self._segment(self._client, self._server, ACK, b"", at + 2 * _TRAVEL_NS)

    def _segment(self, sender: _End, receiver: _End, flags: int, data: bytes, at_ns: int) -> WirePacket:
        acknowledged = receiver.sequence if flags & ACK else 0
        head = struct.pack(
            ">HHIIBBHHH", sender.port, receiver.port, sender.sequence, acknowledged, 5 << 4, flags, 0xFFFF, 0, 0
        )
        sender.sequence += len(data) + (1 if flags & (SYN | FIN) else 0)
        sender.packets += 1
        length = len(head) + len(data)
        pseudo = sender.address + receiver.address + struct.pack(">BBH", 0, 6, length)
        tcp = head[:16] + _checksum(pseudo + head + data) + head[18:] + data
        ip = struct.pack(">BBHHHBBH", 0x45, 0, 20 + length, sender.packets & 0xFFFF, 0x4000, 64, 6, 0)
        ip += sender.address + receiver.address
        ip = ip[:10] + _checksum(ip) + ip[12:]
        return WirePacket(at_ns, receiver.mac + sender.mac + b"\x08\x00" + ip + tcp)


def _checksum(data: bytes) -> bytes:
    """Return the Internet checksum (RFC 1071)."""
    total = sum(struct.unpack(f">{(len(data) + 1) // 2}H", data + bytes(len(data) % 2)))
    while total > 0xFFFF:
        total = (total & 0xFFFF) + (total >> 16)
    return (~total & 0xFFFF).to_bytes(2)
