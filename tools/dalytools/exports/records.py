# SPDX-License-Identifier: GPL-2.0-or-later
"""A row a record: all that was on the wire, damaged records too."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalytools.exports.schema import COMMENT, CONNECTION, FIELDS, FILE, INTERFACE, NUMBER, RECORD_COLUMNS, TIME
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.decoder import Decoded
    from dalytools.exports.rows import Row
    from dalytools.exports.schema import Column

HEAD = (FILE, NUMBER, TIME, INTERFACE)
CHOICES = (*FIELDS, COMMENT, CONNECTION)
DEFAULT = RECORD_COLUMNS[len(HEAD) :]


class Records:
    """Makes the rows. chosen: which columns stand behind file, number, time and interface."""

    def __init__(self, chosen: Sequence[Column] = DEFAULT, *, only_with: bool = False) -> None:
        """only_with: leave out records that have none of the chosen columns."""
        self.columns: Sequence[Column] = (*HEAD, *chosen)
        self._as_sent = {column.field: column.name for column in chosen if column.as_sent}
        self._by_field = {column.field: column for column in chosen if column.field}
        self._file = ("", "")
        self._comment = COMMENT in chosen
        self._connection = CONNECTION in chosen
        self._only_with = only_with

    def take(self, file: str, record: Decoded) -> Sequence[Row]:
        """Return the record's row."""
        if file != self._file[0]:
            self._file = (file, plain(file))
        row: Row = {
            FILE.name: self._file[1],
            NUMBER.name: record.number,
            TIME.name: record.time_ns,
            INTERFACE.name: record.interface,
        }
        heads = len(row)
        as_sent, by_field = self._as_sent, self._by_field
        for name, sent in record.fields.items():
            if (same := as_sent.get(name)) is not None and not isinstance(sent, list):
                row[same] = sent  # the common case, short
            elif (column := by_field.get(name)) is not None and (value := column.values(sent)) is not None:
                row[column.name] = value
        if self._comment and record.comment:
            row[COMMENT.name] = plain(record.comment)
        if self._connection and record.connection:
            row[CONNECTION.name] = plain(record.connection)
        return () if self._only_with and len(row) == heads else (row,)

    def end_file(self) -> Sequence[Row]:
        """Nothing is held back."""
        return ()
