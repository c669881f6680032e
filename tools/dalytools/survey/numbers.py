# SPDX-License-Identifier: GPL-2.0-or-later
"""Neighbouring bytes that are one number: when the lower one runs over, the higher one goes up or down by one.

cells, high byte first   | 0C  FF | 0C  FE |      two cells that move alike: FF and the second 0C look like a
'----'             number with its low byte first, too; so the order that explains
more of the payload is taken, and the other one is not said
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools.survey.claim import Claim

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.survey.moves import Carries, Moves

_BITS: Final = 30
"""Evidence that is enough, whatever the number of pairs looked at."""
_LEAST_CARRIES: Final = 4
_LOW, _HIGH = 0x20, 0xDF
"""The lower byte must have been on both sides of its overrun."""


def numbers(moves: Moves) -> list[Claim]:
    """Find the bytes that belong together as one number."""
    if not moves.values:
        return []
    big = _in_order(moves, moves.big, 1, "high byte first")
    little = _in_order(moves, moves.little, 0, "low byte first")
    return little if sum(claim.count for claim in little) > sum(claim.count for claim in big) else big


def _in_order(moves: Moves, all_carries: Sequence[Carries], lower: int, words: str) -> list[Claim]:
    """Find those of one order. lower: which of two bytes is the lower one, 0 or 1."""
    out: list[Claim] = []
    index = 0
    while index < len(all_carries):
        last = index
        carries = against = 0
        while last < len(all_carries) and _are_one(moves, all_carries[last], last + lower):
            carries += all_carries[last].carries
            against += all_carries[last].against
            last += 1
        if last > index:
            text = f"one number of {8 * (last - index + 1)} bits, {words}: {carries} carries"
            text += f", {against} against it" if against else ", none against it"
            out.append(Claim("number", index, last, text, carries + against, carries / (carries + against)))
        index = last + 1
    return out


def _are_one(moves: Moves, pair: Carries, lower: int) -> bool:
    if pair.evidence < _BITS or pair.carries < _LEAST_CARRIES:
        return False
    if 20 * pair.against > pair.carries or 10 * pair.carries < 3 * pair.steps or pair.evidence < 2 * pair.carries:
        return False
    values = moves.seen(lower)
    return min(values) < _LOW and max(values) > _HIGH and len(values) >= 8
