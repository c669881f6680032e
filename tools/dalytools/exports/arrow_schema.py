# SPDX-License-Identifier: GPL-2.0-or-later
"""Columns as pyarrow has them. Units stand in a field's metadata too: ``unit``, beside ``field``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pyarrow as pa

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dalytools.exports.schema import Column, Type


def arrow_type(kind: Type) -> pa.DataType:
    """Return the type of one value."""
    match kind:
        case "bool":
            return pa.bool_()
        case "int32":
            return pa.int32()
        case "int64":
            return pa.int64()
        case "double":
            return pa.float64()
        case "text":
            return pa.string()
        case "time":
            return pa.timestamp("us", tz="UTC")  # Spark reads no nanoseconds


def arrow_schema(columns: Iterable[Column]) -> pa.Schema:
    """Return the schema of a table of these columns, all of which may be null."""
    fields: list[pa.Field[pa.DataType]] = []
    for column in columns:
        kind = arrow_type(column.type)
        told = {"unit": column.unit, "field": column.field}
        metadata: dict[bytes | str, bytes | str] = {key: value for key, value in told.items() if value}
        fields.append(pa.field(column.name, pa.list_(kind) if column.several else kind, metadata=metadata))
    return pa.schema(fields)
