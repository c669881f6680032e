# SPDX-License-Identifier: GPL-2.0-or-later
"""pcapng, written and read (draft-ietf-opsawg-pcapng; section numbers below are the draft's).

Every block (3.1), padded to 32 bits, in the byte order of its section::

    0         4              8                                    total-4      total
    | type    | total length | body                               | total length |

    Section Header, 4.1           0A0D0D0A | magic 1A2B3C4D, version 1.0, section length -1, options
    Interface Description, 4.2    00000001 | link type u16, reserved u16, snap length u32, options
    Packet (obsolete), App. A     00000002 | interface u16, drops u16, time high, low, captured, original, data, options
    Simple Packet, 4.4            00000003 | original length, data
    Interface Statistics, 4.6     00000005 | interface u32, time high, low, options
    Enhanced Packet, 4.3          00000006 | interface u32, time high, low, captured, original, data, options

Options (3.5): code u16, length u16, value padded to 32 bits; code 0 ends them, code 1 is a comment.

epb_flags (4.3.1), what we use of it::

    bit   0-1   direction: 00 not known, 01 inbound, 10 outbound
    bit   24    CRC error            <- bad_checksum
    bit   25    packet too long
    bit   26    packet too short     <- short
    bit   31    symbol error

A capture is hostile input: every length is checked against its block, and a block against 16 MiB, before it is read.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dalycapture.captured import CapturedPacket, Statistics, Told, possible
from dalycapture.errors import CaptureError, TruncatedError
from dalycapture.file_numbers import (
    BYTE_ORDER_MAGIC,
    ENHANCED_PACKET,
    INTERFACE_DESCRIPTION,
    INTERFACE_STATISTICS,
    MAX_BLOCK,
    NUMBERED_BLOCKS,
    OBSOLETE_PACKET,
    SECTION_HEADER,
    SIMPLE_PACKET,
)
from dalycapture.interface import Interface
from dalycapture.writer import CaptureWriter, counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalycapture.output import Output
    from dalycapture.source import Source
    from dalyref.packet import Direction

MOST_INTERFACES: Final = 16384
"""Of a file: each is a bus of its own to its readers, with what they remember of it."""

END, COMMENT = 0, 1
SHB_HARDWARE, SHB_OS, SHB_APPLICATION = 2, 3, 4
IF_NAME, IF_DESCRIPTION, IF_SPEED, IF_TSRESOL, IF_TSOFFSET, IF_HARDWARE = 2, 3, 8, 9, 14, 15
EPB_FLAGS, EPB_DROPCOUNT = 2, 4  # the obsolete block has its flags under the same code
ISB_START, ISB_END, ISB_RECEIVED, ISB_DROPPED, ISB_OS_DROPPED = 2, 3, 4, 5, 7

INBOUND: Final = 1
OUTBOUND: Final = 2
CRC_ERROR: Final = 1 << 24
TOO_LONG: Final = 1 << 25
TOO_SHORT: Final = 1 << 26
SYMBOL_ERROR: Final = 1 << 31

DIRECTIONS: Final[tuple[Direction, ...]] = ("", "inbound", "outbound", "")

_SECTION = struct.Struct("<IHHq")
_INTERFACE = struct.Struct("<HHI")
_PACKET = struct.Struct("<IIIIIII")
_TOTAL = struct.Struct("<I")
_PADDING = (b"", bytes(3), bytes(2), bytes(1))  # by the length's last two bits
_STATISTICS = struct.Struct("<III")


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _block(block_type: int, body: bytes) -> bytes:
    total = len(body) + 12
    return struct.pack("<II", block_type, total) + body + struct.pack("<I", total)


def _option(code: int, value: bytes) -> bytes:
    return struct.pack("<HH", code, len(value)) + _padded(value)


def _text(code: int, text: str) -> bytes:
    """Lay out a text option; nothing for no text. Cut at 65535 bytes, between characters."""
    value = text.encode("utf-8", "replace")
    if len(value) > 0xFFFF:
        value = value[:0xFFFF].decode("utf-8", "ignore").encode()
    return _option(code, value) if value else b""


def _options(*options: bytes) -> bytes:
    laid_out = b"".join(options)
    return laid_out + bytes(4) if laid_out else b""


class PcapngWriter(CaptureWriter):
    """Writes pcapng: little-endian, nanoseconds, one block a write."""

    def __init__(
        self,
        output: Output,
        *,
        application: str = "dalyshark",
        hardware: str = "",
        os_name: str = "",
        wait_when_full: bool = False,
    ) -> None:
        super().__init__(output, wait_when_full=wait_when_full)
        self._about = (_text(SHB_HARDWARE, hardware), _text(SHB_OS, os_name), _text(SHB_APPLICATION, application))

    def _introduction(self, interface: Interface, *, first: bool) -> list[bytes]:
        """Lay out an Interface Description Block, the first behind the section's header."""
        options = _options(
            _text(IF_NAME, interface.name),
            _text(IF_DESCRIPTION, interface.description),
            _option(IF_SPEED, struct.pack("<Q", interface.speed)) if interface.speed else b"",
            _option(IF_TSRESOL, b"\x09"),
            _text(IF_HARDWARE, interface.hardware),
        )
        described = _block(INTERFACE_DESCRIPTION, _INTERFACE.pack(interface.link_type, 0, 0) + options)
        if not first:
            return [described]
        about = _options(*self._about, _text(COMMENT, self.origin))
        return [_block(SECTION_HEADER, _SECTION.pack(BYTE_ORDER_MAGIC, 1, 0, -1) + about), described]

    def _packet(self, time_ns: int, data: bytes, *, interface: int, flags: int, comment: str, dropped: int) -> bytes:
        options = b""
        if flags or comment or dropped:
            options = _options(
                _option(EPB_FLAGS, struct.pack("<I", flags)) if flags else b"",
                _option(EPB_DROPCOUNT, struct.pack("<Q", dropped)) if dropped else b"",
                _text(COMMENT, comment),
            )
        size = len(data)
        padding = _PADDING[size & 3]
        total = _PACKET.size + size + len(padding) + len(options) + _TOTAL.size
        head = _PACKET.pack(ENHANCED_PACKET, total, interface, time_ns >> 32, time_ns & 0xFFFFFFFF, size, size)
        return b"".join((head, data, padding, options, _TOTAL.pack(total)))

    def write_statistics(
        self, interface: int, *, start_ns: int, end_ns: int, received: int, dropped: int, os_dropped: int = 0
    ) -> None:
        """Write an Interface Statistics Block (its times are two 32-bit halves, the high one first)."""
        options = _options(
            _option(ISB_START, struct.pack("<II", start_ns >> 32, start_ns & 0xFFFFFFFF)),
            _option(ISB_END, struct.pack("<II", end_ns >> 32, end_ns & 0xFFFFFFFF)),
            _option(ISB_RECEIVED, struct.pack("<Q", received)),
            _option(ISB_DROPPED, struct.pack("<Q", dropped)),
            _option(ISB_OS_DROPPED, struct.pack("<Q", os_dropped)) if os_dropped else b"",
        )
        head = _STATISTICS.pack(interface, end_ns >> 32, end_ns & 0xFFFFFFFF)
        self._write(_block(INTERFACE_STATISTICS, head + options))


@dataclass(slots=True)
class Side:
    """An interface as read."""

    number: int  # over the whole file
    link_type: int
    snap_length: int
    name: str = ""
    description: str = ""
    hardware: str = ""
    speed: int = 0
    resolution: int = 6  # if_tsresol
    offset_s: int = 0

    def nanoseconds(self, ticks: int) -> int:
        """Return a time stamp in ns since 1970 UTC; 0 where it is no possible time."""
        power = self.resolution & 0x7F
        scaled = ticks * 1_000_000_000
        since = scaled >> power if self.resolution & 0x80 else scaled // 10**power
        return possible(since + self.offset_s * 1_000_000_000)


class PcapngReader:
    """State of reading: the section's byte order and interfaces, and the count of packets over the file.

    Who reads most blocks otherwise gives the others to it: as another ``source``, with the ``number`` counted so far.
    """

    def __init__(self, source: Source, told: Told) -> None:
        self.source = source
        self.told = told
        self.order = "<"
        self.sides: list[Side] = []
        self.interfaces = 0
        self.number = 0

    def packets(self) -> Iterator[CapturedPacket]:
        """Yield the packets of the blocks of ``source``; see ``read_pcapng``."""
        while head := self._read(8, at_start=True):
            if head[:4] == b"\x0a\x0d\x0d\x0a":
                self._section(head)
                continue
            block_type, total = struct.unpack(self.order + "II", head)
            body = self._body(total)
            if block_type == ENHANCED_PACKET:
                yield self._enhanced(body)
            elif block_type == INTERFACE_DESCRIPTION:
                self._interface(body)
            elif block_type == SIMPLE_PACKET:
                yield self._simple(body)
            elif block_type == OBSOLETE_PACKET:
                yield self._obsolete(body)
            elif block_type == INTERFACE_STATISTICS:
                self._statistics(body)
            elif block_type in NUMBERED_BLOCKS:
                self.number += 1

    def _read(self, size: int, *, at_start: bool = False) -> bytes:
        """Read exactly size bytes; at the start of a block the file may end instead."""
        data = self.source.read(size)
        if len(data) == size or (at_start and not data):
            return data
        message = (
            f"{self.source.name}: cut off in the middle of a block at byte {self.source.offset}, "
            f"after {counted(self.number, 'whole packet')}"
        )
        raise TruncatedError(message)

    def _damaged(self, what: str) -> CaptureError:
        return CaptureError(
            f"{self.source.name}: damaged near byte {self.source.offset}, "
            f"after {counted(self.number, 'whole packet')}: {what}"
        )

    def _body(self, total: int, done: int = 8) -> bytes:
        """Read what is left of a block of which ``done`` bytes are read; its trailing length is checked and cut off."""
        if total < done + 4 or total % 4 or total > MAX_BLOCK:
            raise self._damaged(f"a block of {total} bytes")
        rest = self._read(total - done)
        if struct.unpack(self.order + "I", rest[-4:])[0] != total:
            raise self._damaged("the two lengths of a block differ")
        return rest[:-4]

    def _section(self, head: bytes) -> None:
        magic = self._read(4)
        orders = {struct.pack(order + "I", BYTE_ORDER_MAGIC): order for order in "<>"}
        if magic not in orders:
            raise self._damaged("a section header without its byte-order magic")
        self.order = orders[magic]
        body = self._body(struct.unpack(self.order + "I", head[4:])[0], done=12)
        if len(body) < 12:
            raise self._damaged("a section header that is too short")
        major, minor = struct.unpack_from(self.order + "HH", body)
        if major != 1:
            message = f"{self.source.name}: pcapng version {major}.{minor} is not known; version 1 can be read"
            raise CaptureError(message)
        self.sides = []

    def _options(self, body: bytes, at: int) -> Iterator[tuple[int, bytes]]:
        """Yield (code, value) up to the end-of-options option or the end of the block."""
        unpack = struct.Struct(self.order + "HH").unpack_from
        while at + 4 <= len(body):
            code, length = unpack(body, at)
            at += 4
            if code == END:
                return
            if at + length > len(body):
                raise self._damaged("an option longer than its block")
            yield code, body[at : at + length]
            at += length + -length % 4

    def _interface(self, body: bytes) -> None:
        if len(body) < 8:
            raise self._damaged("an interface description that is too short")
        if self.interfaces >= MOST_INTERFACES:
            raise self._damaged(f"more than {MOST_INTERFACES} interfaces, as no program writes them")
        link_type, _, snap_length = struct.unpack_from(self.order + "HHI", body)
        side = Side(self.interfaces, link_type, snap_length)
        for code, value in self._options(body, 8):
            if code == IF_NAME:
                side.name = _decoded(value)
            elif code == IF_DESCRIPTION:
                side.description = _decoded(value)
            elif code == IF_TSRESOL and len(value) == 1:
                side.resolution = value[0]
            elif code == IF_TSOFFSET and len(value) == 8:
                side.offset_s = struct.unpack(self.order + "q", value)[0]
            elif code == IF_SPEED and len(value) == 8:
                side.speed = struct.unpack(self.order + "Q", value)[0]
            elif code == IF_HARDWARE:
                side.hardware = _decoded(value)
        self.interfaces += 1
        self.sides.append(side)
        self.told.interface(Interface(side.name, side.description, link_type, side.speed, side.hardware))

    def _statistics(self, body: bytes) -> None:
        interface: int = struct.unpack_from(self.order + "I", body)[0] if len(body) >= 12 else len(self.sides)
        if interface >= len(self.sides):
            return  # no packet depends on it
        side = self.sides[interface]
        values: dict[int, int] = {}
        for code, value in self._options(body, 12):
            if len(value) == 8:
                high, low = struct.unpack(self.order + "II", value)
                at: int = struct.unpack(self.order + "Q", value)[0]
                values[code] = side.nanoseconds(high << 32 | low) if code in {ISB_START, ISB_END} else at
        codes = (ISB_START, ISB_END, ISB_RECEIVED, ISB_DROPPED, ISB_OS_DROPPED)
        self.told.statistics(Statistics(side.number, *(values.get(code) for code in codes)))

    def _side(self, interface: int) -> Side:
        if interface >= len(self.sides):
            raise self._damaged(f"a packet of interface {interface}, which is not described")
        return self.sides[interface]

    def _enhanced(self, body: bytes) -> CapturedPacket:
        if len(body) < 20:
            raise self._damaged("a packet block that is too short")
        interface, high, low, captured, _ = struct.unpack_from(self.order + "IIIII", body)
        return self._made(self._side(interface), high << 32 | low, body, captured)

    def _obsolete(self, body: bytes) -> CapturedPacket:
        if len(body) < 20:
            raise self._damaged("a packet block that is too short")
        interface, _, high, low, captured, _ = struct.unpack_from(self.order + "HHIIII", body)
        return self._made(self._side(interface), high << 32 | low, body, captured)

    def _simple(self, body: bytes) -> CapturedPacket:
        if len(body) < 4:
            raise self._damaged("a packet block that is too short")
        side = self._side(0)
        original: int = struct.unpack_from(self.order + "I", body)[0]
        captured = min(original, side.snap_length or original)
        if 4 + captured > len(body):
            raise self._damaged("a packet longer than its block")
        self.number += 1
        return CapturedPacket(
            number=self.number,
            time_ns=0,  # the block has no time
            data=body[4 : 4 + captured],
            interface=side.number,
            description=side.description,
            link_type=side.link_type,
        )

    def _made(self, side: Side, ticks: int, body: bytes, captured: int) -> CapturedPacket:
        end = 20 + captured
        if end > len(body):
            raise self._damaged("a packet longer than its block")
        comments: list[str] = []
        direction: Direction = ""
        flags: int = 0
        dropped: int = 0
        for code, value in self._options(body, end + -captured % 4):
            if code == COMMENT:
                comments.append(_decoded(value))
            elif code == EPB_FLAGS and len(value) == 4:
                flags = struct.unpack(self.order + "I", value)[0]
                direction = DIRECTIONS[flags & 3]
            elif code == EPB_DROPCOUNT and len(value) == 8:
                dropped = struct.unpack(self.order + "Q", value)[0]
        self.number += 1
        return CapturedPacket(
            number=self.number,
            time_ns=side.nanoseconds(ticks),
            data=body[20:end],
            interface=side.number,
            description=side.description,
            direction=direction,
            comment="\n".join(comments),
            link_type=side.link_type,
            flags=flags,
            dropped=dropped,
        )


def _decoded(value: bytes) -> str:
    return value.decode("utf-8", "replace").rstrip("\x00")


def read_pcapng(source: Source, told: Told | None = None) -> Iterator[CapturedPacket]:
    """Yield the packets of a pcapng stream, in order, numbered from 1 as Wireshark numbers them.

    ``Packet.interface`` counts the interfaces of the whole file, over its sections. A Simple Packet has no time: 0.
    Raises CaptureError where the file is damaged, TruncatedError where it ends in the middle of a block; what was whole
    before that point has been yielded.
    """
    return PcapngReader(source, told or Told()).packets()
