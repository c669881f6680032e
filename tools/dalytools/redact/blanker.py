# SPDX-License-Identifier: GPL-2.0-or-later
"""Blanks spans of bytes and counts what was blanked; what the user wants kept is kept, but for texts in it."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from dalytools.redact.fill import LETTER
from dalytools.redact.what import LOOKED_FOR, OPAQUE, TEXTS, What

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dalytools.redact.copies import Copies
    from dalytools.redact.fill import Fill
    from dalytools.redact.tally import Tally

_TEXT: Final = re.compile(rb"[0-9A-Za-z+./:@_-]{4,}")
"""What looks like a text, or a number in digits."""


class Blanker:
    """Blanks the spans of one capture.

    keep: what the user wants kept. copies: of the codes, numbers and passwords of this capture, as far as they are
    known; with `learning` those that are met are added.
    """

    def __init__(self, fill: Fill, tally: Tally, copies: Copies, keep: frozenset[What], *, learning: bool) -> None:
        self._fill = fill
        self._tally = tally
        self._copies = copies
        self._keep = keep
        self._learning = learning

    def learn(self, value: bytes) -> None:
        """Take a code, number or password that was put together of several parts."""
        if self._learning:
            self._copies.learn(value)

    def spans(
        self, data: bytes, spans: Iterable[tuple[int, int, What | None]], where: str, *, written: bool = False
    ) -> bytes:
        """Blank spans: (first byte, last byte, what they are; None: harmless). All else is kept, copies apart.

        where: for people. written: a host's write, or the reply to one.
        """
        out = bytearray(data)
        fill = self._fill.written if written else self._fill.read
        for first, last, what in spans:
            if what is None:
                continue
            raw = data[first : last + 1]
            if self._learning and what in LOOKED_FOR:
                self._copies.learn(raw)
            if what not in self._keep:
                self._put(out, first, fill(raw, text=what in TEXTS), what, where)
            elif what in OPAQUE:
                for found in _TEXT.finditer(raw):
                    self._put(out, first + found.start(), self._fill.read(found[0], text=True), what, where)
        return self._without_copies(out, where)

    def whole(self, data: bytes, what: What, where: str) -> bytes:
        """Blank bytes that nobody explains; 00 and FF say nothing, and stay."""
        if what in self._keep:
            return self.spans(data, [(0, len(data) - 1, what)], where)
        out = bytearray(data)
        self._put(out, 0, bytes(byte if byte in (0x00, 0xFF) else self._fill.other for byte in data), what, where)
        return bytes(out)

    def given(self, data: bytes, instead: bytes, what: What, where: str) -> bytes:
        """Put `instead`, as long, in the place of bytes, unless the user wants them kept."""
        if what in self._keep:
            return data
        out = bytearray(data)
        self._put(out, 0, instead, what, where)
        return bytes(out)

    def _without_copies(self, out: bytearray, where: str) -> bytes:
        if not self._learning:
            for start, stop in self._copies.find(bytes(out)):
                raw = bytes(out[start:stop])
                self._put(out, start, self._fill.read(raw, text=raw.isascii()), What.COPY, where)
        return bytes(out)

    def _put(self, out: bytearray, start: int, new: bytes, what: What, where: str) -> None:
        stop = start + len(new)
        changed = sum(a != b or b == LETTER for a, b in zip(out[start:stop], new, strict=True))
        if changed:
            out[start:stop] = new
            self._tally.blanked(what, where, changed)
