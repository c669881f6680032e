# SPDX-License-Identifier: GPL-2.0-or-later
"""Captures of a bus in which the answer is known: what each byte of the unknown IDs is, was planted there."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

from tests.tools.dalytools.made import EPOCH_NS, a5, write

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

POLL_S = 1.0
Bytes = "Callable[[int], bytes]"


class Bus:
    """A pack that is polled once a second: its current steps at random, its voltage follows, SOC falls."""

    def __init__(self, polls: int = 300, seed: int = 5) -> None:
        self.polls = polls
        self.random = r = random.Random(seed)
        self.current: list[int] = []  # raw, 0.1 A around 30000
        level = 0
        for _ in range(polls):
            if r.random() < 0.15:
                level = r.randrange(-600, 600)
            self.current.append(30000 + level + r.randrange(-3, 4))
        self.voltage = [5300 // 10 + (raw - 30000) // 60 for raw in self.current]  # 0.1 V
        self.soc = [800 - poll // 40 for poll in range(polls)]  # 0.1 %

    def pack(self, poll: int) -> bytes:
        words = (self.voltage[poll], 0, self.current[poll], self.soc[poll])
        return b"".join(word.to_bytes(2) for word in words)

    def noise(self, size: int) -> bytes:
        return self.random.randbytes(size)

    def write(self, path: Path, replies: dict[int, Callable[[int], bytes]], *, requests: bool = True) -> Path:
        """Write a capture: each poll asks for 0x90, then for the IDs given, in order; a reply 40 ms later."""
        packets: list[tuple[float, bytes]] = []
        for poll in range(self.polls):
            at = poll * POLL_S
            for data_id, payload in {0x90: self.pack, **replies}.items():
                if requests:
                    packets.append((at, a5(0x40, data_id)))
                packets.append((at + 0.040, a5(0x01, data_id, payload(poll))))
                at += 0.1
        return write(path, packets)


def bcd(number: int) -> int:
    return number // 10 * 16 + number % 10


START_S = EPOCH_NS / 1e9
