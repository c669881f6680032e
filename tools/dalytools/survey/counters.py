# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes that count: by the same step each time, round and round."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools.survey.claim import Claim

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalytools.survey.moves import Moves

_LEAST: Final = 16
_SHARE: Final = 0.95


def counters(moves: Moves) -> Iterator[Claim]:
    """Find the bytes that count."""
    for index in range(moves.size):
        steps = moves.stepped(index)
        transitions = sum(steps.values())
        if transitions < _LEAST:
            continue
        step, times = max(steps.items(), key=lambda item: item[1])
        if step == 0:
            continue
        by = f"up by {step}" if step < 128 else f"down by {256 - step}"
        share = times / transitions
        if share >= _SHARE:
            over = "and runs over" if moves.wraps[index] else "no overrun seen"
            text = f"counts {by} each time, {over}"
            yield Claim("counter", index, index, text, transitions, share)
            continue
        turn = _turn(moves, index, steps, step)
        if turn and times + turn >= _SHARE * transitions:
            values = moves.seen(index)
            text = f"counts {by} each time, from {min(values)} to {max(values)} and round again"
            yield Claim("counter", index, index, text, transitions, (times + turn) / transitions)


def _turn(moves: Moves, index: int, steps: dict[int, int], step: int) -> int:
    """Return how often a byte that counts by one turned from its one end to its other; 0: it does not."""
    values = moves.seen(index)
    low, high = min(values), max(values)
    if step not in (1, 255) or len(values) != high - low + 1 or len(values) < 3:
        return 0
    back = (low - high if step == 1 else high - low) & 0xFF
    turned = steps.get(back, 0)
    return turned if turned >= 2 else 0
