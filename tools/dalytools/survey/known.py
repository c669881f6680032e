# SPDX-License-Identifier: GPL-2.0-or-later
"""Quantities that are understood, and their newest values: what unknown bytes are held against."""

from __future__ import annotations

from array import array
from math import nan
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from dalyref.values import Fields

QUANTITIES: Final = (
    "pack voltage",
    "current",
    "size of the current",
    "SOC",
    "remaining capacity",
    "highest cell",
    "lowest cell",
    "highest temperature",
    "lowest temperature",
    "MOS temperature",
    "board temperature",
)
COUNT: Final = len(QUANTITIES)

FIELDS: Final = {
    "daly.pack.voltage": (0,),
    "daly.pack.current": (1, 2),
    "daly.pack.current_raw": (),
    "daly.soc": (3,),
    "daly.remaining_capacity": (4,),
    "daly.cell.max_voltage": (5,),
    "daly.cell.min_voltage": (6,),
    "daly.temperature.max": (7,),
    "daly.temperature.min": (8,),
    "daly.temperature.mos": (9,),
    "daly.temperature.board": (10,),
}
"""Field to the places of its quantities in QUANTITIES."""
_SIZE_OF_CURRENT = 2
_MOST_BOARDS = 256


class Known:
    """The newest value of every quantity, by bus and board."""

    def __init__(self) -> None:
        self._boards: dict[tuple[str, int], array[float]] = {}
        self._nothing = array("d", [nan] * COUNT)

    def take(self, bus: str, board: int, fields: Fields) -> None:
        """Take what a reply of a board tells."""
        values = self._boards.get((bus, board))
        for name in FIELDS.keys() & fields.keys():
            places, value = FIELDS[name], fields[name]
            if not isinstance(value, int | float):
                continue
            if values is None:
                if len(self._boards) >= _MOST_BOARDS:
                    return
                values = self._boards[bus, board] = self._nothing[:]
            for place in places:
                values[place] = abs(value) if place == _SIZE_OF_CURRENT else value

    def of(self, bus: str, board: int) -> array[float]:
        """Return the values of a board (NaN: not told yet); of bytes that name no board, those of the only one."""
        values = self._boards.get((bus, board))
        if values is None and not board:
            there = [told for (where, _), told in self._boards.items() if where == bus]
            values = there[0] if len(there) == 1 else None
        return self._nothing if values is None else values
