# SPDX-License-Identifier: GPL-2.0-or-later
"""IP packets that came in fragments, 4 and 6, put together (docs/wires.md, 4).

    fragment   0 ..  1480      2960 ..  3100 (last)      1480 ..  2960
    whole                                                0 ..  3100      in the packet that makes it so

RFC 791 and 8200. What overlaps with other bytes is refused whole (RFC 5722). What stays incomplete is lost.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass, field
from typing import Final, NamedTuple

LONGEST_WAIT_NS: Final = 60_000_000_000
"""RFC 8200 4.5, RFC 1122 3.3.2."""
MOST_WAITING: Final = 64
MOST_BYTES: Final = 1 << 20
"""Of all packets that wait for fragments."""
_LONGEST: Final = 65535
_MOST_PARTS: Final = 2048  # more than 65535 bytes over the smallest network there may be (68 bytes a packet)

_HOP_BY_HOP, _ROUTING, _FRAGMENT, _OPTIONS = 0, 43, 44, 60
_MORE: Final = 0x2000

# An IPv4 header of TCP with "more fragments" or an offset; an IPv6 header with one more header behind it.
_SUSPECT: Final = re.compile(
    rb"[\x45-\x4f].{5}(?:[\x01-\x3f\x41-\x7f\x81-\xbf\xc1-\xff].|[\x00\x40\x80\xc0][^\x00]).\x06"
    rb"|[\x60-\x6f].{5}[\x00\x2b\x2c\x3c]",
    re.DOTALL,
)
_WITHIN: Final = 64  # bytes of a packet that its IP header begins in


def may_be_fragment(data: bytes) -> bool:
    """Tell, at little cost, whether a packet of any link type may hold a fragment."""
    return _SUSPECT.search(data, 0, _WITHIN) is not None


class _Part(NamedTuple):
    """One fragment."""

    key: tuple[bytes, int, int]
    """Addresses, protocol, identification."""
    start: int
    more: bool
    data: bytes


@dataclass(slots=True)
class _Waiting:
    """Fragments of one packet."""

    since_ns: int
    parts: dict[int, bytes] = field(default_factory=dict[int, bytes])
    end: int | None = None
    refused: bool = False
    size: int = 0

    def take(self, part: _Part) -> None:
        """Take a fragment, or refuse the packet where it does not fit the others."""
        if self.refused or self.parts.get(part.start) == part.data:
            return
        end = part.start + len(part.data)
        last = end if not part.more else self.end
        fits = last is None or (self.end in {None, last} and all(at + len(it) <= last for at, it in self.parts.items()))
        apart = all(at + len(it) <= part.start or at >= end for at, it in self.parts.items())
        if not fits or not apart or (last is not None and end > last) or len(self.parts) >= _MOST_PARTS:
            self.refused = True
            self.parts.clear()
            self.size = 0
            return
        self.end = last
        self.parts[part.start] = part.data
        self.size += len(part.data)

    def whole(self) -> bytes | None:
        """Return the bytes, once all are there."""
        if self.end is None or self.size < self.end:
            return None
        return b"".join(data for _, data in sorted(self.parts.items()))


class Fragments:
    """Takes IP packets, in order."""

    def __init__(self) -> None:
        self._waiting: dict[tuple[bytes, int, int], _Waiting] = {}
        self._held = 0

    def whole(self, packet: bytes, time_ns: int) -> bytes | None:
        """Return a packet as it is, or of fragments, with the last that was missing, the packet that they make.

        packet: from the IP header on. None: of it some are missing, or it is refused.
        """
        while self._waiting and (oldest := next(iter(self._waiting.values()))).since_ns < time_ns - LONGEST_WAIT_NS:
            self._forget(next(iter(self._waiting)), oldest)
        part = _part(packet)
        if not isinstance(part, _Part):
            return part
        waiting = self._waiting.get(part.key)
        if waiting is None:
            waiting = self._waiting[part.key] = _Waiting(time_ns)
        self._held -= waiting.size
        waiting.take(part)
        self._held += waiting.size
        made = waiting.whole()
        if made is not None:
            self._forget(part.key, waiting)
            return _packet(part.key, made)
        while len(self._waiting) > MOST_WAITING or self._held > MOST_BYTES:
            key, oldest = next(iter(self._waiting.items()))
            self._forget(key, oldest)
        return None

    def _forget(self, key: tuple[bytes, int, int], waiting: _Waiting) -> None:
        self._held -= waiting.size
        del self._waiting[key]


def _part(packet: bytes) -> _Part | bytes | None:
    """Return the fragment that a packet is, the packet where it is none, None where it can't be used."""
    return _part_4(packet) if packet[:1] < b"\x60" else _part_6(packet)


def _part_4(packet: bytes) -> _Part | bytes | None:
    if len(packet) < 20:
        return packet
    length, number, place = struct.unpack_from(">HHH", packet, 2)
    start, more = (place & 0x1FFF) * 8, bool(place & _MORE)
    if not start and not more:
        return packet
    head = (packet[0] & 15) * 4
    return _checked(_Part((packet[12:20], packet[9], number), start, more, packet[head:length]), length - head)


def _part_6(packet: bytes) -> _Part | bytes | None:
    if len(packet) < 40:
        return packet
    following, at = packet[6], 40
    while following in (_HOP_BY_HOP, _ROUTING, _OPTIONS) and at + 8 <= len(packet):
        following, at = packet[at], at + 8 + 8 * packet[at + 1]
    if following != _FRAGMENT:
        return packet
    if at + 8 > len(packet):
        return None
    place, number = struct.unpack_from(">HI", packet, at + 2)
    end = 40 + int.from_bytes(packet[4:6])
    part = _Part((packet[8:40], packet[at], number), place & 0xFFF8, bool(place & 1), packet[at + 8 : end])
    if not part.start and not part.more:
        return _packet(part.key, part.data) if len(packet) >= end else None  # whole, and yet with such a header
    return _checked(part, end - at - 8)


def _checked(part: _Part, length: int) -> _Part | None:
    """Return a fragment that has all the bytes it should, as many as it may."""
    if length <= 0 or len(part.data) < length or (part.more and length % 8) or part.start + length > _LONGEST:
        return None
    return part


def _packet(key: tuple[bytes, int, int], data: bytes) -> bytes:
    """Make a packet without fragments."""
    addresses, protocol, _ = key
    if len(addresses) == 8:
        length = 20 + len(data)
        told = length if length <= _LONGEST else 0
        return struct.pack(">BBHHHBBH", 0x45, 0, told, 0, 0, 64, protocol, 0) + addresses + data
    return struct.pack(">IHBB", 0x60000000, len(data), protocol, 64) + addresses + data
