# SPDX-License-Identifier: GPL-2.0-or-later
"""Fields of a record: names and values, as the dissector shows them."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Sequence

Value: TypeAlias = int | float | bool | str
"""Bytes are lower-case hex without separators."""
Fields: TypeAlias = dict[str, Value | list[Value]]


def put(fields: Fields, name: str, values: Sequence[Value]) -> None:
    """Add a field that may occur several times: a list, a single value, or nothing at all."""
    if len(values) == 1:
        fields[name] = values[0]
    elif values:
        fields[name] = list(values)


def add(fields: Fields, name: str, value: Value) -> None:
    """Add one more value behind those that a field has."""
    before = fields.get(name)
    if before is None:
        fields[name] = value
    else:
        fields[name] = [*(before if isinstance(before, list) else [before]), value]
