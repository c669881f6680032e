# SPDX-License-Identifier: GPL-2.0-or-later
"""The text logs of ``candump -L`` (can-utils), read as SocketCAN packets: Wireshark opens them too.

    (1700000000.123456) can0 18904001#01070000753002BC
     seconds             bus  identifier#data, hex

Identifier: three digits are standard, eight extended (or, above 1FFFFFFF, with SocketCAN's flags). ``#R`` is a remote
frame, with its length behind; ``##F`` CAN FD with a digit of flags. A log is one interface, whatever its buses are
called, and each line is one packet, as Wireshark numbers them.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from dalycapture.captured import CapturedPacket
from dalycapture.errors import CaptureError
from dalycapture.interface import Interface
from dalycapture.socketcan import EXTENDED, FLEXIBLE, REMOTE, pack

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalycapture.captured import Told
    from dalycapture.source import Source

LINK_TYPE: Final = 227
LONGEST_LINE: Final = 512

_LINE = re.compile(
    rb"\((\d{1,12})\.(\d{1,9})\)[ \t]+(\S{1,64})[ \t]+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#"
    rb"(?:(R)([0-8])?|#([0-9A-Fa-f])((?:[0-9A-Fa-f]{2}){0,64})|((?:[0-9A-Fa-f]{2}){0,8}))(?:[ \t]+[RT])?[ \t]*\r?\n?"
)


def looks_like(start: bytes) -> bool:
    """Tell a log by its first line."""
    return re.match(rb"\(\d{1,12}\.\d{1,9}\)[ \t]", start) is not None


def read_candump(source: Source, told: Told | None = None) -> Iterator[CapturedPacket]:
    """Yield the lines of a log as packets of link type 227. Raises CaptureError at a line that is none."""
    if told:
        told.interface(Interface(link_type=LINK_TYPE))
    number = 0
    for line in source.lines(LONGEST_LINE):
        if not line.strip():
            continue
        found = _LINE.fullmatch(line)
        if found is None:
            raise CaptureError(f"{source.name}: line {number + 1} is no line of candump -L: (time) bus identifier#data")
        number += 1
        seconds, fraction, _, identifier, remote, length, flags, flexible, data = found.groups()
        value = int(identifier, 16) | (EXTENDED if len(identifier) == 8 else 0)
        content = bytes.fromhex((flexible or data or b"").decode())
        if remote:
            packet = pack(value | REMOTE, bytes(int(length or b"0")))
        else:
            packet = pack(value, content, FLEXIBLE | int(flags, 16) if flags else 0)
        time_ns = int(seconds) * 1_000_000_000 + int(fraction.ljust(9, b"0"))
        yield CapturedPacket(number=number, time_ns=time_ns, data=packet, link_type=LINK_TYPE)
