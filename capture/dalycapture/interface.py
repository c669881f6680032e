# SPDX-License-Identifier: GPL-2.0-or-later
"""One tapped side of a bus, as a capture file describes it."""

from __future__ import annotations

import re
from dataclasses import dataclass

from dalycapture.errors import CaptureError
from dalycapture.linktype import DEFAULT_LINK_TYPE


@dataclass(frozen=True, slots=True)
class Interface:
    """What a capture file says of an interface: name (the device), description, speed in bit/s (0: not known)."""

    name: str = ""
    description: str = ""
    link_type: int = DEFAULT_LINK_TYPE
    speed: int = 0
    hardware: str = ""


def bus_name(text: str) -> str:
    """Check a bus name: one word, as readers end it at white space, a comma or a semicolon (docs/records.md, 5)."""
    if not re.fullmatch(r"[^\s,;\x00-\x1f\x7f]{1,64}", text):
        raise CaptureError(f"bus name {text!r} is not one word; use up to 64 letters, digits, - or _")
    return text


def tap(device: str, *, bus: str = "main", baud: int = 9600, link_type: int = 147, hardware: str = "") -> Interface:
    """Describe a serial tap the way all our readers know it: ``dalyshark bus=main 9600 8N1 /dev/ttyUSB0``."""
    description = f"dalyshark bus={bus_name(bus)} {baud} 8N1 {device}"
    return Interface(name=device, description=description, link_type=link_type, speed=baud, hardware=hardware)
