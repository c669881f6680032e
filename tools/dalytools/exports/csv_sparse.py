# SPDX-License-Identifier: GPL-2.0-or-later
"""CSV with the columns that occur, of hundreds that could.

Which these are is known at the end only: until then the rows wait in a file without a name. Memory does not grow.
"""

from __future__ import annotations

import json
import tempfile
from contextlib import suppress
from typing import IO, TYPE_CHECKING, TextIO, cast

from dalytools.exports.csv_file import cell_text, writer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.exports.rows import Row
    from dalytools.exports.schema import Column


class SparseCsvFile:
    """Takes rows; writes them at the end."""

    def __init__(self, out: TextIO, columns: Sequence[Column], *, always: int, folder: str | None = None) -> None:
        """Begin a table. always: so many of the first columns are written in any case. folder: where the rows wait."""
        self._out = out
        self._columns = columns
        self._index = {column.name: index for index, column in enumerate(columns)}
        self._occur = set(range(always))
        self._waiting: IO[str] = tempfile.TemporaryFile("w+", encoding="utf-8", dir=folder)  # noqa: SIM115 - close() does

    def put(self, row: Row) -> None:
        """Take a row."""
        cells: dict[int, str] = {}
        for name, value in row.items():
            index = self._index[name]
            cells[index] = cell_text(self._columns[index], value)
        self._occur.update(cells)
        self._waiting.write(f"{json.dumps(cells)}\n")

    def write(self) -> None:
        """Write the head line and all rows."""
        out = writer(self._out)
        shown = sorted(self._occur)
        out.writerow(self._columns[index].name for index in shown)
        keys = [str(index) for index in shown]
        self._waiting.seek(0)
        for line in self._waiting:
            cells = cast("dict[str, str]", json.loads(line))
            out.writerow(cells.get(key, "") for key in keys)

    def close(self) -> None:
        """Let the waiting rows go."""
        with suppress(OSError):  # what a full disk did not take
            self._waiting.close()
