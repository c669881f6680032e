# SPDX-License-Identifier: GPL-2.0-or-later
"""What the registers of one reply address say, and what is remembered of it (docs/wires.md, section 1).

reply --> counts (this one's, or the newest valid) --> cells, sensors, tables
--> faults, as of 98                         --> what came and went
--> state, switches, counts                  --> what changed
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref import cells, faults
from dalyref.register_map import ABSENT
from dalyref.values import put

if TYPE_CHECKING:
    from dalyref.register_map import RegisterMap, Registers
    from dalyref.values import Fields, Value

# Field, its name in daly.changed: in the order in which they are told.
_WATCHED = (
    ("daly.state", "state"),
    ("daly.mos.charge", "charge_mos"),
    ("daly.mos.discharge", "discharge_mos"),
)


class ModbusBoard:
    """What is known of what answers with one Modbus address."""

    def __init__(self, table: RegisterMap) -> None:
        """Begin with nothing known. table: how its registers are read."""
        self._table = table
        self._cells = self._sensors = (0, 0)  # how many, packet; 0: not known
        self._faults: tuple[int, int] | None = None  # bits, packet
        self._before: dict[str, tuple[Value | list[Value], int]] = {}  # by field: newest value, packet

    def reply(self, registers: Registers, number: int, fields: Fields) -> None:
        """Take the registers of a reply; add all they say. number: of its packet."""
        table = self._table
        fields.update(registers.named(table.told))
        fields.update(registers.named(table.settings))
        found = self._changes(registers, number, fields)
        self._read_cells(registers, fields)
        self._read_sensors(registers, fields)
        found += self._read_faults(registers, number, fields)
        if found:
            fields["daly.changed_from"] = max(found)

    def _changes(self, registers: Registers, number: int, fields: Fields) -> list[int]:
        """Say what changed; return the packets of the replies that it changed since."""
        names: list[str] = []
        since: list[int] = []
        for field, name in _WATCHED:
            if field not in fields:
                continue
            value, before = fields[field], self._before.get(field)
            if before is not None and before[0] != value:
                names.append(name)
                since.append(before[1])
            self._before[field] = (value, number)
        cell_count = registers.value(self._table.cell_count) or 0
        if 1 <= cell_count <= cells.MOST_CELLS:
            if self._cells[0] not in (0, cell_count):
                names.append("cell_count")
                since.append(self._cells[1])
            self._cells = (cell_count, number)
        sensor_count = registers.value(self._table.sensor_count) or 0
        if 1 <= sensor_count <= cells.MOST_SENSORS:
            if self._sensors[0] not in (0, sensor_count):
                names.append("sensor_count")
                since.append(self._sensors[1])
            self._sensors = (sensor_count, number)
        put(fields, "daly.changed", names)
        return since

    def _read_cells(self, registers: Registers, fields: Fields) -> None:
        count = self._cells[0]
        voltages = _present(registers, self._table.cells, count, most=ABSENT - 1)
        put(fields, "daly.cell.voltage", voltages)
        if count and len(voltages) == count:
            fields.update(cells.table(voltages))

    def _read_sensors(self, registers: Registers, fields: Fields) -> None:
        count = self._sensors[0]
        raw = _present(registers, self._table.sensors, count, most=0xFF)
        put(fields, "daly.temperature", [value - 40 for value in raw])
        if count and len(raw) == count:
            fields.update(cells.sensor_table(raw))

    def _read_faults(self, registers: Registers, number: int, fields: Fields) -> list[int]:
        """Add the faults; return the packet of the reply that they changed since, if they did."""
        words = [registers.value(register) for register in self._table.faults]
        if not words or None in words:
            return []
        data = b"".join(word.to_bytes(2, "little") for word in words if word is not None)
        fields.update(faults.decode(data))
        bits, before = faults.bits(data), self._faults
        self._faults = (bits, number)
        if before is None or before[0] == bits:
            return []
        put(fields, "daly.fault_raised", faults.names(bits & ~before[0]))
        put(fields, "daly.fault_cleared", faults.names(before[0] & ~bits))
        return [before[1]]


def _present(registers: Registers, where: tuple[int, ...], count: int, *, most: int) -> list[int]:
    """Return the cells or sensors that are there: of the first `count`, of all where that is 0; none above `most`."""
    found = [registers.value(register) for register in (where[:count] if count else where)]
    return [value for value in found if value is not None and value <= most]
