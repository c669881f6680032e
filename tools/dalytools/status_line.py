# SPDX-License-Identifier: GPL-2.0-or-later
"""One line on a terminal that says how a capture goes, a few times a second."""

from __future__ import annotations

import shutil
import sys
from collections import deque
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dalycapture.tally import Tally

_RATE_OVER_S = 5.0


class StatusLine:
    """Call it with the tally; it draws over itself. Only for a terminal on standard error."""

    def __init__(self) -> None:
        self.hint = ""  # what may be typed
        self._drawn = False
        self._past: deque[tuple[float, int]] = deque()

    def __call__(self, tally: Tally) -> None:
        """Draw it."""
        self._past.append((tally.seconds, tally.records))
        while len(self._past) > 2 and self._past[1][0] <= tally.seconds - _RATE_OVER_S:
            self._past.popleft()
        width = (shutil.get_terminal_size().columns or 80) - 1
        text = f"{status_text(tally, self._rate())}{self.hint}"
        print(f"\r{text[:width]}\x1b[K", end="", file=sys.stderr, flush=True)  # noqa: T201 - it is for the terminal
        self._drawn = True

    def _rate(self) -> float:
        (then, before), (now, records) = self._past[0], self._past[-1]
        return (records - before) / (now - then) if now > then else 0.0

    def clear(self) -> None:
        """Take the line away."""
        if self._drawn:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)  # noqa: T201 - it is for the terminal
            self._drawn = False


def status_text(tally: Tally, rate: float) -> str:
    """Say it: ``0:12  24.3 records/s  290 good, 0 bad, 1 junk  boards 1 2  14.1 kB  0 lost``."""
    minutes, seconds = divmod(int(tally.seconds), 60)
    boards = f"boards {' '.join(map(str, sorted(tally.boards)))}" if tally.boards else "no board"
    parts = [
        f"{minutes}:{seconds:02}",
        f"{rate:.1f} records/s",
        f"{tally.good} good, {tally.bad} bad, {tally.junk} junk",
        boards,
        _size(tally.written),
        f"{tally.lost} lost",
    ]
    away = [side.name for side in tally.sides if side.away]
    if away:
        parts.append(f"waiting for {' and '.join(away)}")
    return "  ".join(parts)


def _size(number: int) -> str:
    return f"{number / 1000:.1f} kB" if number < 1_000_000 else f"{number / 1_000_000:.1f} MB"
