# SPDX-License-Identifier: GPL-2.0-or-later
"""A bus to listen to without hardware: a pty, fed at the pace of a wire; and frames to put on it."""

from __future__ import annotations

import json
import os
import tty
from pathlib import Path
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from types import TracebackType

SAMPLES = Path(__file__).parents[2] / "pcap_samples"


def a5(address: int, data_id: int, data: bytes = bytes(8)) -> bytes:
    """Build a good A5 frame: the paper's sum, low byte of the twelve bytes before it (section 2.3)."""
    head = bytes([0xA5, address, data_id, 8]) + data
    return head + bytes([sum(head) & 0xFF])


def numbered(number: int) -> bytes:
    """Build a reply to 0x90 that says which one it is. Every byte stays below 50: no other frame can begin in it."""
    digits = bytes(number // 10**power % 10 for power in range(7, -1, -1))
    return a5(1, 0x90, digits)


def real_uart_frames() -> list[bytes]:
    """All frames of 13 bytes that real devices put on a serial line."""
    rows = [json.loads(line) for line in (SAMPLES / "real-frames.jsonl").read_text(encoding="utf-8").splitlines()]
    frames = [bytes.fromhex(row["hex"]) for row in rows if row["transport"] == "uart" and row.get("checksum_ok")]
    return [frame for frame in frames if len(frame) == 13]


class Bus:
    """A pty: ``port`` is what a sniffer opens, ``send`` puts bytes on the bus."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)

    def send(self, data: bytes) -> None:
        os.write(self._master, data)

    def heard(self) -> bytes:
        """What was sent to the bus by whoever has the port open."""
        os.set_blocking(self._master, False)
        try:
            return os.read(self._master, 4096)
        except BlockingIOError:
            return b""

    def unplug(self) -> None:
        if self._master >= 0:
            os.close(self._slave)
            os.close(self._master)
            self._master = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.unplug()
