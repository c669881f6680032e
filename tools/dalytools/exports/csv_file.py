# SPDX-License-Identifier: GPL-2.0-or-later
"""Rows as CSV (RFC 4180, UTF-8, a head line, lines end with a line feed): fit for spreadsheets, and safe in them.

Texts come from captures, which are not trusted: what a spreadsheet would take for a formula gets an apostrophe in
front, what does not print is escaped.
"""

from __future__ import annotations

import csv
from contextlib import suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, TextIO

from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.exports.rows import Cell, Row
    from dalytools.exports.schema import Column

_FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")  # and their full-width twins
NOTHING = "none"
"""Stands in a list for what is missing: a sensor that is not there."""


def safe(text: str) -> str:
    """Return a text that came from elsewhere, fit for a cell."""
    shown = plain(text)
    return f"'{shown}" if shown.startswith(_FORMULA) else shown


def time_text(time_ns: int) -> str:
    """Return a time as 2023-11-14 22:13:20.123456, UTC, rounded down; nothing outside the years 1 to 9999."""
    with suppress(OverflowError, ValueError, OSError):
        seconds, ns = divmod(time_ns, 1_000_000_000)
        return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}.{ns // 1000:06d}"
    return ""


def cell_text(column: Column, value: Cell) -> str:
    """Return what stands in a cell."""
    if isinstance(value, list):
        return " ".join(NOTHING if one is None else cell_text(column, one) for one in value)
    if column.type == "time" and isinstance(value, int):
        return time_text(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"0x{value}" if column.hexadecimal and value.isalnum() else safe(value)
    return f"0x{value:02X}" if column.hexadecimal and isinstance(value, int) else repr(value)


def writer(out: TextIO) -> Any:
    """Return what writes rows of texts to a file."""
    return csv.writer(out, lineterminator="\n")


class CsvFile:
    """Writes rows as they come: every column is known beforehand."""

    def __init__(self, out: TextIO, columns: Sequence[Column]) -> None:
        self._columns = columns
        self._writer = writer(out)
        self._writer.writerow(column.name for column in columns)

    def put(self, row: Row) -> None:
        """Write a row."""
        self._writer.writerow(
            "" if (value := row.get(column.name)) is None else cell_text(column, value) for column in self._columns
        )
