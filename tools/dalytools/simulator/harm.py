# SPDX-License-Identifier: GPL-2.0-or-later
"""What a bad wire does to the bytes of a frame.

drop      A5 01 90 .. .. 75 30 02 6C C3      one to three bytes are lost, never the first
flip      A5 01 90 08 02 15 ^^ ..            one bit is wrong
insert    A5 01 90 FF 3C 08 02 15 ..         one to four bytes that nobody sent
cut       A5 01 90 08                        the end is missing
collide   A5 01 90 08 00 14 20 ..            somebody speaks at the same time, from there on
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import random

    from dalytools.simulator.scenario import Damage, Harm


def harmed(data: bytes, dice: float | Harm, damage: Damage, chance: random.Random) -> tuple[Harm, bytes]:
    """Damage a frame; which way, and what is heard of it.

    dice: 0 up to the total of the shares of ``damage``, which it falls into; or the way itself.
    """
    size = len(data)
    place = int(chance.random() * size)
    how = dice if isinstance(dice, str) else _way(dice, damage)
    match how:
        case "drop":
            lost = 1 + int(chance.random() * 3)
            start = min(max(place, 1), size - 1)  # the first byte is still heard
            heard = data[:start] + data[start + lost :]
        case "flip":
            bit = 1 << int(chance.random() * 8)
            heard = data[:place] + bytes((data[place] ^ bit,)) + data[place + 1 :]
        case "insert":
            noise = bytes([int(chance.random() * 256) for _ in range(1 + int(chance.random() * 4))])
            heard = data[:place] + noise + data[place:]
        case "cut":
            heard = data[: max(1, place)]
        case "collide":
            other = bytes([int(chance.random() * 255) for _ in range(size - place)])  # never FF, which harms nothing
            heard = overlaid(data, other, place)
            if heard == data:
                heard = data[:place] + bytes((data[place] ^ 0x11,)) + data[place + 1 :]
    return how, heard


def _way(dice: float, damage: Damage) -> Harm:
    """Which of the shares it falls into, in their order."""
    shares: tuple[tuple[Harm, float], ...] = (
        ("drop", damage.drop),
        ("flip", damage.flip),
        ("insert", damage.insert),
        ("cut", damage.cut),
        ("collide", damage.collide),
    )
    last: Harm = "drop"
    for how, share in shares:
        if share:
            last = how
        if dice < share:
            return how
        dice -= share
    return last


def overlaid(data: bytes, other: bytes, place: int) -> bytes:
    """Hear two at once, the other from that byte on: where both speak, a zero bit wins; the rest of either follows."""
    both = bytes(one & two for one, two in zip(data[place:], other, strict=False))
    longer = data[place:] if len(data) - place > len(other) else other
    return data[:place] + both + longer[len(both) :]
