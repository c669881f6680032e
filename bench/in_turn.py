# SPDX-License-Identifier: GPL-2.0-or-later
"""Measure several ways of doing the same in this process: CPU time, the ways in turn, the median of each."""

from __future__ import annotations

import gc
import time
from statistics import median
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def in_turn(ways: Mapping[str, Callable[[], object]], repeat: int) -> dict[str, float]:
    """Call each way ``repeat`` times after one call that does not count; the median CPU time of each, in s."""
    taken: dict[str, list[float]] = {name: [] for name in ways}
    for turn in range(repeat + 1):
        for name, way in ways.items():
            gc.collect()
            started = time.process_time()
            way()
            if turn:
                taken[name].append(time.process_time() - started)
    return {name: median(times) for name, times in taken.items()}
