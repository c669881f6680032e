# SPDX-License-Identifier: GPL-2.0-or-later
"""SocketCAN packets, link type 227, as Linux hands CAN frames to a capture.

    byte   0 ............ 3       4        5      6, 7       8 ..
         | flags, identifier | length | FD flags |  -  | data, 0 to 8 (FD: 64) |

Flags, high bits of the first word (high byte first): 8 extended, 4 remote, 2 error.
"""

from __future__ import annotations

import struct
from typing import Final, NamedTuple

EXTENDED: Final = 0x80000000
REMOTE: Final = 0x40000000
ERROR: Final = 0x20000000
FLEXIBLE: Final = 0x04
"""Of the FD flags: the frame is CAN FD."""
XL: Final = 0x80
"""Of the length byte: the frame is CAN XL."""
_FD_SIZE: Final = 72
"""Bytes of a packet that is CAN FD even where its flags do not say so."""

_HEADER = struct.Struct(">IBBxx")


class Frame(NamedTuple):
    """A classic CAN data or remote frame."""

    identifier: int
    extended: bool
    remote: bool
    data: bytes


def pack(word: int, data: bytes, flags: int = 0) -> bytes:
    """Lay out a packet. word: identifier with its flags; data: of a remote frame filling, as long as it says."""
    return _HEADER.pack(word, len(data), flags) + data


def unpack(packet: bytes) -> Frame | None:
    """Return the frame in a packet; None for error frames, CAN FD, CAN XL, and what is cut off or no frame."""
    if len(packet) < _HEADER.size or len(packet) == _FD_SIZE:
        return None
    word, length, flags = _HEADER.unpack_from(packet)
    if word & ERROR or length & XL or length > 8 or flags & FLEXIBLE:
        return None
    extended = bool(word & EXTENDED)
    identifier = word & (0x1FFFFFFF if extended else 0x7FF)
    data = packet[8 : 8 + length]
    if len(data) != length:
        return None
    remote = bool(word & REMOTE)
    return Frame(identifier, extended, remote, b"" if remote else data)
