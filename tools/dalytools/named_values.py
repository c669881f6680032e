# SPDX-License-Identifier: GPL-2.0-or-later
"""Values by their fields' names, with units: what a line says of a record that it has no words of its own for."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools.exports.schema import FIELDS

if TYPE_CHECKING:
    from dalyref.values import Fields, Value

_COLUMNS: Final = {column.field: column for column in FIELDS}
_ALARM_UNITS: Final = {"cell": "mV", "pack": "V", "temp": "C"}
"""Of alarm.value and alarm.recovery, by the first word of alarm.class (docs/protocol.md, the alarm grid)."""


def named(name: str, value: Value | list[Value], fields: Fields) -> str:
    """Return a field in words: ``setting.cell_high_1 3650 mV``. fields: the record's, which may tell the unit."""
    values = value if isinstance(value, list) else [value]
    parts = [name.removeprefix("daly."), *(_word(name, each) for each in values), _unit(name, fields)]
    return " ".join(part for part in parts if part)


def of_battery(fields: Fields) -> str:
    """Return what a record tells of the battery, its settings included; empty where it tells nothing."""
    told = [(name, value) for name, value in fields.items() if name in _COLUMNS and _COLUMNS[name].of_battery]
    return "  ".join(named(name, value, fields) for name, value in told)


def _word(name: str, value: Value) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    column = _COLUMNS.get(name)
    if column and isinstance(value, int):
        if column.words:
            return column.words.get(value, str(value))
        if column.hexadecimal:
            return f"0x{value:02X}"
    return str(value)


def _unit(name: str, fields: Fields) -> str:
    if name in ("daly.alarm.value", "daly.alarm.recovery"):
        return _ALARM_UNITS.get(str(fields.get("daly.alarm.class")).partition("_")[0], "")
    column = _COLUMNS.get(name)
    return column.unit if column else ""
