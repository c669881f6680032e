# SPDX-License-Identifier: GPL-2.0-or-later
"""What the UART decoder of sigrok found: ``sigrok-cli -P uart .. --protocol-decoder-samplenum``, PulseView's export.

    1034-1117 uart-1: A5                      sigrok-cli; from and to which sample
    1034-1117 uart-1: RX: A5
    1034-1117 uart-1: rx-data: "A5" "A5"      the same with -l 3 or more
    1034-1117 UART: RX data: A5               PulseView, "Export annotations for this row"
    1117-1127 uart-1: Frame error             belongs to the byte before

Samples become times by the rate: given with --samplerate, or the round one nearest to what the length of a byte's eight
bits and the baud rate tell. Without sample numbers there are no times.
Sources: libsigrokdecode's uart decoder, such lines in public repositories.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog, Stamp

_LINE = re.compile(
    r"\s*(?:(\d{1,18})-(\d{1,18})\s+)?\"?(?:uart-\d+|UART(?:[ -]\w{1,20})?)\"?:\s*(.{1,100})", re.IGNORECASE
)
_DATA = re.compile(r"(?:(RX|TX)(?:[ -]data)?:\s*)?(?:0x)?([0-9A-Fa-f]{2})", re.IGNORECASE)
_OTHER = re.compile(
    r"(?:(?:RX|TX)(?:[ -]\w+)?:\s*)?(?:Start(?: bit)?|Stop(?: bit)?|Parity(?: bit| ok)?|[01TSP]"
    r"|Break condition|Idle.*|Data bit.*)",
    re.IGNORECASE,
)
_ERROR = re.compile(r"(?:(?:RX|TX)(?:[ -]\w+)?:\s*)?(?:Frame|Framing|Parity) err(?:or)?", re.IGNORECASE)
_BITS = 8
_QUOTED = re.compile(r'(?:"?(?P<head>[\w -]{1,30})"?: )?"(?P<first>[^"]{0,60})".*')
_ROUND = (1, 1.2, 1.6, 2, 2.4, 2.5, 3, 3.2, 4, 4.8, 5, 6, 6.4, 8, 10)
_OFF_AT_MOST = 0.02  # of a rate: a baud rate is hardly further off


def _said(text: str) -> str:
    """Take the first of the texts in quotes, behind its row."""
    text = text.strip()
    found = _QUOTED.fullmatch(text)
    return f"{found['head']}: {found['first']}" if found and found["head"] else found["first"] if found else text


def _round_rate(rate: float) -> float:
    """Take the round rate nearest to one that a single byte told, if it is near: logic analysers have no others."""
    tens = 10.0 ** math.floor(math.log10(rate))
    near = min((step * tens for step in _ROUND), key=lambda one: abs(one - rate))
    return near if abs(near - rate) <= _OFF_AT_MOST * rate else rate


class Sigrok(PlainLineLog):
    """Annotations of the UART decoder."""

    name = "sigrok"
    about = "annotations of sigrok's and PulseView's UART decoder: 1034-1117 uart-1: A5"
    gaps = False

    def __init__(self, baud: int = 9600, samplerate: float = 0.0) -> None:
        self._baud = baud
        self._rate = samplerate
        self._waiting: Entry | None = None

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        found = _LINE.fullmatch(line.rstrip())
        if not found:
            return None
        said = _said(found[3])
        if _ERROR.fullmatch(said):
            if self._waiting is not None:
                self._waiting = replace(self._waiting, bad=True)
            return []
        data = _DATA.fullmatch(said)
        if not data:
            return [] if _OTHER.fullmatch(said) else None
        stamp = None
        if found[1]:
            start, end = int(found[1]), int(found[2])
            if not self._rate and end > start:
                self._rate = _round_rate((end - start) * self._baud / _BITS)
            if self._rate:  # the annotation is of the data bits: the start bit stands before it
                bit_ns = 1_000_000_000 / self._baud
                stamp = Stamp("start", max(0, round(start * 1_000_000_000 / self._rate - bit_ns)))
        way = (data[1] or "").upper()
        direction = IN if way == "RX" else OUT if way == "TX" else ""
        before, self._waiting = self._waiting, Entry(bytes.fromhex(data[2]), stamp, direction)
        return [before] if before else []

    def finish(self) -> list[Entry]:
        """Hand out the last byte, which might still have got an error."""
        before, self._waiting = self._waiting, None
        return [before] if before else []
