# SPDX-License-Identifier: GPL-2.0-or-later
"""What comes out: tables of typed columns, named as the dissector names its fields."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dalyref.values import Value
    from dalytools.bulk.arrays import Array, Bytes, Flags, Ints


@dataclass(slots=True)
class Column:
    """One quantity: a row each, or a list a row."""

    values: Array
    """One-dimensional; of lists two-dimensional, what stands behind a list's end has no meaning."""
    valid: Flags | None = None
    """Which rows have a value; None: all."""
    length: Ints | None = None
    """Of lists: how long each is; 0: the row has none."""

    def value(self, row: int) -> Value | list[Value] | None:
        """Return the value of one row as the plain decoder gives it: a list of one is the one; None: it has none."""
        if self.length is not None:
            values = self.values[row, : int(self.length[row])].tolist()
            return values[0] if len(values) == 1 else values or None
        if self.valid is not None and not self.valid[row]:
            return None
        value: Value = self.values[row] if self.values.dtype == object else self.values[row].item()
        return value


@dataclass(slots=True)
class Table:
    """Some records of one kind, in the order of the file."""

    row: Ints
    """Which record it is, counted from 0 over the whole file."""
    number: Ints
    """Packet in which the record ends, as Wireshark counts."""
    time_ns: Ints
    """When its first byte began, in ns since 1970 UTC."""
    interface: Ints
    address: Bytes
    """As sent."""
    board: Bytes
    """1 to 16; 0: not known."""
    columns: dict[str, Column] = field(default_factory=dict[str, Column])
    """By field name."""

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.row)
