# SPDX-License-Identifier: GPL-2.0-or-later
"""Logs of Chinese COM tools: SSCOM, and UartAssist, NetAssist and their like.

    [15:37:11.116]发→◇A5 40 90 08 .. □        SSCOM: sent; 收←◆ is received; older ones 发送, 接收; English: OUT, IN
    [15:37:11.165]收←◆A5 01 90 08 ..

    [2025-08-12 22:08:26.776]# SEND HEX>      UartAssist: the bytes are in the lines that follow
    A5 40 90 08 00 00 00 00 00 00 00 00 7D

Both write GB 18030 as well as UTF-8. Sources: such lines in public code and issues, found by a search for the marks.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog
from dalytools.logs.hexbytes import hex_bytes
from dalytools.logs.stamps import split_stamp

if TYPE_CHECKING:
    from dalyref.packet import Direction
    from dalytools.logs.entry import Stamp

_SSCOM = re.compile(r"(?:(?P<out>发(?:送)?|OUT)|(?P<in>收|接收|IN))(?:→|←|[-<>=])*[◇◆:\uff1a]+(?P<rest>[^□]*)□?\s*")
_ASSIST = re.compile(r"#?\s*(?:(?P<out>SEND)|(?P<in>RECV))\s+(?P<how>HEX|ASCII)[^>]*>(?P<rest>.*)", re.IGNORECASE)


class ComTool(PlainLineLog):
    """A log of SSCOM or UartAssist."""

    name = "comtool"
    about = "COM tools: SSCOM ([time]发→◇A5 ..), UartAssist ([time]# RECV HEX>)"

    def __init__(self) -> None:
        self._stamp: Stamp | None = None
        self._direction: Direction = ""
        self._open = False  # bytes may follow in the next lines
        self._text = False

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        stamp, rest = split_stamp(line)
        found = _SSCOM.fullmatch(rest.strip()) or _ASSIST.fullmatch(rest.strip())
        if found:
            self._direction = OUT if found["out"] else IN
            self._stamp, self._open = stamp, True
            self._text = found.re is _ASSIST and found["how"].upper() == "ASCII"
            line = found["rest"]
            if not line.strip():
                return []
        elif not self._open or stamp is not None:
            return None
        if line.strip() in {"", "□"}:
            return []
        data = None if self._text else hex_bytes(line.strip().rstrip("□"))
        if data is None:
            return None
        stamp, self._stamp = self._stamp, None
        return [Entry(data, stamp, self._direction)]
