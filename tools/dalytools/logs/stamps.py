# SPDX-License-Identifier: GPL-2.0-or-later
"""Times as logs write them, taken from the beginning of a line.

    2026-11-21T12:34:56.789Z   2026/11/21 12:34:56,789 +01:00   21.11.2026 12:34:56.78   11/21/2026 12:34:56.78 PM
    [12:34:56.789]   12:34:56:789   (12:34:56)                  the day is not known
    Nov 21 12:34:56                                             nor is it without the year
    1700000000.123456   1700000000   1700000000123              seconds since 1970; milli-, micro-, nanoseconds
    20261121123456   20261121T123456.789                        date and time of day without marks
    @4000000065f0a1b23b9ac9ff                                   TAI64N, of daemontools' multilog
    0.004123   12.5s   4.123 ms   [  12.345678]                 seconds since the log's beginning, with a fraction

A moment without a zone is taken as UTC. With slashes the month stands first, unless that can't be.
"""

from __future__ import annotations

import datetime as dt
import re

from dalytools.logs.entry import Stamp

_CLOCK = r"(?P<h>[01]?\d|2[0-3]):(?P<m>[0-5]\d):(?P<s>[0-5]\d)(?:[.,:](?P<f>\d{1,9}))?(?:[ ]?(?P<half>[AaPp][Mm]))?"
_DATE = (
    r"(?:(?P<y>(?:19|20)\d\d)[-/.](?P<mo>\d\d?)[-/.](?P<d>\d\d?)"
    r"|(?P<d2>\d\d?)\.(?P<mo2>\d\d?)\.(?P<y2>(?:19|20)\d\d)"
    r"|(?P<a>\d\d?)/(?P<b>\d\d?)/(?P<y3>(?:19|20)\d\d))"
)
_ZONE = r"(?:[ ]?(?P<zone>Z|[+-]\d\d:?\d\d))?"
_END = r"(?=[\s\])}>:,;#|]|[^\x00-\x7F]|$)[\])}>:,;|]{0,2}[ \t]*"
_OPEN = r"[ \t]*[\[({<]?[ \t]*"
_MOMENT = re.compile(_OPEN + _DATE + r"[T ,_-]{1,2}" + _CLOCK + _ZONE + _END)
_DAY = re.compile(_OPEN + r"(?:(?:Jan|Feb|Mar|Apr|May|Jun|Jul|Aug|Sep|Oct|Nov|Dec)[ ]{1,2}\d\d?[ ])?" + _CLOCK + _END)
_COMPACT = re.compile(
    _OPEN + r"(?P<y>20\d\d)(?P<mo>\d\d)(?P<d>\d\d)[T _-]?(?P<h>[01]\d|2[0-3])(?P<m>[0-5]\d)(?P<s>[0-5]\d)"
    r"(?:[.,](?P<f>\d{1,9}))?(?P<half>)" + _ZONE + _END
)
_UNIX = re.compile(_OPEN + r"(?P<u>1\d{9})(?:\.(?P<f>\d{1,9})|(?P<parts>\d{3}|\d{6}|\d{9}))?" + _END)
_TAI = re.compile(r"@(?P<t>4[0-9a-f]{15})(?P<n>[0-9a-f]{8})[ \t]+")
_START = re.compile(_OPEN + r"\+?(?P<u>\d{1,10})\.(?P<f>\d{1,12})(?:[ ]?(?P<unit>s|ms))?" + _END)

_SECOND = 1_000_000_000
_TAI_EPOCH = (1 << 62) + 10  # TAI64: seconds from 1970, TAI, which daemontools takes as ten ahead


def split_stamp(text: str) -> tuple[Stamp | None, str]:
    """Take the time from the beginning of a line; the time, and the rest."""
    if found := _MOMENT.match(text) or _COMPACT.match(text):
        stamp = _moment(found)
        return (stamp, text[found.end() :]) if stamp else (None, text)
    if found := _TAI.match(text):
        seconds, nanos = int(found["t"], 16) - _TAI_EPOCH, int(found["n"], 16)
        if 0 <= seconds < 1 << 33 and nanos < _SECOND:
            return Stamp("moment", seconds * _SECOND + nanos), text[found.end() :]
        return None, text
    if found := _DAY.match(text):
        return Stamp("day", *_clock(found)), text[found.end() :]
    if found := _UNIX.match(text):
        ns, step = _fraction(found["f"] or found["parts"])
        return Stamp("moment", int(found["u"]) * _SECOND + ns, step), text[found.end() :]
    if found := _START.match(text):
        ns, step = _fraction(found["f"])
        parts = 1000 if found["unit"] == "ms" else 1
        return Stamp("start", (int(found["u"]) * _SECOND + ns) // parts, max(1, step // parts)), text[found.end() :]
    return None, text


def seconds_stamp(text: str) -> Stamp | None:
    """Read seconds since the beginning, with a sign and an exponent if need be: ``0.0429``, ``1.2e-05``."""
    if len(text) > 40:
        return None
    try:
        seconds = float(text)
    except ValueError:
        return None
    if not -1e7 < seconds < 1e7:
        return None
    whole, _, digits = text.strip().lstrip("+").partition(".")
    if whole.isdecimal() and digits.isdecimal():  # exactly, where it is written plainly
        ns, _ = _fraction(digits)
        return Stamp("start", int(whole) * _SECOND + ns)
    return Stamp("start", round(seconds * 1e9))


def _fraction(digits: str | None) -> tuple[int, int]:
    if not digits:
        return 0, _SECOND
    digits = digits[:9]
    return int(digits.ljust(9, "0")), 10 ** (9 - len(digits))


def _clock(found: re.Match[str]) -> tuple[int, int]:
    hours = int(found["h"])
    if found["half"]:
        hours = hours % 12 + (12 if found["half"].lower() == "pm" else 0)
    ns, step = _fraction(found["f"])
    return ((hours * 60 + int(found["m"])) * 60 + int(found["s"])) * _SECOND + ns, step


def _moment(found: re.Match[str]) -> Stamp | None:
    if found["y"]:
        year, month, day = found["y"], found["mo"], found["d"]
    elif found["y2"]:
        year, month, day = found["y2"], found["mo2"], found["d2"]
    else:
        year, month, day = found["y3"], found["a"], found["b"]
        if int(month) > 12:
            month, day = day, month
    try:
        date = dt.date(int(year), int(month), int(day))
    except ValueError:
        return None
    clock, step = _clock(found)
    ns = (date - dt.date(1970, 1, 1)).days * 86400 * _SECOND + clock
    zone = found["zone"]
    if zone and zone != "Z":
        offset = (int(zone[1:3]) * 60 + int(zone[-2:])) * 60 * _SECOND
        ns -= offset if zone[0] == "+" else -offset
    return Stamp("moment", ns, step) if ns >= 0 else None
