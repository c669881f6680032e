# SPDX-License-Identifier: GPL-2.0-or-later
"""A row a moment: what a board told in one round of polling, one column a quantity.

    90 91 92 93 94 95.. 96 97 98 | 90 91 92 ..        a row ends where a quantity comes that it has already
    90 90 90 95.. | 90 90                             rows of what was polled only

Each value stands in one row, once; nothing is carried on into the next. A row spans `span_ns` at most. Only good
replies count; of 0x95 and 0x96 the whole table.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dalyref.kinds import Kind
from dalytools.exports.schema import CONNECTION, FIELDS, FILE, INTERFACE, NUMBER, TIME, Column
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.decoder import Decoded
    from dalytools.exports.rows import Row

_BY_FIELD: Final = {column.field: column for column in FIELDS}
HEAD: Final = (FILE, NUMBER, TIME, INTERFACE, _BY_FIELD["daly.transport"], _BY_FIELD["daly.board"])
SENSORS: Final = "daly.sensors.temperature"
_MOST_SENSORS = 21
_REPLY = 2
_MOST_OPEN = 4096
_MOST_CLOSED = 65536


def _choices() -> tuple[Column, ...]:
    made: list[Column] = [CONNECTION]
    for column in FIELDS:
        if column.field == SENSORS:
            made += [
                Column(f"sensor_{number:02d}_C", "int32", "C", SENSORS, nothing=column.nothing)
                for number in range(1, _MOST_SENSORS + 1)
            ]
        # The grid of alarms is a table of its own: 27 replies have the same quantities, each of another alarm.
        elif column.of_battery and column.field != "daly.cells.voltage" and not column.field.startswith("daly.alarm."):
            made.append(column)
    return tuple(made)


CHOICES: Final = _choices()
"""Quantities of a battery, and where it was heard. Cells and sensors have a column each."""


@dataclass(slots=True)
class _Open:
    """A row that may still grow."""

    start_ns: int
    row: Row


_Key = tuple[int, object, str, object, object]
"""Interface, transport, connection, dialect, board."""


class Moments:
    """Makes the rows. chosen: which columns stand behind file, number, time, interface, transport and board."""

    def __init__(self, chosen: Sequence[Column] = CHOICES, *, span_ns: int) -> None:
        self.columns: Sequence[Column] = (*HEAD, *chosen)
        self._by_field = {column.field: column for column in chosen if column.field and column.field != SENSORS}
        self._sensors = {column.name for column in chosen if column.field == SENSORS}
        self._connection = CONNECTION in chosen
        self._span_ns = span_ns
        self._open: dict[_Key, _Open] = {}  # the one that began first comes first
        self._closed: list[tuple[int, int, Row]] = []  # heap, by beginning and order
        self._count = 0

    def take(self, file: str, record: Decoded) -> list[Row]:
        """Take a record; return the rows that are complete, the first first."""
        fields = record.fields
        if record.kind is not Kind.FRAME or fields.get("daly.direction") != _REPLY:
            return []
        values = self._values(record)
        if not values:
            return []
        self._close_old(record.time_ns)
        key = (
            record.interface,
            record.transport,
            record.connection,
            fields.get("daly.dialect"),
            fields.get("daly.board"),
        )
        present = self._open.get(key)
        if present is not None and not present.row.keys().isdisjoint(values):
            self._close(key)
            present = None
        if present is None:
            head: Row = {
                FILE.name: plain(file),
                NUMBER.name: record.number,
                TIME.name: record.time_ns,
                INTERFACE.name: record.interface,
                "transport": record.transport,
            }
            board = fields.get("daly.board")
            if isinstance(board, int):
                head["board"] = board
            if record.connection and self._connection:
                head[CONNECTION.name] = plain(record.connection)
            present = self._open[key] = _Open(record.time_ns, head)
            if len(self._open) > _MOST_OPEN:
                self._close(next(iter(self._open)))
        present.row.update(values)
        return self._complete()

    def end_file(self) -> list[Row]:
        """Return the rows that were still growing."""
        for key in list(self._open):
            self._close(key)
        return self._complete()

    def _values(self, record: Decoded) -> Row:
        found: Row = {}
        for name, sent in record.fields.items():
            column = self._by_field.get(name)
            if column is not None:
                value = column.values(sent)
                if value is not None:
                    found[column.name] = value
            elif name == SENSORS and self._sensors:
                whole = _BY_FIELD[SENSORS].values(sent)
                if isinstance(whole, list):
                    for number, value in enumerate(whole, 1):
                        if value is not None and (named := f"sensor_{number:02d}_C") in self._sensors:
                            found[named] = value
        return found

    def _close(self, key: _Key) -> None:
        done = self._open.pop(key)
        self._count += 1
        heapq.heappush(self._closed, (done.start_ns, self._count, done.row))

    def _close_old(self, now_ns: int) -> None:
        """Close rows that began too long ago, or, where a clock was set back, too far ahead."""
        while self._open:
            key = next(iter(self._open))
            if abs(now_ns - self._open[key].start_ns) <= self._span_ns:
                break
            self._close(key)

    def _complete(self) -> list[Row]:
        """Return closed rows that no open one precedes."""
        first = next(iter(self._open.values())).start_ns if self._open else None
        out: list[Row] = []
        while self._closed and (first is None or self._closed[0][0] <= first or len(self._closed) > _MOST_CLOSED):
            out.append(heapq.heappop(self._closed)[2])
        return out
