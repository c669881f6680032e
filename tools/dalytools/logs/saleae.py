# SPDX-License-Identifier: GPL-2.0-or-later
r"""CSV exports of Saleae's Logic: the table of an Async Serial analyzer, a byte a row, with its time.

    Time [s],Value,Parity Error,Framing Error            Logic 1
    0.042909760000000,0xA5,,
    0.042980320000000,0xD4,,Error

    name,type,start_time,duration,"data"                 Logic 2; "error" may follow
    "Async Serial","data",1.096099,0.00104,0xA5
    "Async Serial","data",1.097141,0.00104,"\xA5"

    Time [s],Analyzer Name,Decoded Protocol Result       Logic 1, several analyzers in one table
    0.042909760000000,Async Serial,0xA5

Values in hex (0xA5), decimal (165), binary (0b10100101) or as a letter. In a table of decimals 5 is a
number, in a table of letters a letter. Times are of the start bit, from the trigger, or with date and time of day.
Several analyzers are told apart by name: TX in it is what a host sent, RX what it received. Framing and parity errors
are kept.
Sources: such tables in public repositories, and the exporter of Saleae's open serial analyzer.
"""

from __future__ import annotations

import csv

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog
from dalytools.logs.hexbytes import literal_bytes
from dalytools.logs.stamps import seconds_stamp, split_stamp

_TIMES = ("start_time", "time [s]", "time[s]", "time")
_VALUES = ("data", "value", "decoded protocol result")
_NAMES = ("name", "analyzer name")


class Saleae(PlainLineLog):
    """A table of Logic 1 or 2."""

    name = "saleae"
    about = "Saleae Logic's CSV of an Async Serial analyzer: byte times and framing errors"
    gaps = False

    def __init__(self) -> None:
        self._columns: list[str] = []
        self._decimal = False

    def look(self, lines: list[str]) -> None:
        """See whether values are decimal: one has two digits or more, and none is anything else."""
        values: list[str] = []
        for line in lines:
            if self._columns:
                values += [text.strip() for text in [_cell(self._cells(line), _VALUES)] if text.strip()]
            else:
                self.parse(line)
        self._decimal = any(len(value) > 1 for value in values) and all(value.isdecimal() for value in values)
        self._columns = []

    def _cells(self, line: str) -> dict[str, str]:
        return dict(zip(self._columns, _row(line), strict=False))

    def parse(self, line: str) -> list[Entry] | None:
        """Read a row."""
        if not self._columns:
            names = [name.strip().lower() for name in _row(line)]
            if any(name in _TIMES for name in names) and any(name in _VALUES for name in names):
                self._columns = names
                return []
            return None
        cells = self._cells(line)
        time = _cell(cells, _TIMES)
        stamp = seconds_stamp(time) or split_stamp(time)[0]
        kind = cells.get("type", "data").strip().lower()
        if stamp is None:
            return None
        if kind not in {"data", ""}:
            return []
        text = _cell(cells, _VALUES)
        value = byte_value(f"0x{int(text):X}" if self._decimal and text.strip().isdecimal() else text)
        if value is None:
            return None
        errors = [cells[name].strip() for name in cells if "error" in name]
        name = _cell(cells, _NAMES).upper()
        direction = OUT if "TX" in name else IN if "RX" in name else ""
        bad = any(error and error.lower() not in {"false", "0", "none"} for error in errors)
        return [Entry(bytes((value,)), stamp, direction, bad)]


def _row(line: str) -> list[str]:
    try:
        return next(csv.reader([line]))
    except (ValueError, csv.Error, StopIteration):
        return []


def _cell(cells: dict[str, str], names: tuple[str, ...]) -> str:
    """Return the cell of the first of these columns that is there."""
    return next((cells[name] for name in names if name in cells), "")


def byte_value(text: str) -> int | None:
    """Read one byte of a cell, however the analyzer was set to show it."""
    text = text if text == " " else text.strip()
    if text.startswith(("'", '"')) and len(text) >= 3 and text[-1] == text[0]:
        text = text[1:-1]
    if len(text) > 10 or not text:
        return None
    try:
        value = int(text, 0) if len(text) > 1 else ord(text)
    except ValueError:
        data = literal_bytes(f"b'{text}'")
        value = data[0] if data is not None and len(data) == 1 else -1
    if len(text) == 1 and text.isascii() and text.isdigit():
        return ord(text)
    return value if 0 <= value <= 255 else None
