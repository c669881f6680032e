# SPDX-License-Identifier: GPL-2.0-or-later
"""Which records stand right behind damaged bytes of their stream (docs/records.md, 8: there number 0 may be lost)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref.kinds import DAMAGED
from dalytools.bulk.equal import all_equal
from dalytools.bulk.records import EVENT, FRAME, KINDS

if TYPE_CHECKING:
    from dalytools.bulk.arrays import Flags
    from dalytools.bulk.records import Records

_IS_DAMAGED: Final = np.array([kind in DAMAGED for kind in KINDS], np.bool_)


class Damage:
    """Follows the streams of one file from lot to lot."""

    def __init__(self) -> None:
        self._open: set[int] = set()  # streams (interface << 2 | side) whose last record is damaged

    def behind(self, records: Records) -> Flags:
        """Tell which of the next records have a damaged one right before them; events are none, and do not count."""
        out = np.zeros(len(records), np.bool_)
        if not self._open and (records.kind == FRAME).all():
            return out
        damaged = _IS_DAMAGED.take(records.kind)
        if not self._open and not damaged.any():
            return out
        rows = np.flatnonzero(records.kind != EVENT)
        if not len(rows):
            return out
        stream = records.interface[rows] << 2 | records.side[rows]
        if not all_equal(stream):
            order = np.argsort(stream, kind="stable")
            rows, stream = rows[order], stream[order]
        begins = np.append(True, stream[1:] != stream[:-1])
        before = np.append(False, damaged[rows[:-1]])
        before[begins] = [key in self._open for key in stream[begins].tolist()]
        out[rows] = before
        last = np.append(begins[1:], True)
        for key, bad in zip(stream[last].tolist(), damaged[rows[last]].tolist(), strict=True):
            (self._open.add if bad else self._open.discard)(key)
        return out
