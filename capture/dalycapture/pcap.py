# SPDX-License-Identifier: GPL-2.0-or-later
"""Classic pcap, written and read (draft-ietf-opsawg-pcap), for tools that know nothing newer.

File header, 24 bytes, then records, all in the byte order that the magic shows::

    0        4        6        8          12          16           20          24
    | magic  | major  | minor  | reserved | reserved  | snap length| link type |      magic A1B2C3D4: microseconds
    | seconds         | fraction          | captured  | original   | data ...         magic A1B23C4D: nanoseconds

It has no place for interfaces, flags, comments or statistics: an event is a packet without bytes.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final

from dalycapture.captured import CapturedPacket, Told
from dalycapture.errors import CaptureError, TruncatedError
from dalycapture.file_numbers import MAX_PACKET, MICROSECONDS, NANOSECONDS
from dalycapture.interface import Interface
from dalycapture.linktype import link_type_name
from dalycapture.writer import CaptureWriter, counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalycapture.output import Output
    from dalycapture.source import Source

SNAP_LENGTH: Final = 262144

_HEADER = "IHHIIII"
_RECORD = "IIII"


_MOST_SECONDS: Final = 0xFFFFFFFF


class PcapWriter(CaptureWriter):
    """Writes classic pcap, little-endian, one packet a write."""

    def __init__(self, output: Output, *, nanoseconds: bool = True, wait_when_full: bool = False) -> None:
        super().__init__(output, wait_when_full=wait_when_full)
        self._magic = NANOSECONDS if nanoseconds else MICROSECONDS
        self._unit = 1 if nanoseconds else 1000
        self._link_type: int | None = None

    def _introduction(self, interface: Interface, *, first: bool) -> list[bytes]:
        """Lay out the file header, at the first interface; others must be of the same link type."""
        if self._link_type not in {None, interface.link_type}:
            message = (
                f"classic pcap holds one link type, not both {link_type_name(self._link_type or 0)} and "
                f"{link_type_name(interface.link_type)}; write pcapng"
            )
            raise CaptureError(message)
        self._link_type = interface.link_type
        if not first:
            return []
        appended = self._appended()
        if appended and appended.end:
            self._go_on_behind(appended.head, interface.link_type)
            return []
        return [struct.pack("<" + _HEADER, self._magic, 2, 4, 0, 0, SNAP_LENGTH, interface.link_type)]

    def _go_on_behind(self, head: bytes, link_type: int) -> None:
        """Take over the unit of time of the header that is there. Raises CaptureError where packets can't follow it."""
        magic, *_, there = struct.unpack("<" + _HEADER, head)
        if magic not in {NANOSECONDS, MICROSECONDS}:
            raise CaptureError(f"{self.output.name} is in another byte order, so nothing can follow; use another name")
        if there & 0xFFFF != link_type:
            message = f"{self.output.name} holds link type {link_type_name(there & 0xFFFF)}, and classic pcap only one"
            raise CaptureError(f"{message}; use another name")
        self._unit = 1 if magic == NANOSECONDS else 1000

    def _packet(self, time_ns: int, data: bytes, *, interface: int, flags: int, comment: str, dropped: int) -> bytes:
        del interface, flags, comment, dropped  # no place for them
        seconds, rest = divmod(time_ns, 1_000_000_000)
        if seconds > _MOST_SECONDS:
            seconds = rest = 0  # the format has 32 bits for them: better no time than a wrong one
        return struct.pack("<" + _RECORD, seconds, rest // self._unit, len(data), len(data)) + data

    def write_statistics(
        self, interface: int, *, start_ns: int, end_ns: int, received: int, dropped: int, os_dropped: int = 0
    ) -> None:
        """Do nothing: the format has no place for them."""


def read_pcap(source: Source, told: Told | None = None) -> Iterator[CapturedPacket]:
    """Yield the packets of a classic pcap stream, numbered from 1.

    Raises CaptureError where the file is damaged, TruncatedError where it ends in the middle of a packet; what was
    whole before that point has been yielded.
    """
    number = 0

    def cut_off(what: str) -> TruncatedError:
        return TruncatedError(
            f"{source.name}: cut off in the middle of {what} at byte {source.offset}, "
            f"after {counted(number, 'whole packet')}"
        )

    head = source.read(24)
    if len(head) < 24:
        raise cut_off("its header")
    order, unit = next(
        (order, unit)
        for order in "<>"
        for magic, unit in ((NANOSECONDS, 1), (MICROSECONDS, 1000))
        if head[:4] == struct.pack(order + "I", magic)
    )
    *_, link_type = struct.unpack(order + _HEADER, head)
    link_type &= 0xFFFF  # the upper half says how long a frame check sequence is
    if told:
        told.interface(Interface(link_type=link_type))
    while head := source.read(16):
        if len(head) < 16:
            raise cut_off("a packet")
        seconds, fraction, captured, _ = struct.unpack(order + _RECORD, head)
        if captured > MAX_PACKET:
            message = (
                f"{source.name}: damaged near byte {source.offset}, after {counted(number, 'whole packet')}: "
                f"a packet of {captured} bytes"
            )
            raise CaptureError(message)
        data = source.read(captured)
        if len(data) < captured:
            raise cut_off("a packet")
        number += 1
        yield CapturedPacket(
            number=number,
            time_ns=seconds * 1_000_000_000 + fraction * unit,
            data=data,
            link_type=link_type,
        )
