# SPDX-License-Identifier: GPL-2.0-or-later
"""What is said of some bytes, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Claim:
    """One thing that was found out about bytes of a place."""

    kind: str
    """counter, number, steady, clock, date, text, mirror, follows."""
    first: int
    last: int
    """Bytes, from 0."""
    text: str
    """A sentence without its subject."""
    count: int
    """How many observations speak for it."""
    strength: float
    """0 to 1: the share of all observations that fit; of follows: the correlation, without its sign."""
