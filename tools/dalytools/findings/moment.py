# SPDX-License-Identifier: GPL-2.0-or-later
"""Time stamps as text."""

from __future__ import annotations

from datetime import UTC, datetime, tzinfo

_NANO = 1_000_000_000


def iso(time_ns: int) -> str | None:
    """Return ns since 1970 as ISO 8601 in UTC with all nine digits; None for a time that no calendar has, or for 0."""
    seconds, nanos = divmod(time_ns, _NANO)
    if not time_ns:
        return None
    try:
        return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{nanos:09d}Z"
    except (OverflowError, OSError, ValueError):
        return None


def clock(time_ns: int, zone: tzinfo | None = None, *, day: bool = False) -> str:
    """Return the time of day, with `day` its date in front; without a zone local, as ``dalyshark decode`` shows it."""
    seconds, nanos = divmod(time_ns, _NANO)
    try:
        moment = datetime.fromtimestamp(seconds, zone).astimezone(zone)
        return f"{moment:{'%Y-%m-%d ' if day else ''}%H:%M:%S}.{nanos // 1_000_000:03d}"
    except (OverflowError, OSError, ValueError):
        return "--:--:--.---"
