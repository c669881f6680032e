# SPDX-License-Identifier: GPL-2.0-or-later
"""Columns that say the same in every row: one value that numpy shows as often as there are rows (``broadcast_to``)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dalytools.bulk.arrays import Array, Ints


def repeated(value: int, count: int) -> Ints:
    """Return a column, not to be written to, that takes no memory."""
    return np.broadcast_to(np.array(value, np.int64), count)


def all_equal(column: Array) -> bool:
    """Tell whether all rows of a column, which has some, are equal."""
    return column.strides[0] == 0 or bool((column == column[0]).all())
