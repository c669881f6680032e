# SPDX-License-Identifier: GPL-2.0-or-later
"""Rows as Parquet. Columns are typed; units, and which field a column is, stand in their metadata."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import pyarrow as pa
from pyarrow import parquet

from dalytools.exports.arrow_schema import arrow_schema

if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import BinaryIO

    from dalytools.exports.rows import Row
    from dalytools.exports.schema import Column

_pa: Any = pa  # its stubs type what is made of Python lists by what the lists hold, which is not known here
_MOST_US: Final = 2**63 - 1
BATCH_ROWS: Final = 4096
"""Rows held as Python objects."""
GROUP_ROWS: Final = 131_072
"""Rows of a row group: what is held, as Arrow columns, until it is written."""


class Batch:
    """Rows, column by column."""

    def __init__(self, columns: Sequence[Column]) -> None:
        self._columns = columns
        self._times = frozenset(column.name for column in columns if column.type == "time")
        self._schema = arrow_schema(columns)
        self._cells: dict[str, list[Any]] = {}
        self.rows = 0

    def put(self, row: Row) -> None:
        """Add a row."""
        at, cells = self.rows, self._cells
        for name, value in row.items():
            column = cells.get(name)
            if column is None:
                column = cells[name] = []
            if len(column) < at:
                column.extend([None] * (at - len(column)))
            column.append(_us(value) if name in self._times else value)
        self.rows += 1

    def take(self) -> pa.Table:
        """Return the rows as a table, and begin anew."""
        arrays: list[Any] = []
        for column, kind in zip(self._columns, self._schema.types, strict=True):
            cells = self._cells.get(column.name)
            if cells is None:
                arrays.append(_pa.nulls(self.rows, kind))
            else:
                cells.extend([None] * (self.rows - len(cells)))
                arrays.append(_pa.array(cells, kind))
        self._cells = {}
        self.rows = 0
        return pa.Table.from_arrays(arrays, schema=self._schema)


def _us(time_ns: Any) -> int | None:
    us = time_ns // 1000
    return us if -_MOST_US <= us <= _MOST_US else None


class ParquetFile:
    """Writes rows to a file of one's own, in groups."""

    def __init__(self, out: BinaryIO, columns: Sequence[Column]) -> None:
        self._batch = Batch(columns)
        self._waiting: list[pa.Table] = []
        self._rows = 0  # that wait
        self._writer = parquet.ParquetWriter(out, arrow_schema(columns), compression="zstd")

    @property
    def waiting(self) -> int:
        """Return how many rows are held in memory."""
        return self._rows + self._batch.rows

    def put(self, row: Row) -> None:
        """Take a row."""
        self._batch.put(row)
        if self._batch.rows >= BATCH_ROWS:
            self.pack()
            if self._rows >= GROUP_ROWS:
                self.flush()

    def put_table(self, table: pa.Table) -> None:
        """Take rows that are columns already."""
        self.pack()
        self._waiting.append(table)
        self._rows += table.num_rows
        if self._rows >= GROUP_ROWS:
            self.flush()

    def pack(self) -> None:
        """Turn rows held as Python objects to Arrow columns, which are smaller."""
        if self._batch.rows:
            self._rows += self._batch.rows
            self._waiting.append(self._batch.take())

    def flush(self) -> None:
        """Write what is held, as a row group."""
        self.pack()
        if self._waiting:
            self._writer.write_table(pa.concat_tables(self._waiting), row_group_size=GROUP_ROWS * 2)
            self._waiting = []
            self._rows = 0

    def close(self) -> None:
        """Write what is held, and the end of the file."""
        self.flush()
        self._writer.close()

    def abandon(self) -> None:
        """Write no more: the file is to be removed."""
        self._writer.is_open = False  # else it would try to write the end of the file when it is collected
