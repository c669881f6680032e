# SPDX-License-Identifier: GPL-2.0-or-later
"""Texts that come in several frames of seven characters (docs/records.md, 8; field notes, a.2).

63   | 1 | D   L   -   B   M   S   - |      data byte 0: frame number, from 1 on every device seen
63   | 2 | R   3   2   -   0   1   E |      together: hardware version "DL-BMS-R32-01E"
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

FIELDS = {
    0x55: "daly.manufacturer",
    0x56: "daly.battery_name",
    0x57: "daly.battery_code",
    0x62: "daly.software_version",
    0x63: "daly.hardware_version",
    0x6A: "daly.serial_number",
}
"""Which text it is, by data ID."""

_LENGTH = {0x55: 16, 0x56: 32, 0x57: 35, 0x6A: 32}
"""How many characters a text has, by data ID. Of 62 and 63 the sources tell frames only."""

_PADDING = b"\x00\xff\x20"


def shown(characters: bytes) -> str:
    """Return the characters, those that can't be shown as ``?``."""
    return "".join(chr(byte) if 0x20 <= byte <= 0x7E else "?" for byte in characters)


def trimmed(characters: bytes) -> str:
    """Return the characters without the padding at their end; empty where there is nothing else."""
    return shown(characters.rstrip(_PADDING))


def whole(data_id: int, parts: Mapping[int, bytes]) -> str:
    """Put the characters of a burst's frames together, by frame number; what the last has beyond the text is stale."""
    characters = b"".join(parts[number] for number in sorted(parts))
    return trimmed(characters[: _LENGTH.get(data_id)])
