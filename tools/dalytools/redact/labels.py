# SPDX-License-Identifier: GPL-2.0-or-later
"""What stands around the packets: interfaces and comments, with names of people, places and devices taken out.

/dev/serial/by-id/usb-FTDI_.._A50285BI-if00   ->   tap1
dalyshark bus=boat side=bms 9600 8N1 /dev/..  ->   dalyshark bus=private1 9600 8N1 tap1
port lost: /dev/ttyUSB0 went away             ->   port lost (text removed)
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from dalycapture.interface import Interface

_BUS_NAME: Final = re.compile(r"bus=([^\s,;]+)")  # docs/records.md 5
_PLAIN_BUS: Final = re.compile(r"main|bus\d{0,2}|one|two|three|[a-d]|uart|rs-?485|can|host|bms")
"""Names of buses that say nothing."""
_LINE: Final = re.compile(r"\b\d{3,7} [5-8][NEO][12]\b")
_EVENT: Final = re.compile(
    r"clock step|port lost|port back|the computer slept|line errors|dropped|user mark \d{1,6}|disk full|RTAC",
    re.IGNORECASE,
)
"""How the sniffer's events begin. ``check`` tells them by these words."""
REMOVED: Final = "(text removed)"


class Labels:
    """Gives interfaces and buses names that say nothing: one name, one bus, as before."""

    def __init__(self) -> None:
        self._buses: dict[str, str] = {}
        self._count = 0

    def interface(self, old: Interface) -> Interface:
        """Return the interface as it may be shown. Its link type and speed are kept."""
        self._count += 1
        name = f"tap{self._count}"
        words = ["dalyshark"] if "dalyshark" in old.description else []
        bus = _BUS_NAME.search(old.description)
        if bus:
            words.append(f"bus={self._bus(bus[1])}")
        line = _LINE.search(old.description)
        if line:
            words.append(line[0])
        return replace(old, name=name, description=" ".join([*words, name] if words else []), hardware="")

    def _bus(self, name: str) -> str:
        if _PLAIN_BUS.fullmatch(name):
            return name
        return self._buses.setdefault(name, f"private{len(self._buses) + 1}")


def comment(old: str, *, event: bool) -> str:
    """Return what is left of a packet's comment: of an event what kind it is."""
    if not event or not old:
        return ""
    found = _EVENT.match(old)
    kept = found[0] if found else ""
    if "overrun" in old.lower():
        kept = f"{kept} overrun".strip()
    return f"{kept} {REMOVED}".strip()
