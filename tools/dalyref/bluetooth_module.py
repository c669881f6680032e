# SPDX-License-Identifier: GPL-2.0-or-later
"""What the Bluetooth module of a board says of itself: named, not a board's (docs/wires.md, 3; field notes, e).

AT+VER=?             -> HLK-B40(b.2.02.1202305041115)         text, in a value of its own
81 10 0F05 0002 ...  -> 51 10 0F05 AAAA                       Modbus, register 0F05 (docs/records.md, 4)
"""

from __future__ import annotations

NAME = "Bluetooth module"
"""The value of ``daly.foreign``."""

_BEGINNINGS = (b"AT", b"+", b"OK", b"ERROR", b"HiLink")
_TEXT = frozenset((*range(0x20, 0x7F), 0x0D, 0x0A))


def is_text(value: bytes) -> bool:
    """Tell whether a whole value is such a text."""
    return len(value) >= 2 and value.startswith(_BEGINNINGS) and _TEXT.issuperset(value)


def is_modbus(window: bytes) -> bool:
    """Tell whether a good Modbus window is the module's own, whichever wire it comes over."""
    return window[1:4] == b"\x10\x0f\x05"
