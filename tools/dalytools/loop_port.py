# SPDX-License-Identifier: GPL-2.0-or-later
"""A port that is opened to send and to hear itself: for ``dalyshark selftest`` alone. Nothing else writes to a port."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import serial

from dalycapture.adapters import adapter_of
from dalycapture.line import KernelLine
from dalytools.problem import Problem

if TYPE_CHECKING:
    from dalycapture.line import Counts, ModemState

_BREAK_S = 0.25


class LoopPort:
    """An adapter with its output joined to its input (dalytools.hardware_test.Loop)."""

    def __init__(self, name: str, baud: int) -> None:
        """Open it for this program alone. Raises Problem."""
        try:
            self._port = serial.Serial(name, baud, timeout=0, write_timeout=5, exclusive=True)
        except (serial.SerialException, OSError, ValueError) as error:
            raise Problem(f"{name}: can not be opened to send: {error}") from None
        self.baud = baud
        self._name = name
        self._line = KernelLine()

    def close(self) -> None:
        """Let the port go."""
        self._port.close()

    def write(self, data: bytes) -> None:
        """Send all of it, and wait until it has left."""
        self._port.write(data)
        self._port.flush()

    def read(self, count: int, timeout_s: float) -> bytes:
        """Return up to so many bytes, fewer when the time is over."""
        heard = bytearray()
        until = time.monotonic() + timeout_s
        while len(heard) < count and time.monotonic() < until:
            heard += self._port.read(count - len(heard))
            if len(heard) < count:
                time.sleep(0.0002)
        return bytes(heard)

    def send_break(self) -> None:
        """Hold the line low for a quarter of a second."""
        self._port.send_break(_BREAK_S)

    def set_lines(self, *, rts: bool, dtr: bool) -> None:
        """Set both outputs, where there are any."""
        self._port.rts = rts
        self._port.dtr = dtr

    def modem_state(self) -> ModemState | None:
        """Read both outputs back."""
        return self._line.modem_state(self._port.fileno())

    def counts(self) -> Counts | None:
        """Read the driver's counters."""
        return self._line.counts(self._port.fileno())

    def latency_ms(self) -> float | None:
        """Read the latency timer that the system states."""
        return adapter_of(self._name).latency_ms
