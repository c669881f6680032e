# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes in hex, line by line, with or without times and directions in front.

What RealTerm, HTerm and CoolTerm save when they show hex (RealTerm: "Capture", with its time stamps; HTerm: "Save
output"; CoolTerm: "Capture to text file" with "View hex"), PuTTY-like loggers, Arduino sketches, what people paste into
issues, and the hex logs of docs/hexlogs.md::

    A5 40 90 08 00 00 00 00 00 00 00 00 7D          A540900800000000000000007D
    [12:34:56.789] TX: A5 40 90 08 ..               2026-11-21 12:34:56.789, A5,01,90 ..
    Received: a5:01:90:08:..                        -> 0xA5 0x40 0x90 0x08 ..
    12:34:56 DEBUG bms: Sent 13 bytes: A5 40 ..     "2026-11-21 12:34:56";"TX";"A5 40 90 08 .."
    TX: [165, 64, 144, 8, ..]                       [a5][40][90][08]..   <Buffer a5 40 ..>
    2026-11-21 12:34:56.789:                        A5 40 90 08 ..   .@..
    A5 40 90 08 ..                                  12:34:56.789 -> A5 40 ..     Arduino's monitor: no direction

Sources: those programs' manuals, and lines of many public issues; no one of them fixes more than this.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog
from dalytools.logs.hexbytes import decimal_bytes, hex_bytes, literal_bytes
from dalytools.logs.stamps import split_stamp

if TYPE_CHECKING:
    from dalyref.packet import Direction
    from dalytools.logs.entry import Stamp

_OUT_WORDS = r"TX[DB]?|SENT|SEND(?:ING)?|WRITE|WROTE|WRITING|OUT|REQ(?:UEST)?|>{2,3}|-{1,3}>|=>|>"
_IN_WORDS = r"RX[DB]?|RECV|RECEIVED?|RECEIVING|READ(?:ING)?|IN|RES(?:P(?:ONSE)?)?|REPLY|<{2,3}|<-{1,3}|<=|<"
_WORD = rf"[\[(]?(?:(?P<out>{_OUT_WORDS})|(?P<in>{_IN_WORDS}))"
_DIRECTION = re.compile(
    rf"[ \t]*{_WORD}(?:[ _]?(?:HEX|DATA|BYTES|FRAME))?(?:[ ]?[\[(]?\d+(?: bytes)?[\])]?)?"
    r"(?=[\s\]):=>;,|]|$)[\])]?[ \t]*(?:[-=]{1,2}>|<[-=]{1,2}|[:=>;,|])?[ \t]*",
    re.IGNORECASE,
)
_LATER = re.compile(r"(?<=[\s:\])|-])[\[(]?(?:[A-Z]{2,9}|>{2,3}|<{2,3})(?=[\s:\])=])", re.IGNORECASE)
_COMMENT = re.compile(r"\s*(?:#|//|;|--(?!-?>))")
_ARROW = re.compile(r"(?P<arrow>-{1,3}>|=>|>)[ \t]")
_COUNT = re.compile(r"(?P<hex>.*?)(?:\s*[\[(](?P<n>\d{1,4})(?: bytes)?[\])])?")
_HEX = re.compile(r"\b([0-9A-Fa-f]{2})[hH]\b")
_GAP = re.compile(r"[ \t]{2,}\|?|[ \t]*\|")
_LABELS_LONG: Final = 200  # characters that may stand between time and direction
_LABELLED: Final = 5  # bytes that a line must have, behind words of which only the last is known
_PICTURED: Final = 1000  # characters of a line that may have letters beside its bytes


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

    def __init__(self) -> None:
        self._alone: Stamp | None = None  # a time that stood alone: of the next bytes
        self._arrows = True  # an arrow is a direction
        self._decimal = False  # bytes are in decimal: 165, 64, 144, 8
        self._colons = False  # bytes stood with colons between them: 12:34:56 is not a time

    def look(self, lines: list[str]) -> None:
        """See whether bytes are in decimal, and whether arrows are directions: Arduino's are the same in each line."""
        arrows: set[str] = set()
        timed = others = 0
        for line in lines:
            if _COMMENT.match(line):
                continue
            stamp, rest = split_stamp(line)
            found = _ARROW.match(rest)
            self._decimal = self._decimal or _surely_decimal(direction_of(rest)[1])
            if found and stamp:
                arrows.add(found["arrow"])
                timed += 1
            else:
                others += direction_of(rest)[0] != ""
        self._arrows = not (len(arrows) == 1 and timed > 1 and not others)

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        if _COMMENT.match(line):
            return []
        entry = self._bytes_alone(line) or self._behind_a_stamp(line)
        if entry is None:
            return None
        stamp, self._alone = entry.stamp or self._alone, None
        if entry.data:
            return [Entry(entry.data, stamp, entry.direction)]
        self._alone = stamp
        return []

    def _bytes_alone(self, line: str) -> Entry | None:
        """Read a line that is bytes from its beginning; not one that begins with a time that could be bytes as well.

        12:34:56 A5 40 has a time, 12:34:56:A5:40 has none, and 1700000000 A5 40 has one.
        """
        data = decimal_bytes(line) if self._decimal else hex_bytes(line)
        if data is None:
            return None
        stamp, rest = split_stamp(line)
        taken = line[: len(line) - len(rest)]
        if stamp is not None and hex_bytes(rest) is not None:
            if taken[-1] != ":" and not (taken.strip().isdecimal() and len(rest.split()[0]) == len(taken.strip())):
                return None
        elif stamp is not None and ":" in taken and not self._colons:
            return None
        self._colons = self._colons or ":" in line
        return Entry(data)

    def _behind_a_stamp(self, line: str) -> Entry | None:
        """Read what stands behind a time, a direction or both; without bytes where the time stands alone."""
        line = line.replace('"', "") if line.lstrip().startswith('"') else line
        stamp, rest = split_stamp(line)
        if stamp is not None and not self._arrows and (found := _ARROW.match(rest)):
            rest = rest[found.end() :]
        direction, rest = direction_of(rest)
        if stamp is None and direction:
            stamp, rest = split_stamp(rest)
        data = self._data(rest)
        if data is None and not direction:
            direction, data = self._labelled(rest)
        if data is None and stamp is not None and not rest.strip(" \t:,;-"):
            return Entry(b"", stamp)
        return None if data is None else Entry(data, stamp, direction)

    def _labelled(self, text: str) -> tuple[Direction, bytes | None]:
        """Look behind other words (a level, a name) for a direction with bytes up to the end of the line."""
        for found in _LATER.finditer(text[:_LABELS_LONG]):
            direction, rest = direction_of(text[found.start() :])
            marked = set(text[found.start() : len(text) - len(rest)]) & set(":=<>]")
            data = self._data(rest) if direction and marked else None
            if data is not None and len(data) >= _LABELLED:
                return direction, data
        return "", None

    def _data(self, text: str) -> bytes | None:
        """Read bytes in any of the ways: hex, in brackets or not, with their letters beside them or not; Python's."""
        text = text.strip().replace("<Buffer ", "<", 1)
        if text[:1] + text[-1:] in {"[]", "{}", "<>", "()"}:
            text = text[1:-1].replace("][", " ").replace("}{", " ")
        if self._decimal:
            return decimal_bytes(text)
        data = hex_bytes(text)
        if data is None and len(text) <= _PICTURED:
            data = _pictured(text) or _counted(text)
        if data is None and text.startswith(("b'", 'b"', "bytearray(", "bytes(")):
            data = literal_bytes(text)
        return data


def _surely_decimal(text: str) -> bool:
    """Whether bytes can't be in hex: several, and one has three digits."""
    data = decimal_bytes(text.strip().strip("[]{}()"))
    return data is not None and len(data) >= _LABELLED and max(data) > 99


def _counted(text: str) -> bytes | None:
    """Read bytes with how many there are behind them, or an h behind each: ``A5h 40h [2]``, ``A5 40 (2 bytes)``."""
    found = _COUNT.fullmatch(text)
    data = hex_bytes(_HEX.sub(r"\1", found["hex"])) if found else None
    return data if found and data and found["n"] in {None, str(len(data))} else None


def _pictured(text: str) -> bytes | None:
    """Read bytes that stand beside themselves as letters, one a byte: ``A5 40 90   .@.``."""
    for gap in _GAP.finditer(text):
        data = hex_bytes(text[: gap.start()])
        if data is None:
            return None
        letters = len(text[gap.end() :].removesuffix("|"))
        if len(data.strip(b" ")) <= letters <= len(data):  # the gap took blanks
            return data
    return None
