# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes in hex, line by line, with or without times and directions in front.

What RealTerm, HTerm and CoolTerm save when they show hex (RealTerm: "Capture", with its time stamps; HTerm: "Save
output"; CoolTerm: "Capture to text file" with "View hex"), PuTTY-like loggers, Arduino sketches, what people paste into
issues, and the hex logs of docs/hexlogs.md::

    A5 40 90 08 00 00 00 00 00 00 00 00 7D          A540900800000000000000007D
    [12:34:56.789] TX: A5 40 90 08 ..               2026-11-21 12:34:56.789, A5,01,90 ..
    Received: a5:01:90:08:..                        -> 0xA5 0x40 0x90 0x08 ..

Sources: those programs' manuals, and lines of many public issues; no one of them fixes more than this.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog
from dalytools.logs.hexbytes import hex_bytes, literal_bytes
from dalytools.logs.stamps import split_stamp

if TYPE_CHECKING:
    from dalyref.packet import Direction

_OUT_WORDS = r"TX[DB]?|SENT|SEND(?:ING)?|WRITE|WROTE|WRITING|OUT|REQ(?:UEST)?|>{2,3}|-{1,2}>|=>|>"
_IN_WORDS = r"RX[DB]?|RECV|RECEIVED?|RECEIVING|READ(?:ING)?|IN|RES(?:P(?:ONSE)?)?|REPLY|<{2,3}|<-{1,2}|<=|<"
_DIRECTION = re.compile(
    rf"[ \t]*[\[(]?(?:(?P<out>{_OUT_WORDS})|(?P<in>{_IN_WORDS}))(?:[ _]?(?:HEX|DATA|BYTES|FRAME))?(?:[ ]?\(?\d+\)?)?"
    r"(?=[\s\]):=>]|$)[\])]?[ \t]*[:=>]?[ \t]*",
    re.IGNORECASE,
)
_COMMENT = re.compile(r"\s*(?:#|//|;|--)")


def direction_of(text: str) -> tuple[Direction, str]:
    """Take a direction from the beginning of a line: which, and the rest."""
    found = _DIRECTION.match(text)
    if not found:
        return "", text
    return (OUT if found["out"] else IN), text[found.end() :]


class HexLines(PlainLineLog):
    """Lines of hex bytes."""

    name = "hex"
    about = "lines of hex bytes, with or without times and TX, RX: RealTerm, HTerm, CoolTerm, pasted logs"

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        if _COMMENT.match(line):
            return []
        if (data := hex_bytes(line)) is not None:
            return [Entry(data)]
        stamp, rest = split_stamp(line)
        direction, rest = direction_of(rest)
        if stamp is None and direction:
            stamp, rest = split_stamp(rest)
        data = hex_bytes(rest)
        if data is None:
            data = literal_bytes(rest) if rest.lstrip().startswith(("b'", 'b"', "bytearray(", "bytes(")) else None
        return None if data is None else [Entry(data, stamp, direction)]
