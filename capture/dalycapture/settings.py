# SPDX-License-Identifier: GPL-2.0-or-later
"""How a port is asked to listen: speed, format of a character, modem lines, latency."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Literal

from dalycapture.errors import PortError

ModemLines = Literal["leave", "drop"]
ErrorMarks = Literal["auto", "on", "off"]

DEFAULT_BAUD: Final = 9600
_FORMAT = re.compile(r"([78])([NEO])([12])")


@dataclass(frozen=True, slots=True)
class Settings:
    """What is asked of a port.

    baud: bits per second. line_format: data bits, parity (N, E, O), stop bits, ``8N1`` (paper, section 1.1).
    modem_lines: ``leave`` RTS and DTR as the kernel set them at opening, or ``drop`` both at once.
    low_latency: ask the driver to hand bytes over at once (ASYNC_LOW_LATENCY; FTDI: latency timer 1 ms).
    latency_ms: for how long the adapter may hold bytes back; None: as the system says, else assumed.
    error_marks: have the kernel mark bytes with line errors; ``auto``: where the driver counts them.
    """

    baud: int = DEFAULT_BAUD
    line_format: str = "8N1"
    modem_lines: ModemLines = "leave"
    low_latency: bool = False
    latency_ms: float | None = None
    error_marks: ErrorMarks = "auto"

    @property
    def data_bits(self) -> int:
        """7 or 8."""
        return int(self.line_format[0])

    @property
    def parity(self) -> str:
        """N, E or O."""
        return self.line_format[1]

    @property
    def stop_bits(self) -> int:
        """1 or 2."""
        return int(self.line_format[2])

    @property
    def bits_per_byte(self) -> int:
        """Bit times that a character takes on the wire: start, data, parity, stop; 10 for 8N1."""
        return 1 + self.data_bits + (self.parity != "N") + self.stop_bits


def line_format(text: str) -> str:
    """Check a character format such as 8N1, in capitals. Raises PortError."""
    if not _FORMAT.fullmatch(text.upper()):
        raise PortError(f"format {text!r} is not known; Daly's is 8N1, others are 8E1, 8O1, 8N2, 7E1, 7O1")
    return text.upper()
