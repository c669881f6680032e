# SPDX-License-Identifier: GPL-2.0-or-later
"""What a board does to its answer of several frames when a scenario asks for it.

skip_frame 2     1  .  3  4        cut_burst 2     1  2        repeat_frame 2     1  2  2  3  4
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dalytools.simulator.scenario import Event

Tampered = tuple[str, dict[str, int]]
"""What was done to an answer, and where: for the truth."""
_ORDER = ("skip_frame", "cut_burst", "repeat_frame")


def tampered(frames: list[bytes], tricks: list[Event]) -> tuple[list[bytes], list[Tampered]]:
    """Leave out or repeat frames of a burst, each by its place in the whole one; return the rest, and what was done.

    One that is left out does not come twice, whichever was asked for first.
    """
    done: list[Tampered] = []
    places: list[int] = list(range(1, len(frames) + 1))
    for event in sorted(tricks, key=_order):
        place = event.frames
        if event.what not in _ORDER or len(places) < 2 or place not in places:
            continue
        if event.what == "cut_burst":
            if place == places[-1]:
                continue
            places = [one for one in places if one <= place]
            done.append(("cut_burst", {"sent": len(places), "of": len(frames)}))
        elif event.what == "skip_frame":
            places.remove(place)
            done.append(("skipped_frame", {"frame": place}))
        else:
            places.insert(places.index(place), place)
            done.append(("repeated_frame", {"frame": place}))
    return [frames[place - 1] for place in places], done


def _order(event: Event) -> int:
    return _ORDER.index(event.what) if event.what in _ORDER else 0
