# SPDX-License-Identifier: GPL-2.0-or-later
r"""CSV exports of Saleae's Logic: the table of an Async Serial analyzer, a byte a row, with its time.

    Time [s],Value,Parity Error,Framing Error            Logic 1
    0.042909760000000,0xA5,,
    0.042980320000000,0xD4,,Error

    name,type,start_time,duration,"data"                 Logic 2; "error" may follow
    "Async Serial","data",1.096099,0.00104,0xA5
    "Async Serial","data",1.097141,0.00104,"\xA5"

Values in hex (0xA5), decimal (165), binary (0b10100101) or as a letter. Times are of the start bit, from the trigger.
Several analyzers are told apart by name: TX in it is what a host sent, RX what it received. Framing and parity errors
are kept.
Sources: such tables in public repositories, and the exporter of Saleae's open serial analyzer.
"""

from __future__ import annotations

import csv

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog
from dalytools.logs.hexbytes import literal_bytes
from dalytools.logs.stamps import seconds_stamp

_TIMES = ("start_time", "time [s]", "time[s]", "time")
_VALUES = ("data", "value")


class Saleae(PlainLineLog):
    """A table of Logic 1 or 2."""

    name = "saleae"
    about = "Saleae Logic's CSV of an Async Serial analyzer: byte times and framing errors"
    gaps = False

    def __init__(self) -> None:
        self._columns: list[str] = []

    def parse(self, line: str) -> list[Entry] | None:
        """Read a row."""
        try:
            (row,) = csv.reader([line])
        except (ValueError, csv.Error):
            return None
        if not self._columns:
            names = [name.strip().lower() for name in row]
            if any(name in _TIMES for name in names) and any(name in _VALUES for name in names):
                self._columns = names
                return []
            return None
        cells = dict(zip(self._columns, row, strict=False))
        stamp = seconds_stamp(next((cells[name] for name in _TIMES if name in cells), ""))
        kind = cells.get("type", "data").strip().lower()
        if stamp is None:
            return None
        if kind not in {"data", ""}:
            return []
        value = byte_value(next((cells[name] for name in _VALUES if name in cells), ""))
        if value is None:
            return None
        errors = [cells[name].strip() for name in cells if "error" in name]
        name = cells.get("name", "").upper()
        direction = OUT if "TX" in name else IN if "RX" in name else ""
        bad = any(error and error.lower() not in {"false", "0", "none"} for error in errors)
        return [Entry(bytes((value,)), stamp, direction, bad)]


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
