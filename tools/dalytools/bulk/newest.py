# SPDX-License-Identifier: GPL-2.0-or-later
"""The newest value before a place, for each board by itself: counts of 94 for bursts, the state of 93 for a 90."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from dalytools.bulk.arrays import Array, Bytes, Flags, Ints, Shorts


@dataclass(slots=True)
class Newest:
    """Remembers one quantity of each board over the lots of one bus. -1: not known."""

    known: dict[int, int] = field(default_factory=dict[int, int])
    """By address byte, at the end of the lot before."""

    def look(self, at: Ints, address: Bytes, told_at: Ints, told_by: Bytes, told: Array) -> Shorts:
        """Return what was last told before each place `at` by the same address, and remember the lot's last.

        told_at: rising places where something was told; told_by: by whom; told: what.
        """
        if not len(told_at) and not self.known:
            return np.full(len(at), -1, np.int16)
        if len(told_at) and (told_by == told_by[0]).all() and (address == told_by[0]).all():
            one = int(told_by[0])  # one board, as nearly always
            value = self.known.get(one, -1)
            if (told == value).all():  # nothing new
                return np.full(len(at), value, np.int16)
            values = np.concatenate((np.array([value], np.int16), told.astype(np.int16)))
            self.known[one] = int(values[-1])
            return values[np.searchsorted(told_at, at)]
        out = np.array([self.known.get(one, -1) for one in range(256)], np.int16)[address]
        for one in np.unique(told_by).tolist():
            mine = told_by == one
            places, values = told_at[mine], told[mine].astype(np.int16)
            asks: Flags = address == one
            before = np.searchsorted(places, at[asks]) - 1
            out[asks] = np.where(before >= 0, values[np.maximum(before, 0)], self.known.get(one, -1))
            self.known[one] = int(values[-1])
        return out
