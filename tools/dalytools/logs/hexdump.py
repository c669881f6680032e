# SPDX-License-Identifier: GPL-2.0-or-later
"""Hex dumps with offsets: what ``xxd``, ``hexdump`` and ``od`` print of a binary file, and Wireshark of a packet.

    00000000: a540 9008 0000 0000 0000 0000 7da5 0190  .@..........}...       xxd
    00000000  a5 40 90 08 00 00 00 00  00 00 00 00 7d a5 01 90  |.@......|    hexdump -C; * repeats the line before
    0000000 40a5 0890 0000 0000 0000 0000 a57d 9001                           hexdump, od -t x2: words, low byte first
    000000 a5 40 90 08 00 00 00 00                                            od -A x -t x1; od -t x1 counts in octal
    0000   a5 40 90 08 00 00 00 00   .@......                                 Wireshark; the next packet begins at 0

No times: the bytes follow each other. An offset that goes on elsewhere than the bytes did is a line not understood.
Source: those programs.
"""

from __future__ import annotations

import re
from typing import Final

from dalytools.logs.entry import Entry, PlainLineLog

_LINE = re.compile(
    r"\s*(?:0x)?(?P<at>[0-9A-Fa-f]{4,16})(?P<colon>:?)[ \t]+"
    r"(?P<hex>(?:[0-9A-Fa-f]{2}){1,2}(?:[ ]{1,2}(?:[0-9A-Fa-f]{2}){1,2})*)[ ]*"
    r"(?P<ascii>(?:[ ]{2,}|\||>).*)?"
)
_END = re.compile(r"\s*[0-9A-Fa-f]{4,16}:?\s*")
_MOST_REPEATED: Final = 1 << 20  # bytes
_SHORT: Final = 5  # digits; so short ones are offsets only where a dump begins at 0


class HexDump(PlainLineLog):
    """A dump of one binary file, or of packets."""

    name = "hexdump"
    about = "dumps with offsets: xxd, hexdump, od"
    gaps = False

    def __init__(self) -> None:
        self._next: int | None = None
        self._before = b""
        self._starred = False
        self._base = 16
        self._last = b""  # of words: waits, for the last may be filled up
        self._words = False

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        if line.strip() == "*" and self._before:
            self._starred = True
            return []
        if _END.fullmatch(line):
            return self._ended(line.strip().rstrip(":"))
        found = _LINE.fullmatch(line)
        if not found:
            return None
        tokens = found["hex"].split()
        words = not found["colon"] and len(tokens[0]) == 4
        data = b"".join(bytes.fromhex(token)[:: -1 if words else 1] for token in tokens)
        at = self._offset(found["at"])
        if len(data) > 64 or (self._next is None and at and len(found["at"]) <= _SHORT):
            return None
        if at == 0 and not self._starred:
            self._next = None  # another dump
        filled = self._filled(at)
        if filled is None:
            return None
        self._next = at + len(data)
        self._before = data
        self._words = words
        entries = [*self.finish(), *filled]
        if words:
            self._last = data
            return entries
        return [*entries, Entry(data)]

    def finish(self) -> list[Entry]:
        """Hand out the last words."""
        last, self._last = self._last, b""
        return [Entry(last)] if last else []

    def _offset(self, text: str) -> int:
        if self._base == 16 and self._next is not None and set(text) <= set("01234567") and int(text, 8) == self._next:
            self._base = 8 if int(text, 16) != self._next else 16
        try:
            return int(text, self._base)
        except ValueError:
            return -1

    def _ended(self, text: str) -> list[Entry] | None:
        """Take the offset behind the last byte: of words, it tells whether the last was half a word."""
        at = self._offset(text)
        if self._words and self._last and self._next is not None and at == self._next - 1:
            self._last, self._next = self._last[:-1], at
        filled = self._filled(at)
        return None if filled is None else [*self.finish(), *filled]

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
