# SPDX-License-Identifier: GPL-2.0-or-later
"""A row a value: which record, which field, what it is.

A number stands in ``value``; a word or a text in ``text``; of booleans (1, 0) and enumerations both are there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools.exports.schema import CONNECTION, FIELDS, FILE, INTERFACE, NUMBER, TIME, Column
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.decoder import Decoded
    from dalyref.values import Value
    from dalytools.exports.rows import Row

_BY_NAME: Final = {column.name: column for column in FIELDS}
_OF_RECORD: Final = tuple(
    _BY_NAME[name] for name in ("kind", "transport", "board", "direction", "data_id", "modbus_register", "can_register")
)
FIELD: Final = Column("field", "text")
PART: Final = Column("part", "int32")
"""From 1, of a list: the cell's number, the sensor's."""
VALUE: Final = Column("value", "double")
TEXT: Final = Column("text", "text")
UNIT: Final = Column("unit", "text")
COLUMNS: Final = (FILE, NUMBER, TIME, INTERFACE, *_OF_RECORD, FIELD, PART, VALUE, TEXT, UNIT, CONNECTION)

CHOICES: Final = tuple(column for column in FIELDS if column not in _OF_RECORD)
DEFAULT: Final = tuple(
    column for column in CHOICES if column.of_battery and not column.field.removeprefix("daly.cell.").isdecimal()
)
"""What the battery says. Single cells are parts of ``daly.cells.voltage``."""


class Values:
    """Makes the rows. chosen: the fields of which there are rows."""

    def __init__(self, chosen: Sequence[Column] = DEFAULT) -> None:
        self.columns: Sequence[Column] = COLUMNS
        self._by_field = {column.field: column for column in chosen}

    def take(self, file: str, record: Decoded) -> list[Row]:
        """Return a row for each value that the record has."""
        head: Row = {
            FILE.name: plain(file),
            NUMBER.name: record.number,
            TIME.name: record.time_ns,
            INTERFACE.name: record.interface,
        }
        if record.connection:
            head[CONNECTION.name] = plain(record.connection)
        for column in _OF_RECORD:
            if (sent := record.fields.get(column.field)) is not None and (value := column.values(sent)) is not None:
                head[column.name] = value
        out: list[Row] = []
        for name, sent in record.fields.items():
            column = self._by_field.get(name)
            if column is None:
                continue
            for number, one in enumerate(sent if isinstance(sent, list) else (sent,), 1):
                row = {**head, FIELD.name: name, **_said(column, one)}
                if VALUE.name not in row and TEXT.name not in row:
                    continue
                if column.several:
                    row[PART.name] = number
                if column.unit:
                    row[UNIT.name] = column.unit
                out.append(row)
        return out

    def end_file(self) -> Sequence[Row]:
        """Nothing is held back."""
        return ()


def _said(column: Column, sent: Value) -> Row:
    """Return the cells of one value; none where it stands for nothing."""
    meant = column.value(sent)
    if meant is None:
        return {}
    if isinstance(sent, bool):
        return {VALUE.name: int(sent), TEXT.name: "true" if sent else "false"}
    if isinstance(sent, str):
        return {TEXT.name: sent}
    if isinstance(meant, str):
        return {VALUE.name: sent, TEXT.name: meant}
    return {VALUE.name: sent}
