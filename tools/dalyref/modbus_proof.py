# SPDX-License-Identifier: GPL-2.0-or-later
"""Where the registers of a reply begin when nobody saw the request: only where the values prove it (docs/wires.md, 1).

D2    62 or more   0000    cells, sensors, SOC and state can be; pack voltage = sum of the cells, within 1 %
D2    41           0080    limits of level and level in their order, switches are switches
D2    32           00A9    text throughout
81    62 or more   0000    as the first
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref import modbus
from dalyref.register_map import Registers

if TYPE_CHECKING:
    from collections.abc import Callable

_LEAST_TEXT = 4


def _pack_fits(voltage: int, cells: list[int]) -> bool:
    """Compare the pack's voltage (0.1 V) with the cells' (mV)."""
    total = sum(cells)
    return abs(voltage * 100 - total) * 100 <= total


def _words(data: bytes) -> list[int]:
    return [int.from_bytes(data[at : at + 2]) for at in range(0, len(data), 2)]


def _d2_pack(data: bytes) -> bool:
    word = _words(data)
    return (
        1 <= word[0x31] <= 32
        and word[0x32] <= 8
        and word[0x28] != 0
        and word[0x2A] <= 1000
        and word[0x2F] <= 2
        and _pack_fits(word[0x28], word[: word[0x31]])
    )


def _d2_settings(data: bytes) -> bool:
    word = dict(enumerate(_words(data), 0x80))
    return (
        1 <= word[0x82] <= 3
        and word[0x89] <= 2
        and word[0x8B] > word[0x8D]
        and word[0x8C] > word[0x8E]
        and word[0x8F] > word[0x91]
        and word[0x90] > word[0x92]
        and word[0xA5] <= 1
        and word[0xA6] <= 1
        and word[0xA7] <= 1000
    )


def _d2_texts(data: bytes) -> bool:
    letters = sum(0x21 <= byte <= 0x7E for byte in data)
    padding = sum(byte in (0x00, 0x20, 0xFF) for byte in data)
    return letters >= _LEAST_TEXT and letters + padding == len(data)


def _81_pack(data: bytes) -> bool:
    word = _words(data)
    return (
        1 <= word[0x3C] <= 48
        and word[0x3D] <= 8
        and word[0x38] != 0
        and word[0x3A] <= 1000
        and _pack_fits(word[0x38], word[: word[0x3C]])
    )


_WHOLE_PACK = range(62, modbus.LARGEST_READ // 2 + 1)
"""From the least that holds all that is asked, to the most that a reply can hold."""

_CLAIMS: tuple[tuple[bool, range, int, Callable[[bytes], bool]], ...] = (
    (True, _WHOLE_PACK, 0x0000, _d2_pack),
    (True, range(41, 42), 0x0080, _d2_settings),
    (True, range(32, 33), 0x00A9, _d2_texts),
    (False, _WHOLE_PACK, 0x0000, _81_pack),
)
"""Of D2 or of 81, how many registers, where they would begin, the proof."""


def assume(data: bytes, *, d2: bool) -> Registers | None:
    """Return the registers of a read reply's `data` where they prove where they begin."""
    for dialect, counts, start, proven in _CLAIMS:
        if dialect is d2 and len(data) // 2 in counts and proven(data):
            return Registers(start, data)
    return None
