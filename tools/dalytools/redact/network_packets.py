# SPDX-License-Identifier: GPL-2.0-or-later
"""Packets of networks: addresses replaced, checksums renewed, the bytes of TCP handed over as lines; all else blanked.

1          Ethernet: to, from, [VLAN ..,] type | IP ...
113, 276   Linux cooked: .. address of 8 bytes .. type | IP ...
101, 228, 229   IP ...
0          BSD loopback: family | IP ...

IPv4   head of 20 bytes and options | TCP: head of 20 bytes and options | data
IPv6   head of 40 bytes             |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dalytools.redact import checksums
from dalytools.redact.segments import Segment
from dalytools.redact.what import What

if TYPE_CHECKING:
    from dalyref.packet import Packet
    from dalytools.redact.addresses import Addresses
    from dalytools.redact.blanker import Blanker
    from dalytools.redact.lines import Held
    from dalytools.redact.segments import Segments

ETHERNET, COOKED, COOKED_2, LOOPBACK = 1, 113, 276, 0
RAW: Final = frozenset((101, 228, 229))
LINK_TYPES: Final = frozenset((ETHERNET, COOKED, COOKED_2, LOOPBACK)) | RAW

_IP: Final = frozenset((0x0800, 0x86DD))
_VLAN: Final = frozenset((0x8100, 0x88A8))
_TCP: Final = 6
_TCP_CHECKSUM: Final = 16
_IP_CHECKSUM: Final = 10
_PLAIN_OPTIONS: Final = frozenset((2, 3, 4, 5, 8))
"""Of TCP: segment size, window, acknowledgements, time stamps."""
_NAMES: Final = "network"


@dataclass(frozen=True, slots=True)
class _Ip:
    """Where the parts of an IP packet stand."""

    start: int
    head: int
    """Where its head ends."""
    end: int
    """Where it says that it ends: behind what was captured, if the snap length cut it off."""
    protocol: int
    addresses: tuple[int, int]
    """Where source and destination begin."""
    size: int
    """Of an address."""
    whole: bool
    """It is no fragment."""


class NetworkPackets:
    """Takes the packets of networks in a capture, in order."""

    def __init__(self, blanker: Blanker, addresses: Addresses, segments: Segments) -> None:
        self._blanker = blanker
        self._addresses = addresses
        self._segments = segments

    def feed(self, held: Held) -> list[Packet]:
        """Blank a packet, and return what has come in order for the decoder."""
        out = self._segments.pass_packet(held.packet)
        data = held.packet.data
        start = self._link(held)
        ip = None if start is None else _ip(data, start)
        if ip is None:
            self._blank(held, len(data) if start is None and not data else start or 0, len(data))
            return out
        size = ip.size
        for at in ip.addresses:
            self._address(held, at, at + size)
        if size == 4:
            self._blank(held, ip.start + 20, ip.head)
        self._blank(held, ip.end, len(data))
        tcp = self._tcp(held, ip) if ip.protocol == _TCP and ip.whole else None
        if tcp is None:
            self._blank(held, ip.head, min(ip.end, len(data)))
        held.close = lambda new: _renew(data, new, ip)
        return out if tcp is None else out + self._segments.feed(tcp)

    def _blank(self, held: Held, start: int, stop: int) -> None:
        if start < stop:
            old = held.packet.data[start:stop]
            held.data[start : start + len(old)] = self._blanker.whole(old, What.TRAFFIC, _NAMES)

    def _address(self, held: Held, start: int, stop: int) -> None:
        old = held.packet.data[start:stop]
        held.data[start:stop] = self._blanker.given(old, self._addresses.of(old), What.ADDRESS, _NAMES)

    def _link(self, held: Held) -> int | None:
        """Replace the addresses of the link; return where IP begins, None: there is none."""
        data, link_type = held.packet.data, held.packet.link_type
        if link_type in RAW:
            return 0
        if link_type == LOOPBACK:
            return 4
        if link_type == ETHERNET:
            if len(data) < 14:
                return None
            self._address(held, 0, 6)
            self._address(held, 6, 12)
            at = 12
        elif link_type == COOKED:
            if len(data) < 16:
                return None
            self._address(held, 6, 12)
            self._blank(held, 12, 14)
            at = 14
        else:
            if len(data) < 20:
                return None
            self._address(held, 12, 18)
            self._blank(held, 18, 20)
            return 20 if int.from_bytes(data[:2]) in _IP else self._not_ip(held, 20)
        kind = int.from_bytes(data[at : at + 2])
        while kind in _VLAN:
            at += 4
            kind = int.from_bytes(data[at : at + 2])
        return at + 2 if kind in _IP else self._not_ip(held, at + 2)

    def _not_ip(self, held: Held, start: int) -> None:
        self._blank(held, start, len(held.packet.data))

    def _tcp(self, held: Held, ip: _Ip) -> Segment | None:
        """Blank what is unusual in the head of a segment; return the segment, None: it is none."""
        data = held.packet.data
        at = ip.head
        if len(data) < at + 20 or ip.end < at + 20:
            return None
        start = at + (data[at + 12] >> 4) * 4
        if not at + 20 <= start <= min(len(data), ip.end):
            return None
        _options(held, at + 20, start)
        size = min(ip.end, len(data)) - start
        source, destination = (data[one : one + ip.size] for one in ip.addresses)
        return Segment(
            held,
            (source, int.from_bytes(data[at : at + 2])),
            (destination, int.from_bytes(data[at + 2 : at + 4])),
            int.from_bytes(data[at + 4 : at + 8]),
            data[at + 13],
            start,
            size,
            max(0, ip.end - len(data)),
        )


def _ip(data: bytes, start: int) -> _Ip | None:
    """Find the parts of an IP packet; None: there is none."""
    version = data[start] >> 4 if len(data) > start else 0
    if version == 4 and len(data) >= start + 20:
        head = start + (data[start] & 15) * 4
        end = start + int.from_bytes(data[start + 2 : start + 4])
        fragment = int.from_bytes(data[start + 6 : start + 8]) & 0x3FFF
        if end == start:  # not calculated: the network card cuts it up
            end = len(data)
        if not start + 20 <= head <= min(len(data), end):
            return None
        return _Ip(start, head, end, data[start + 9], (start + 12, start + 16), 4, not fragment)
    if version == 6 and len(data) >= start + 40:
        end = start + 40 + int.from_bytes(data[start + 4 : start + 6])
        return _Ip(start, start + 40, end, data[start + 6], (start + 8, start + 24), 16, True)
    return None


def _options(held: Held, at: int, end: int) -> None:
    """Put "no operation" in the place of options of TCP that are not plain."""
    data = held.packet.data
    while at < end:
        kind = data[at]
        if kind == 0:
            held.data[at:end] = bytes(end - at)
            return
        size = 1 if kind == 1 else data[at + 1] if at + 1 < end else 0
        stop = at + size if size >= 1 + (kind != 1) else end
        if kind != 1 and (kind not in _PLAIN_OPTIONS or stop > end):
            held.data[at : min(stop, end)] = b"\1" * (min(stop, end) - at)
        at = stop


def _renew(old: bytes, new: bytearray, ip: _Ip) -> None:
    """Renew the checksums of a packet whose bytes are all decided."""
    if ip.size == 4:
        head = checksums.renewed(old[ip.start : ip.head], bytes(new[ip.start : ip.head]), _IP_CHECKSUM)
        new[ip.start + _IP_CHECKSUM : ip.start + _IP_CHECKSUM + 2] = head.to_bytes(2)
    at = ip.head + _TCP_CHECKSUM
    if ip.protocol != _TCP or not ip.whole or len(old) < ip.head + 20:
        return
    if ip.end > len(old):
        new[at : at + 2] = bytes(2)  # over bytes that are not there; it would tell something of those that were
        return
    before, after = (_pseudo(data, ip) + data[ip.head : ip.end] for data in (old, bytes(new)))
    skipped = len(_pseudo(old, ip))
    new[at : at + 2] = checksums.renewed(before, after, skipped + _TCP_CHECKSUM).to_bytes(2)


def _pseudo(data: bytes, ip: _Ip) -> bytes:
    """Return what the checksum of TCP counts before its head."""
    first = ip.addresses[0]
    addresses = data[first : first + 2 * ip.size]
    return addresses + (ip.end - ip.head).to_bytes(4) + bytes((0, 0, 0, _TCP))
