# SPDX-License-Identifier: GPL-2.0-or-later
"""Chosen values of long captures to Parquet, column by column (docs/bulk.md): the rows that ``records`` would make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pyarrow as pa

from dalytools.exports.arrow_schema import arrow_type

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dalytools.bulk.arrays import Ints
    from dalytools.bulk.columns import Column as Told
    from dalytools.bulk.lots import Batch
    from dalytools.exports.schema import Column
    from dalytools.time_range import TimeRange

_pa: Any = pa  # its stubs want the types of what numpy's arrays hold


class _Piece(NamedTuple):
    """Values of one column: of which records, and their heads."""

    column: int
    row: Ints
    number: Ints
    time_ns: Ints
    interface: Ints
    values: Any

    def some(self, which: Any) -> _Piece:
        """Return those of them."""
        heads = (self.row[which], self.number[which], self.time_ns[which], self.interface[which])
        return _Piece(self.column, *heads, self.values.filter(_pa.array(which)))


class Rows:
    """Makes tables of rows from the batches of one file. A row is held while more may be told of its record."""

    def __init__(self, file: str, columns: Sequence[Column], schema: pa.Schema, span: TimeRange) -> None:
        """Begin a file. schema: of file, number, time, interface and the columns; span: of the records wanted."""
        self._file = file
        self._span = span
        self._columns = columns
        self._schema = schema
        self._held: list[_Piece] = []

    def take(self, batch: Batch) -> pa.Table | None:
        """Take the next batch; return the rows that are complete."""
        self._held += (self._wanted(piece) for piece in self._pieces(batch))
        return self._complete(batch.open_from)

    def finish(self) -> pa.Table | None:
        """Return the rows that were held."""
        return self._complete(None)

    def _wanted(self, piece: _Piece) -> _Piece:
        which = inside(self._span, piece.time_ns)
        return piece if which.all() else piece.some(which)

    def _pieces(self, batch: Batch) -> Iterator[_Piece]:
        tables = [one for one in (*batch.replies.values(), *batch.writes.values(), batch.cells, batch.sensors) if one]
        for index, column in enumerate(self._columns):
            for table in tables:
                told = table.columns.get(column.field)
                if told is not None:
                    some, values = _values(column, told)
                    row, number = table.row[some], table.number[some]
                    yield _Piece(index, row, number, table.time_ns[some], table.interface[some], values)
            single: list[tuple[int, int, int, int, Any]] = [
                (*one[:4], one[6]) for one in batch.texts if one[5] == column.field
            ]
            for at, fields in batch.modbus.items():
                sent = fields.get(column.field)
                value = None if sent is None else column.values(sent)
                if value is not None:
                    told_in = batch.records
                    heads = (int(told_in.number[at]), int(told_in.time_ns[at]), int(told_in.interface[at]))
                    single.append((batch.first_row + at, *heads, value))
            if single:
                kind: Any = arrow_type(column.type)
                values = _pa.array([one[4] for one in single], _pa.list_(kind) if column.several else kind)
                row, number, time_ns, interface = np.array([one[:4] for one in single], np.int64).T
                yield _Piece(index, row, number, time_ns, interface, values)

    def _complete(self, before: int | None) -> pa.Table | None:
        ready, held = list[_Piece](), list[_Piece]()
        for piece in self._held:
            now = np.ones(len(piece.row), np.bool_) if before is None else piece.row < before
            if now.all():
                ready.append(piece)
                continue
            for which, to in ((now, ready), (~now, held)):
                to.append(piece.some(which))
        self._held = [piece for piece in held if len(piece.row)]
        if not sum(len(piece.row) for piece in ready):
            return None
        row, first = np.unique(np.concatenate([piece.row for piece in ready]), return_index=True)
        number, time_ns, interface = (
            np.concatenate(list(heads))[first]
            for heads in zip(*((piece.number, piece.time_ns, piece.interface) for piece in ready), strict=True)
        )
        kinds = self._schema.types
        arrays: list[Any] = [
            _pa.repeat(_pa.scalar(self._file, kinds[0]), len(row)),
            _pa.array(number, kinds[1]),
            _pa.array(time_ns // 1000, _pa.int64()).cast(kinds[2]),
            _pa.array(interface).cast(kinds[3]),
        ]
        for index in range(len(self._columns)):
            mine = [piece for piece in ready if piece.column == index]
            if not mine:
                arrays.append(_pa.nulls(len(row), kinds[4 + index]))
                continue
            values = _pa.concat_arrays([piece.values for piece in mine])
            where = np.full(len(row), -1, np.int64)
            places = np.searchsorted(row, np.concatenate([piece.row for piece in mine]))
            where[places] = np.arange(len(places))
            arrays.append(values.take(_pa.array(where, mask=where < 0)))
        return pa.Table.from_arrays(arrays, schema=self._schema)


def inside(span: TimeRange, time_ns: Ints) -> Any:
    """Tell which times (ns since 1970 UTC) are in it."""
    which = np.ones(len(time_ns), np.bool_)
    if span.begin_ns is not None:
        which &= time_ns >= span.begin_ns
    if span.end_ns is not None:
        which &= time_ns < span.end_ns
    return which


def _values(column: Column, told: Told) -> tuple[Any, Any]:
    """Return which rows of a table have a value, and those values."""
    kind: Any = arrow_type(column.type)
    nothing = list(column.nothing)
    if told.length is not None:
        some = told.length > 0
        length = told.length[some]
        flat = told.values[some][np.arange(told.values.shape[1]) < length[:, None]]
        inner = _pa.array(flat, mask=np.isin(flat, nothing)).cast(kind)
        return some, _pa.ListArray.from_arrays(_pa.array(np.append(0, np.cumsum(length)), _pa.int32()), inner)
    some = np.ones(len(told.values), np.bool_) if told.valid is None else told.valid.copy()
    if nothing:
        some &= ~np.isin(told.values, nothing)
    values = told.values[some]
    if column.words is not None:
        different, which = np.unique(values, return_inverse=True)
        words = _pa.array([column.value(one) for one in different.tolist()], kind)
        return some, words.take(_pa.array(which))
    if values.dtype == object:
        return some, _pa.array(values.tolist(), kind)
    return some, _pa.array(values).cast(kind)
