# SPDX-License-Identifier: GPL-2.0-or-later
"""Docklight's communication log as plain text, in HEX (Docklight manual, "Logging and analyzing a test").

    Docklight Log File (HEX) - started 24.11.2026 10:00:00.00
    24.11.2026 10:00:01.12 [TX] - A5 40 90 08 00 00 00 00
    00 00 00 00 7D
    11/24/2026 10:00:01.18 [RX] - A5 01 90 08 ..

A line without head goes on with the one before. qModMaster's [TX] - 10:00:01 - A5 40 .. is read too.
Times are those of the first byte behind a change of direction.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dalytools.logs.entry import IN, OUT, Entry, PlainLineLog
from dalytools.logs.hexbytes import hex_bytes
from dalytools.logs.stamps import split_stamp

if TYPE_CHECKING:
    from dalyref.packet import Direction

_HEAD = re.compile(r"\[(?P<channel>TX|RX|[^\]\n]{1,30})\][ ]*-[ ]*(?P<rest>.*)", re.IGNORECASE)
_NOTES = re.compile(r"\s*(?:Docklight|Started|Stopped|Logging|Comment|-{3,}|={3,})", re.IGNORECASE)


class Docklight(PlainLineLog):
    """A log of Docklight's."""

    name = "docklight"
    about = "Docklight's log in HEX: time [TX] - A5 40 .."
    gaps = False  # a line without a time goes on with the one before

    def __init__(self) -> None:
        self._direction: Direction = ""
        self._begun = False

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line."""
        stamp, rest = split_stamp(line)
        found = _HEAD.match(rest)
        if found and (stamp or found["channel"].upper() in {"TX", "RX"}):
            channel = found["channel"].upper()
            self._direction = OUT if channel.startswith("TX") else IN if channel.startswith("RX") else ""
            self._begun = True
            rest = found["rest"]
            if (
                stamp is None and (later := split_stamp(rest))[0] and later[1].startswith("-")
            ):  # [TX] - 12:34:56 - A5 40
                stamp, rest = later[0], later[1].lstrip("- ")
            data = hex_bytes(rest) if rest.strip() else b""
            return None if data is None else [Entry(data, stamp, self._direction)] if data else []
        if _NOTES.match(line):
            return []
        data = hex_bytes(line) if self._begun else None
        return None if data is None else [Entry(data, None, self._direction)]
