# SPDX-License-Identifier: GPL-2.0-or-later
"""Hex dumps with offsets: what ``xxd``, ``hexdump -C`` and ``od -A x -t x1z`` print of a binary file.

    00000000: a540 9008 0000 0000 0000 0000 7da5 0190  .@..........}...       xxd
    00000000  a5 40 90 08 00 00 00 00  00 00 00 00 7d a5 01 90  |.@......|    hexdump -C; * repeats the line before
    000000 a5 40 90 08 00 00 00 00                                           od

No times: the bytes follow each other. An offset that goes on elsewhere than the bytes did is a line not understood.
Source: those programs.
"""

from __future__ import annotations

import re
from typing import Final

from dalytools.logs.entry import Entry, PlainLineLog

_LINE = re.compile(
    r"\s*(?:0x)?(?P<at>[0-9A-Fa-f]{6,16}):?[ \t]+"
    r"(?P<hex>(?:[0-9A-Fa-f]{2}){1,2}(?:[ ]{1,2}(?:[0-9A-Fa-f]{2}){1,2})*)[ ]*"
    r"(?P<ascii>(?:[ ]{2,}|\||>).*)?"
)
_END = re.compile(r"\s*[0-9A-Fa-f]{6,16}:?\s*")
_MOST_REPEATED: Final = 1 << 20  # bytes


class HexDump(PlainLineLog):
    """A dump of one binary file."""

    name = "hexdump"
    about = "dumps with offsets: xxd, hexdump -C, od"
    gaps = False

    def __init__(self) -> None:
        self._next: int | None = None
        self._before = b""
        self._starred = False

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        if line.strip() == "*" and self._before:
            self._starred = True
            return []
        if _END.fullmatch(line):
            return self._filled(int(line.strip().rstrip(":"), 16))
        found = _LINE.fullmatch(line)
        if not found:
            return None
        data = bytes.fromhex(found["hex"].replace(" ", ""))
        at = int(found["at"], 16)
        if len(data) > 64:
            return None
        filled = self._filled(at)
        if filled is None:
            return None
        self._next = at + len(data)
        self._before = data
        return [*filled, Entry(data)]

    def _filled(self, at: int) -> list[Entry] | None:
        """Fill what a star stood for; None where the offset does not fit."""
        expected = at if self._next is None else self._next
        starred, self._starred = self._starred, False
        if at == expected:
            return []
        missing = at - expected
        if not starred or not 0 < missing <= _MOST_REPEATED or missing % len(self._before):
            return None
        return [Entry(self._before * (missing // len(self._before)))]
