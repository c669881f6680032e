# SPDX-License-Identifier: GPL-2.0-or-later
"""The limits that are the rules' own; all others are the constants of the reading (docs/records.md)."""

from __future__ import annotations

from dataclasses import dataclass

SILENT_AFTER = 3
"""So many unanswered requests, and no reply ever, make an address silent: clients send up to two retries."""
MOST_PLACES = 1000
"""A hostile capture may not make one rule hold more: what comes then is counted together."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What can be set."""

    late_s: float = 0.5
    """A reply later than this is late: the time-out of most clients (field notes b, pacing)."""
    damaged_percent: float = 1.0
    """A bus with more bytes outside good frames than this is a bad one."""
