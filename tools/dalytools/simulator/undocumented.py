# SPDX-License-Identifier: GPL-2.0-or-later
"""IDs that stand in no paper, for people who practise to find out what is in them. No device has these.

9C   counts   current, two replies ago (0.1 A + 30000)   5A, bit 0: balancer   seconds since the start, u32
9D   eight letters
"""

from __future__ import annotations

from collections import deque
from typing import Final

VALUES, LETTERS = 0x9C, 0x9D
_DELAY: Final = 2
_TEXT: Final = b"77B-1A.4"


class Undocumented:
    """What a board keeps for them."""

    def __init__(self) -> None:
        self._count = 0
        self._currents: deque[int] = deque(maxlen=_DELAY + 1)

    def payload(self, data_id: int, current_raw: int, *, balancer: bool, now_s: float) -> bytes:
        """Return the eight bytes of a reply."""
        if data_id == LETTERS:
            return _TEXT
        self._currents.append(min(65535, max(0, current_raw)))
        count, self._count = self._count, (self._count + 1) & 0xFF
        return bytes((count,)) + self._currents[0].to_bytes(2) + bytes((0x5A | balancer,)) + int(now_s).to_bytes(4)
