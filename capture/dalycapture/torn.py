# SPDX-License-Identifier: GPL-2.0-or-later
"""Where a capture file that was not closed ends: behind its last whole block or packet.

A kill, a crash or a power cut leaves at most one block that was under way, and some file systems fill up with zeros::

    | block | block | block | blo              torn: cut
    | block | block | block | blo 00 00 00     torn, and filled up: cut
    | block | block | ??? ... | block | ...    damaged in the middle: refused, for what comes behind is evidence too

Only the lengths are looked at, so a gigabyte takes seconds.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal

from dalycapture.errors import CaptureError
from dalycapture.file_numbers import (
    BYTE_ORDER_MAGIC,
    ENHANCED_PACKET,
    MAX_BLOCK,
    MAX_PACKET,
    MICROSECONDS,
    NANOSECONDS,
    SECTION_HEADER,
)

if TYPE_CHECKING:
    from typing import BinaryIO

_PIECE: Final = 1 << 20
_SHOWN: Final = 4096
_LONGEST_PACKET: Final = 262144  # of a classic pcap, as writers keep to
_SECTION_MAGIC: Final = struct.pack("<I", SECTION_HEADER)  # the same from both ends
_PCAP_ORDERS: Final = {
    struct.pack(order + "I", magic): order for order in "<>" for magic in (MICROSECONDS, NANOSECONDS)
}


@dataclass(frozen=True, slots=True)
class Whole:
    """What is whole of a capture file."""

    file_format: Literal["pcapng", "pcap", ""]
    """Empty: nothing is."""
    end: int
    """Bytes up to the end of the last whole block or packet."""
    head: bytes
    """The first 24 bytes."""
    torn: bytes
    """What comes behind, without zeros at its end, at most 4096 bytes of it."""
    torn_size: int
    """How many bytes come behind, with the zeros."""


class _Window:
    """The file in pieces, seen forward; memory holds one piece."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._data = b""
        self._start = 0

    def at(self, offset: int, size: int) -> bytes:
        """Return size bytes at this offset, less at the end of the file."""
        if not self._start <= offset <= offset + size <= self._start + len(self._data):
            self._file.seek(offset)
            self._data, self._start = self._file.read(max(size, _PIECE)), offset
        return self._data[offset - self._start : offset - self._start + size]


def find_end(file: BinaryIO, name: str, size: int) -> Whole:
    """Find the end of what is whole in a capture of this size, open at its beginning.

    Raises CaptureError where it is no capture, or is damaged before its end.
    """
    window = _Window(file)
    head = window.at(0, 24)
    if head[:4] == _SECTION_MAGIC:
        file_format, (end, order) = "pcapng", _blocks(window, size)
    elif head[:4] in _PCAP_ORDERS:
        file_format, order = "pcap", _PCAP_ORDERS[head[:4]]
        end = _packets(window, order, size)
    elif any(magic.startswith(head[:4].rstrip(b"\0")) for magic in (_SECTION_MAGIC, *_PCAP_ORDERS)):
        file_format, end, order = "", 0, "<"
    else:
        raise CaptureError(f"{name} is not a pcapng or pcap file, so nothing can be appended; choose another name")
    left = _left(file, end)
    if left and not _is_torn(left, size - end, order, file_format):
        raise CaptureError(
            f"{name} is damaged at byte {end} of {size}, not only at its end, so it is left as it is; "
            f"write to another file (dalyshark reframe saves what can be read)"
        )
    return Whole(file_format if end else "", end, head if end else b"", left[:_SHOWN], size - end)


def _blocks(window: _Window, size: int) -> tuple[int, str]:
    """Walk the blocks of a pcapng file; where the last whole one ends, and the byte order there."""
    at, order = 0, "<"
    while len(head := window.at(at, 12)) == 12:
        if head[:4] == _SECTION_MAGIC:
            # The smaller length is the right one, also where the magic behind it never came.
            order = min("<>", key=lambda order: struct.unpack(order + "I", head[4:8]))
            if struct.unpack(order + "I", head[8:12])[0] != BYTE_ORDER_MAGIC:
                break
        total: int = struct.unpack_from(order + "I", head, 4)[0]
        if total < 12 or total % 4 or total > MAX_BLOCK or at + total > size:
            break
        if window.at(at + total - 4, 4) != head[4:8]:
            break
        at += total
    return at, order


def _packets(window: _Window, order: str, size: int) -> int:
    """Walk the packets of a classic pcap; where the last whole one ends."""
    if size < 24:
        return 0
    at = 24
    while len(head := window.at(at, 16)) == 16:
        captured: int = struct.unpack_from(order + "I", head, 8)[0]
        if captured > MAX_PACKET or at + 16 + captured > size or not head.strip(b"\0"):
            break
        at += 16 + captured
    return at


def _left(file: BinaryIO, end: int) -> bytes:
    """Read what comes behind, without the zeros at its end: at most one byte more than any block has."""
    file.seek(end)
    left = b""
    offset = 0
    while piece := file.read(_PIECE):
        if solid := piece.rstrip(b"\0"):
            if offset + len(solid) > MAX_BLOCK:
                return left.ljust(MAX_BLOCK + 1, b"\xff")
            left = left.ljust(offset, b"\0") + solid
        offset += len(piece)
    return left


def _is_torn(left: bytes, size: int, order: str, file_format: str) -> bool:
    """Tell whether what is left (its zeros at the end cut off; size: with them) is the beginning of one block."""
    if len(left) < 8:
        return True
    if file_format == "pcapng":
        total: int = struct.unpack_from(order + "I", left, 4)[0]
        # The length at the end is the last that is written, and its upper bytes may be zero.
        unfinished = 12 <= total <= MAX_BLOCK and not total % 4 and (size < total or len(left) < total - 3)
        return unfinished and not _has_block(left, order)
    if file_format == "pcap":
        if len(left) < 16 or size < 24:
            return True
        captured: int = struct.unpack_from(order + "I", left, 8)[0]
        return captured <= _LONGEST_PACKET and size < 16 + captured
    return size < 28  # a section header, or a file header, that never became whole


def _has_block(left: bytes, order: str) -> bool:
    """Tell whether a whole packet block stands in there: then a length was damaged, and nothing is torn."""
    mark = struct.pack(order + "I", ENHANCED_PACKET)
    at = left.find(mark, 4)
    while at >= 0:
        if len(left) >= at + 12:
            total: int = struct.unpack_from(order + "I", left, at + 4)[0]
            if 32 <= total <= MAX_BLOCK and left[at + total - 4 : at + total] == left[at + 4 : at + 8]:
                return True
        at = left.find(mark, at + 1)
    return False
