# SPDX-License-Identifier: GPL-2.0-or-later
"""CAN frames with what is secret blanked, told by the identifier alone.

18 id dst src      classic: the eight bytes of A5
0400 .. 040E       HKMS: the bytes that protocol.md names; 040C is the clock
any other          nobody explains it: blanked
error frames       of the controller, not of the bus: kept
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalycapture import socketcan
from dalyref import can_classic, can_foreign, can_hkms
from dalytools.redact.what import What

if TYPE_CHECKING:
    from dalytools.redact.a5_data import A5Data
    from dalytools.redact.blanker import Blanker

_HEAD: Final = 8
_CLOCK: Final = 0x040C
_NAMED: Final = {
    0x0400: 7,
    0x0401: 8,
    0x0402: 7,
    0x0403: 8,
    0x0404: 8,
    0x0405: 5,
    0x0406: 5,
    0x0407: 3,
    0x0408: 8,
    0x0409: 8,
    0x040A: 8,
    0x040B: 3,
    0x040D: 7,
    0x040E: 8,
}
"""Of HKMS: so many bytes, from the first, have a meaning."""


def blank(packet: bytes, interface: int, a5: A5Data, blanker: Blanker) -> bytes:
    """Blank a SocketCAN packet. interface: whose frames remember each other."""
    head, rest = packet[:_HEAD], packet[_HEAD:]
    frame = socketcan.unpack(packet)
    if len(head) >= 4 and int.from_bytes(head[:4]) & socketcan.ERROR:
        return packet
    if frame is None:
        return head + blanker.whole(rest, What.FOREIGN, "CAN FD and other frames")
    data, behind = rest[: len(frame.data)], rest[len(frame.data) :]
    behind = blanker.whole(behind, What.UNKNOWN, "behind CAN frames")
    if not data:
        return head + behind
    return head + _content(frame, interface, a5, blanker) + behind


def _content(frame: socketcan.Frame, interface: int, a5: A5Data, blanker: Blanker) -> bytes:
    identifier, data = frame.identifier, frame.data
    if not frame.extended:
        return blanker.whole(data, What.FOREIGN, "other CAN frames")
    if can_hkms.is_streamed(identifier) or can_hkms.is_write(identifier):
        return _hkms(identifier, data, blanker)
    if not can_classic.fits(identifier):
        name = can_foreign.name(identifier, extended=True)
        new = blanker.whole(data, What.FOREIGN, name or "other CAN frames")
        if identifier == can_hkms.KEEP_ALIVE and new != data and not any(new):
            return b"\x01" + new[1:]  # it was no keep-alive, and must not become one
        return new
    data_id, source = can_classic.data_id(identifier), identifier & 0xFF
    where = f"CAN 0x{data_id:02X}"
    if len(data) != 8:
        return blanker.whole(data, What.UNKNOWN, where)
    if can_classic.is_host(source):
        return a5.request(data_id, data, where)
    return a5.reply(data_id, data, ("can", interface, source), where)


def _hkms(identifier: int, data: bytes, blanker: Blanker) -> bytes:
    number = can_hkms.register(identifier)
    where = f"HKMS register 0x{number:04X}"
    written = number in can_hkms.WRITES
    named = 2 if written else _NAMED.get(number, 0)
    if number == _CLOCK:
        return blanker.spans(data, [(0, len(data) - 1, What.CLOCK)], where)
    spans: list[tuple[int, int, What | None]] = [(0, named - 1, None)] if named else []
    return blanker.spans(data, [*spans, (named, len(data) - 1, What.UNKNOWN)], where)
