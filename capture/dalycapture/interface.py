# SPDX-License-Identifier: GPL-2.0-or-later
"""One tapped side of a bus, as a capture file describes it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dalycapture.errors import CaptureError
from dalycapture.linktype import DEFAULT_LINK_TYPE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalycapture.port import Port
    from dalycapture.settings import Settings


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


def tap(
    device: str,
    *,
    bus: str = "main",
    baud: int = 9600,
    line_format: str = "8N1",
    side: str = "",
    link_type: int = DEFAULT_LINK_TYPE,
    hardware: str = "",
    facts: Sequence[str] = (),
) -> Interface:
    """Describe a serial tap the way all our readers know it: ``dalyshark bus=main 9600 8N1 /dev/ttyUSB0; ...``.

    side: whose wire it is, of a two-port tap. facts: what was granted, and what is not known.
    """
    whose = f" side={side}" if side else ""
    words = f"dalyshark bus={bus_name(bus)}{whose} {baud} {line_format} {device}"
    return Interface(device, "; ".join([words, *facts]), link_type, baud, hardware)


def tap_of(
    port: Port, settings: Settings, *, bus: str = "main", side: str = "", link_type: int = DEFAULT_LINK_TYPE
) -> Interface:
    """Describe the tap that an open port is: what was asked, what was granted, what is not known."""
    facts = port.facts
    adapter = facts.adapter
    known = [f"adapter {adapter.stable_name}"] if adapter.stable_name != port.name else []
    return tap(
        port.name,
        bus=bus,
        baud=settings.baud,
        line_format=settings.line_format,
        side=side,
        link_type=link_type,
        hardware=adapter.hardware,
        facts=[*known, *facts.remarks, f"bytes held back for up to {facts.latency}"],
    )
