# SPDX-License-Identifier: GPL-2.0-or-later
"""Frames of others on the same CAN bus: named, never decoded as Daly (docs/protocol.md, c.3).

| frame                                           | name             |
|-------------------------------------------------|------------------|
| standard 351, 355, 356, 35A, 35E, 35F           | Victron/Pylontech|
| standard 370 to 377, 379                        | Victron/Pylontech|
| extended 00004200 to 000042FF                   | Pylontech-HV     |
| extended 18F00180, 18F10180                     | Deye             |
"""

from __future__ import annotations

VICTRON, PYLONTECH_HV, DEYE = "Victron/Pylontech", "Pylontech-HV", "Deye"
AMBIGUOUS = "HKMS or Deye"
"""Registers 0400 to 040E of a board on a bus where no keep-alive of HKMS was seen."""

_VICTRON = frozenset((0x351, 0x355, 0x356, 0x35A, 0x35E, 0x35F, *range(0x370, 0x378), 0x379))
_DEYE = (0x18F00180, 0x18F10180)


def name(identifier: int, *, extended: bool) -> str:
    """Name whose frame it is; empty where nobody is known."""
    if not extended:
        return VICTRON if identifier in _VICTRON else ""
    if identifier in _DEYE:
        return DEYE
    return PYLONTECH_HV if 0x4200 <= identifier <= 0x42FF else ""
