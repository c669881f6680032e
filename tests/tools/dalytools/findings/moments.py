# SPDX-License-Identifier: GPL-2.0-or-later
"""A time that a rule counted something, and a note of what was put in: what recall holds against each other."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from dalytools.findings.finding import Severity
    from dalytools.findings.place import Place

Note = Mapping[str, object]


class Moment(NamedTuple):
    """One of the times that a rule counted something, s from the beginning."""

    rule: str
    place: Place
    severity: Severity
    seconds: float


def at(note: Note) -> float:
    """Return when a note was taken, s from the beginning."""
    return float(str(note["time"]))


def during(notes: list[Note], first: float, last: float) -> list[Note]:
    """Return those of that time."""
    return notes[bisect_left(notes, first, key=at) : bisect_left(notes, last, key=at)]
