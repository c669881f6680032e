# SPDX-License-Identifier: GPL-2.0-or-later
"""The data bytes of A5, serial or CAN, with what is secret blanked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalyref import cells, writes
from dalyref.bursts import skipped
from dalytools.redact import a5_layout
from dalytools.redact.a5_layout import SIZE, Span
from dalytools.redact.stale import Buffers, Left
from dalytools.redact.what import What

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.redact.blanker import Blanker

_STATUS: Final = 0x94
_MOST_BOARDS: Final = 4096
_STATE: Final = Span(0, 0, None)
"""The new state, in a reply to D9, DA and 21; the number of a frame."""
_LEFT: Final = {Left.HARMLESS: None, Left.SECRET: What.STALE, Left.UNSEEN: What.OLDER}


class A5Data:
    """What is remembered of the boards of a capture, to tell values from what is left in their place."""

    def __init__(self, blanker: Blanker) -> None:
        self._blanker = blanker
        self.buffers = Buffers()
        self._counts: dict[object, tuple[int, int]] = {}  # cells and sensors, 0: not known

    def request(self, data_id: int, data: bytes, where: str) -> bytes:
        """Return the data bytes of a request with what is secret blanked. where: for people."""
        spans: Sequence[Span] = a5_layout.request(data_id)
        if not spans:
            spans = (Span(0, SIZE - 1, None if a5_layout.padding(data) else What.UNKNOWN),)
        out = self._blanker.spans(data, spans, where, written=True)
        self.buffers.secret(place for place, (old, new) in enumerate(zip(data, out, strict=True)) if old != new)
        return out

    def reply(self, data_id: int, data: bytes, board: object, where: str) -> bytes:
        """Return the data bytes of a reply in the same way. board: tells boards apart."""
        left = self.buffers.of(board)
        spans = self._slots(data_id, data, board, left) or a5_layout.reply(data_id)
        written = writes.is_write(data_id)
        shown: list[Span] = []
        for span in spans:
            if span.what is What.STALE:
                # Bytes one by one: one may be left from a secret, and the next not.
                shown += [Span(place, place, _LEFT[left[place]]) for place in range(span.first, span.last + 1)]
                continue
            if written and span.what is None and span != _STATE:
                # Whether a reply to a write repeats the values, or holds what is left, nobody knows.
                shown += [
                    Span(place, place, What.STALE if left[place] is Left.SECRET else None)
                    for place in range(span.first, span.last + 1)
                ]
                continue
            shown.append(span)
            for place in range(span.first, span.last + 1):
                left[place] = Left.HARMLESS if span.what is None else Left.SECRET
        return self._blanker.spans(data, shown, where, written=written)

    def _slots(self, data_id: int, data: bytes, board: object, left: Sequence[Left]) -> list[Span]:
        """Return the spans of 95 and 96, as far as the counts of 94 tell; of another ID, none."""
        if data_id == _STATUS:
            known = self._counts.get(board, (0, 0))
            if len(self._counts) >= _MOST_BOARDS:
                self._counts.clear()
            self._counts[board] = (
                data[0] if 1 <= data[0] <= cells.MOST_CELLS else known[0],
                data[1] if 1 <= data[1] <= cells.MOST_SENSORS else known[1],
            )
        if data_id not in cells.SLOTS:
            return []
        number = data[0]
        if skipped(data_id, number, 1):
            return [Span(0, 0, None), Span(1, 7, What.STALE)]
        count = self._counts.get(board, (0, 0))[data_id == cells.TEMPERATURES]
        size = 2 if data_id == cells.CELLS else 1
        real = size * cells.used(data_id, number, 1, count)
        if not count and data_id == cells.TEMPERATURES:
            # Of one frame all places but the first may be left over. They are kept only if no secret was there.
            real = next((place - 1 for place in range(2, SIZE) if left[place] is Left.SECRET), real)
        spans = [Span(0, real, None)]
        if real < SIZE - 1:
            spans.append(Span(real + 1, SIZE - 1, What.STALE))
        return spans
