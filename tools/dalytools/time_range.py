# SPDX-License-Identifier: GPL-2.0-or-later
"""A range of time as options of a command, in editcap's words: ``-A`` at this time or later, ``-B`` before it."""

from __future__ import annotations

import argparse
import re
from dataclasses import dataclass
from datetime import UTC, datetime

_EPOCH = re.compile(r"(\d{1,12})(?:\.(\d{1,9}))?", re.ASCII)
_CALENDAR = re.compile(r"(\d{4}-\d\d-\d\d)(?:[T ](\d\d:\d\d(?::\d\d)?)(?:\.(\d{1,9}))?)?(Z|[+-]\d\d:?\d\d)?", re.ASCII)
"""Day, time of day, fraction, zone."""


@dataclass(frozen=True, slots=True)
class TimeRange:
    """Which records are asked for: those that begin at `begin_ns` or later, and before `end_ns`; None: no limit."""

    begin_ns: int | None = None
    end_ns: int | None = None

    def holds(self, time_ns: int) -> bool:
        """Tell whether a time (ns since 1970 UTC) is in it."""
        return (self.begin_ns is None or time_ns >= self.begin_ns) and (self.end_ns is None or time_ns < self.end_ns)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options; ``read`` gives them."""
    parser.add_argument(
        "-A",
        "--from",
        dest="begin_ns",
        metavar="TIME",
        type=_time,
        help="only records that begin at this time or later: 2026-03-05T14:30:00 (local time), with Z (UTC) or +01:00 "
        "behind it, or seconds since 1970; what came before is read too, for what it says of the rest",
    )
    parser.add_argument("-B", "--to", dest="end_ns", metavar="TIME", type=_time, help="only records before this time")


def read(args: argparse.Namespace) -> TimeRange:
    """Return what the command line asks for."""
    return TimeRange(args.begin_ns, args.end_ns)


def _time(text: str) -> int:
    """Return a time in ns since 1970 UTC."""
    epoch = _EPOCH.fullmatch(text)
    if epoch:
        return int(epoch[1]) * 1_000_000_000 + _fraction_ns(epoch[2])
    found = _CALENDAR.fullmatch(text)
    if found:
        try:
            moment = datetime.fromisoformat(f"{found[1]}T{found[2] or '00:00'}{found[4] or ''}")
            # A time without a zone is local.
            return round(moment.astimezone(UTC).timestamp()) * 1_000_000_000 + _fraction_ns(found[3])
        except (ValueError, OverflowError, OSError):
            pass
    raise argparse.ArgumentTypeError(
        f"{text!r} is no time; 2026-03-05T14:30:00 is one, with Z for UTC; so is 1772721000"
    )


def _fraction_ns(digits: str | None) -> int:
    return int((digits or "0").ljust(9, "0"))
