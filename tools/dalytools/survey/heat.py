# SPDX-License-Identifier: GPL-2.0-or-later
"""How often a bit flips, in five steps."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from dalytools.survey.moves import Moves

STEPS: Final = ("never", "below 1 %", "below 10 %", "below 35 %", "35 % and more")
"""Of all times that it could."""


def heat(flips: int, times: int) -> int:
    """Return the step, 0 to 4."""
    if not flips or not times:
        return 0
    share = flips / times
    return 1 if share < 0.01 else 2 if share < 0.1 else 3 if share < 0.35 else 4


def byte_heat(moves: Moves, index: int) -> tuple[int, ...]:
    """Return the steps of the bits of a byte, bit 7 first."""
    times = moves.count - 1
    return tuple(heat(moves.flips[8 * index + bit], times) for bit in range(7, -1, -1))
