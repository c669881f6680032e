# SPDX-License-Identifier: GPL-2.0-or-later
"""The debug log of ``dalybms`` (dreadnought/python-daly-bms): ``daly-bms-cli --verbose``, or a program that uses it.

    DEBUG    [daly_bms.py:100] -- 90 ------------------------
    DEBUG    [daly_bms.py:70] w a540900800000000000000007d           written
    DEBUG    [daly_bms.py:119] 0 a50190080215000075300271c4 13       read: place, bytes, how many

Its own format has no times; a program's may have them in front. Times are those of the line's printing, behind the last
byte. Source: dalybms 0.5.0, daly_bms.py and daly_sinowealth.py.
"""

from __future__ import annotations

import re

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog
from dalytools.logs.stamps import split_stamp

_WRITTEN = re.compile(r"(?:.*[\s:\]])?w ((?:[0-9a-f]{2}){4,200})\s*")
_READ = re.compile(r"(?:.*[\s:\]])?\d{1,3} ((?:[0-9a-f]{2}){1,200}) (\d{1,3})\s*")
_ASKED_SINOWEALTH = re.compile(r".*message: bytearray\(.{1,200}\), ((?:[0-9a-f]{2}){1,20})\s*")
_READ_SINOWEALTH = re.compile(r"(?:.*[\s:\]])?((?:[0-9a-f]{2}){1,20}) \((\d{1,2})\)\s*")
_KNOWN = re.compile(
    r".*(?:-- [0-9a-f]{2} -{5,}|try failed, retrying|empty response for command|response crc mismatch|invalid header"
    r"|failed after \d+ tries|frame out of order|skipping response|\[daly_(?:bms|sinowealth)\w*\.py:\d+\]|daly-bms-cli)"
)


class DalyBms(PlainLineLog):
    """A debug log of dalybms."""

    name = "dalybms"
    about = "dalybms' debug log: .. w a54090.. and .. 0 a50190.. 13"
    stamped_at_end = True

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        stamp, rest = split_stamp(line)
        rest = rest[:1000]
        if found := _WRITTEN.fullmatch(rest) or _ASKED_SINOWEALTH.fullmatch(rest):
            return [Entry(bytes.fromhex(found[1]), stamp, OUT)]
        if (found := _READ.fullmatch(rest) or _READ_SINOWEALTH.fullmatch(rest)) and len(found[1]) == 2 * int(found[2]):
            return [Entry(bytes.fromhex(found[1]), stamp, IN)]
        return [] if _KNOWN.match(rest) else None
