# SPDX-License-Identifier: GPL-2.0-or-later
"""What a row is, and who makes rows of records."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dalyref.decoder import Decoded
    from dalyref.values import Value
    from dalytools.exports.schema import Column

Cell: TypeAlias = "Value | list[Value | None]"
Row: TypeAlias = dict[str, Cell]
"""By column name; what is null is left out. The time is in ns since 1970 UTC."""


class Shape(Protocol):
    """Makes rows of records."""

    @property
    def columns(self) -> Sequence[Column]:
        """Return every column that a row can have, in order."""
        ...

    def take(self, file: str, record: Decoded) -> Iterable[Row]:
        """Take the next record of a file; return the rows that are complete."""
        ...

    def end_file(self) -> Iterable[Row]:
        """Take the end of a file; return what was held back."""
        ...
