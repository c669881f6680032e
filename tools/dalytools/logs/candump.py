# SPDX-License-Identifier: GPL-2.0-or-later
"""What ``candump`` of can-utils prints: for people, and with ``-L``.

    (1767225600.051248)  can0  18904001   [8]  02 10 00 00 75 30 01 F4       -ta; -tA has date and time, -tz starts at 0
    (000.051248)  can0  RX - -  18904001   [8]  02 10 ..   '....u0..'         -td (times since the line before) -x -a
      can0  18904001   [8]  02 10 00 00 75 30 01 F4                           no times
    (1767225600.051248) can0 18904001#0210000075 3001F4 R                     -L; decode and check read it as it is

CAN FD is not understood. All interfaces become one bus. Source: can-utils, lib.c and candump.c.
"""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from dalytools.logs.entry import Entry, PlainLineLog
from dalytools.logs.stamps import split_stamp

_LINE = re.compile(
    r"[A-Za-z]\w{0,15}[ ]+(?:(?:RX|TX)[ -][B-][ ][E-][ ]+)?(?P<id>[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})"
    r"(?:[ ]+\[(?P<n>\d)\](?:[ ]+(?P<remote>remote request))?(?P<data>(?:[ ]+[0-9A-Fa-f]{2}){0,8})"
    r"(?:[ ]+(?:'.{0,8}'|ERRORFRAME.*))*|#(?P<log>(?:[0-9A-Fa-f]{2}){0,8}|R\d?)(?:[ ][RT])?)[ ]*"
)
_EXTENDED: Final = 0x8000_0000
_REMOTE: Final = 0x4000_0000
_ERROR: Final = 0x2000_0000


class CanDump(PlainLineLog):
    """What candump prints."""

    name = "candump"
    about = "candump of can-utils: (1767225600.051248)  can0  18904001   [8]  02 10 .."

    def __init__(self) -> None:
        self._between = False  # times are since the line before
        self._now_ns = 0

    def look(self, lines: list[str]) -> None:
        """See whether times are since the beginning or since the line before: those do not always grow."""
        times = [stamp.ns for stamp, _ in map(split_stamp, lines) if stamp is not None and stamp.what == "start"]
        self._between = times != sorted(times)

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        stamp, rest = split_stamp(line)
        found = _LINE.fullmatch(rest.strip())
        if not found:
            return None
        remote = bool(found["remote"]) or (found["log"] or "").startswith("R")
        data = b"" if remote else bytes.fromhex(found["data"] or found["log"] or "")
        if found["n"] and not remote and int(found["n"]) != len(data):
            return None
        identifier = int(found["id"], 16)
        if len(found["id"]) == 8 and not identifier & _ERROR:
            identifier |= _EXTENDED
        if stamp is not None and stamp.what == "start" and self._between:
            self._now_ns += stamp.ns
            stamp = replace(stamp, ns=self._now_ns)
        return [Entry(data, stamp, can_id=identifier | (_REMOTE if remote else 0))]
