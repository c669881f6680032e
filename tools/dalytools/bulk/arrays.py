# SPDX-License-Identifier: GPL-2.0-or-later
"""The types of the columns."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Array: TypeAlias = "NDArray[Any]"
Bytes: TypeAlias = "NDArray[np.uint8]"
Ints: TypeAlias = "NDArray[np.int64]"
Shorts: TypeAlias = "NDArray[np.int16]"
Flags: TypeAlias = "NDArray[np.bool_]"
Words32: TypeAlias = "NDArray[np.uint32]"
Words64: TypeAlias = "NDArray[np.uint64]"
Words: TypeAlias = "NDArray[np.uint64]"
"""N x 2: sixteen bytes a row, little-endian."""
