# SPDX-License-Identifier: GPL-2.0-or-later
"""When a table can be written the quick way: chosen values to one Parquet file, a row a record (docs/bulk.md)."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING, Final

from dalytools.exports import records
from dalytools.exports.choice import choose

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.exports.export import Plan
    from dalytools.exports.schema import Column

_LISTS: Final = frozenset(("daly.cell.voltage", "daly.temperature", "daly.cells.voltage", "daly.sensors.temperature"))
_OF_THE_RECORD: Final = ("daly.direction", "daly.board", "daly.modbus.", "daly.can.")


def chosen(plan: Plan, files: Sequence[str]) -> list[Column] | None:
    """Return the columns that are asked for, where the quick way gives the same rows; else None."""
    if plan.format != "parquet" or plan.rows != "record" or plan.fields is None or plan.partition:
        return None
    if "-" in files or importlib.util.find_spec("numpy") is None:
        return None
    from dalytools.bulk.left_out import LEFT_OUT

    columns = choose(plan.fields, records.CHOICES, records.HEAD)
    for column in columns:
        name = column.field
        if not name or name in LEFT_OUT or name.startswith(_OF_THE_RECORD):
            return None
        if column.several != (name in _LISTS):
            return None
    return columns
