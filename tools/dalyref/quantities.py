# SPDX-License-Identifier: GPL-2.0-or-later
"""What raw bytes stand for: numbers, tenths, temperatures, dates. High byte first, as Daly sends all of them.

Each takes the bytes of one value, and returns None where they stand for none.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from dalyref import texts
from dalyref.values import Value

Meaning: TypeAlias = Callable[[bytes], Value | None]


def number(raw: bytes) -> int:
    """Give a number as it is."""
    return int.from_bytes(raw)


def tenths(raw: bytes) -> float:
    """Give the unit, sent in tenths."""
    return int.from_bytes(raw) / 10


def hundredths(raw: bytes) -> float:
    """Give the unit, sent in hundredths."""
    return int.from_bytes(raw) / 100


def hundreds(raw: bytes) -> int:
    """Give mAh, sent in 0.1 Ah."""
    return int.from_bytes(raw) * 100


def amperes(raw: bytes) -> float:
    """Give a current, A, sent in 0.1 A with offset 30000. Its sign is as sent (field notes, fact 5)."""
    return (int.from_bytes(raw) - 30000) / 10


def celsius(raw: bytes) -> int:
    """Give a temperature, C, sent with offset 40."""
    return int.from_bytes(raw) - 40


def switch(raw: bytes) -> bool:
    """Tell whether a switch is on: 0 is off."""
    return any(raw)


def date(raw: bytes) -> str | None:
    """Give YY MM DD as 20YY-MM-DD, as sent (no calendar is asked); none where all is 00 or all is FF."""
    return None if _unset(raw[:3]) else _day(raw)


def clock(raw: bytes) -> str | None:
    """Give YY MM DD hh mm ss as 20YY-MM-DD hh:mm:ss, the same way."""
    hours, minutes, seconds = raw[3:6]
    return None if _unset(raw[:6]) else f"{_day(raw)} {hours:02d}:{minutes:02d}:{seconds:02d}"


def _unset(raw: bytes) -> bool:
    return raw in (bytes(len(raw)), b"\xff" * len(raw))


def _day(raw: bytes) -> str:
    return f"20{raw[0]:02d}-{raw[1]:02d}-{raw[2]:02d}"


def text(raw: bytes) -> str | None:
    """Give ASCII without the padding behind it; none where nothing is left."""
    return texts.trimmed(raw) or None
