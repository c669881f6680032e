# SPDX-License-Identifier: GPL-2.0-or-later
"""Whether a value is the first of a Daly board's, on attributes that other makers use too (docs/wires.md, 3).

A5 40 90 08 .. sum              a good frame in it
A5 01 95 08 01 0C E4            the head of a frame that is longer than the value
D2 03 7C 0C E4 ..
DD A5 03 00 FF FD 77            somebody else's
"""

from __future__ import annotations

from dalyref import a5, modbus
from dalyref.kinds import Kind
from dalyref.records import split


def begins(value: bytes) -> bool:
    """Tell whether a value, by itself, shows that a board of Daly's speaks, or is spoken to."""
    return _is_long_head(value) or any(record.kind is Kind.FRAME for record in split(value))


def _is_long_head(value: bytes) -> bool:
    """Tell whether a value begins with the head of a frame, and is too short to hold it."""
    length = len(value)
    if value[:1] == bytes((a5.START,)):
        return value[3:4] == b"\x08" and length < a5.SIZE
    if length < 3 or value[1] != modbus.READ or not modbus.answers(value[0]):
        return False
    count = value[2]
    return count % 2 == 0 and 2 <= count <= modbus.LARGEST_READ and count + 5 > length
