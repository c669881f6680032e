# SPDX-License-Identifier: GPL-2.0-or-later
"""Replies 95 and 96: cell voltages and temperatures, some to a frame (vendor's paper V1.2, section 3).

    95   | n | cell, mV | cell, mV | cell, mV | - |        n = frame number, from 1 on every device seen (paper: from 0)
    96   | n | t | t | t | t | t | t | t |                 t = temperature + 40 C

Slots behind the last cell or sensor hold stale bytes on many boards: they are shown as reserved, never counted
(field notes, fact 2).
"""

from __future__ import annotations

from struct import Struct
from typing import TYPE_CHECKING

from dalyref.values import put

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.values import Fields, Value

CELLS, TEMPERATURES = 0x95, 0x96
MOST_CELLS, MOST_SENSORS = 48, 21
SLOTS = {CELLS: 3, TEMPERATURES: 7}
LAST_FRAME = {CELLS: 16, TEMPERATURES: 3}
"""The highest frame number where frames count from 1."""

_CELLS = Struct(">x3H")


def cells(data: bytes) -> tuple[int, ...]:
    """Return the three slots of a 95 reply, in mV."""
    return _CELLS.unpack_from(data)


def temperatures(data: bytes) -> list[Value]:
    """Return the seven slots of a 96 reply, in C."""
    return [byte - 40 for byte in data[1:8]]


def used(data_id: int, number: int, base: int, count: int) -> int:
    """Return how many slots of frame `number` are real, given how many cells or sensors there are (0: not known)."""
    slots = SLOTS[data_id]
    return min(slots, max(0, count - slots * (number - base))) if count else slots


def decode(data_id: int, data: bytes, real: int) -> Fields:
    """Decode the eight data bytes of a 95 or 96 reply of which the first `real` slots are cells or sensors."""
    fields: Fields = {"daly.frame_number": data[0]}
    if real == SLOTS[data_id]:  # the common case, short
        if data_id == CELLS:
            fields["daly.cell.voltage"] = list(cells(data))
            fields["daly.reserved"] = data[7:].hex()
        else:
            fields["daly.temperature"] = temperatures(data)
    elif data_id == CELLS:
        put(fields, "daly.cell.voltage", cells(data)[:real])
        fields["daly.reserved"] = data[1 + 2 * real :].hex()
    else:
        put(fields, "daly.temperature", temperatures(data)[:real])
        fields["daly.reserved"] = data[1 + real :].hex()
    return fields


CELL_FIELDS = tuple(f"daly.cell.{number:02d}" for number in range(1, MOST_CELLS + 1))
"""One field a cell, cell 1 first."""


def table(voltages: Sequence[int]) -> Fields:
    """Return the ``daly.cells.*`` fields of all cells' voltages (mV, in order), and each cell by its number."""
    low, high = min(voltages), max(voltages)
    fields: Fields = dict(zip(CELL_FIELDS, voltages, strict=False))
    put(fields, "daly.cells.voltage", voltages)
    fields["daly.cells.count"] = len(voltages)
    fields["daly.cells.min"] = low
    fields["daly.cells.min_number"] = voltages.index(low) + 1
    fields["daly.cells.max"] = high
    fields["daly.cells.max_number"] = voltages.index(high) + 1
    fields["daly.cells.average"] = sum(voltages) / len(voltages)
    fields["daly.cells.spread"] = high - low
    return fields


def is_there(raw: int) -> bool:
    """Tell a sensor's byte from those that stand for no sensor (field notes, a.1, 92)."""
    return raw not in (0x00, 0xFF)


def sensor_table(raw: Sequence[int]) -> Fields:
    """Return the ``daly.sensors.*`` fields of all sensors' bytes (C + 40, in order)."""
    fields: Fields = {"daly.sensors.count": len(raw)}
    put(fields, "daly.sensors.temperature", [byte - 40 for byte in raw])
    there = [byte for byte in raw if is_there(byte)]
    if there:
        low, high = min(there), max(there)
        fields["daly.sensors.min"] = low - 40
        fields["daly.sensors.min_number"] = raw.index(low) + 1
        fields["daly.sensors.max"] = high - 40
        fields["daly.sensors.max_number"] = raw.index(high) + 1
        fields["daly.sensors.average"] = sum(there) / len(there) - 40
        fields["daly.sensors.spread"] = high - low
    return fields
