# SPDX-License-Identifier: GPL-2.0-or-later
"""btsnoop files, as Android and BlueZ (``btmon -w``) write them, read as HCI packets of the link types of pcap.

    file     "btsnoop" 00 | version u32 = 1 | kind u32                                    numbers high byte first
    packet   original length u32 | captured length u32 | flags u32 | drops u32 | time i64 | data

Time is in microseconds since the year 0; 00E03AB44A676000 is 1 January 2000. Of kinds 1001 and 1002 (H1, H4) bit 0 of
the flags is set for received packets, and bit 1 for commands and events; of kind 2001 (monitor) the flags are adapter
and opcode, 16 bits each.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final

from dalycapture.captured import CapturedPacket, possible
from dalycapture.errors import CaptureError, TruncatedError
from dalycapture.interface import Interface
from dalycapture.writer import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalycapture.captured import Told
    from dalycapture.source import Source

MAGIC: Final = b"btsnoop\0"
H1, H4, MONITOR = 1001, 1002, 2001
HCI_WITH_DIRECTION, LINUX_MONITOR = 201, 254
"""The link types that packets come as: 4 bytes direction in front of H4; 2 bytes adapter, 2 bytes opcode."""

_HEAD = struct.Struct(">II")
_RECORD = struct.Struct(">IIIIq")
_EPOCH_US: Final = 0x00DCDDB30F2F8000  # 1970 in microseconds since the year 0
_MAX_PACKET: Final = 1 << 20
_COMMAND, _ACL, _EVENT = b"\x01", b"\x02", b"\x04"


def _packet(kind: int, flags: int, data: bytes) -> tuple[int, bytes]:
    """Return a packet's link type and bytes."""
    if kind == MONITOR:
        return LINUX_MONITOR, flags.to_bytes(4) + data
    received = flags & 1
    if kind == H1:
        data = ((_EVENT if received else _COMMAND) if flags & 2 else _ACL) + data
    return HCI_WITH_DIRECTION, received.to_bytes(4) + data


def read_btsnoop(source: Source, told: Told | None = None) -> Iterator[CapturedPacket]:
    """Yield the packets of a btsnoop file. Raises CaptureError where it is damaged, TruncatedError where cut off."""
    head = source.read(16)
    if len(head) < 16:
        raise TruncatedError(f"{source.name}: cut off in the middle of its header, after {len(head)} bytes")
    version, kind = _HEAD.unpack_from(head, 8)
    if version != 1 or kind not in (H1, H4, MONITOR):
        raise CaptureError(
            f"{source.name}: btsnoop version {version}, kind {kind} is not known; 1001, 1002 and 2001 can be read"
        )
    if told:
        told.interface(Interface(link_type=LINUX_MONITOR if kind == MONITOR else HCI_WITH_DIRECTION))
    number = 0
    while record := source.read(_RECORD.size):
        length = _RECORD.unpack(record)[1] if len(record) == _RECORD.size else 0
        if length > _MAX_PACKET:
            raise CaptureError(
                f"{source.name}: damaged near byte {source.offset}, after {counted(number, 'whole packet')}: "
                f"a packet of {length} bytes"
            )
        data = source.read(length)
        if len(record) < _RECORD.size or len(data) < length:
            raise TruncatedError(
                f"{source.name}: cut off in the middle of a packet at byte {source.offset}, "
                f"after {counted(number, 'whole packet')}"
            )
        _, _, flags, _, time_us = _RECORD.unpack(record)
        number += 1
        link_type, whole = _packet(kind, flags, data)
        yield CapturedPacket(
            number=number, time_ns=possible((time_us - _EPOCH_US) * 1000), data=whole, link_type=link_type
        )
