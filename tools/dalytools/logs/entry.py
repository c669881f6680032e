# SPDX-License-Identifier: GPL-2.0-or-later
"""What a log says of some bytes, and what every kind of log is read by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, Literal, Protocol

if TYPE_CHECKING:
    from dalyref.packet import Direction

OUT: Direction = "outbound"
IN: Direction = "inbound"
DAY_NS: Final = 86400 * 10**9


@dataclass(frozen=True, slots=True)
class Stamp:
    """When a log says that it was.

    what: ``moment`` (ns since 1970; UTC where the log names no zone), ``day`` (ns since midnight of a day not known),
    ``start`` (ns since the log's beginning). step_ns: how fine the log writes it.
    """

    what: Literal["moment", "day", "start"]
    ns: int
    step_ns: int = 1


@dataclass(frozen=True, slots=True)
class Entry:
    """Some bytes of a log. direction: outbound is what a host sent; can_id: of a CAN frame (29 bits:
    above 7FF, or with SocketCAN's flags).
    """

    data: bytes
    stamp: Stamp | None = None
    direction: Direction = ""
    bad: bool = False  # the log says: framing or parity error
    can_id: int | None = None


class LineLog(Protocol):
    """Reads one kind of log line by line; made anew for each file.

    stamped_at_end: times are of the last byte, not of the first. gaps: a new line without a time is a new message.
    """

    name: str
    about: str
    stamped_at_end: bool
    gaps: bool

    def look(self, lines: list[str]) -> None:
        """Look at the first lines of the log, before they are read."""
        ...

    def parse(self, line: str) -> list[Entry] | None:
        """Read a line: its bytes, if any; None where it is not understood."""
        ...

    def finish(self) -> list[Entry]:
        """Hand out what waited for another line."""
        ...


class PlainLineLog:
    """What most kinds have in common."""

    name = ""
    about = ""
    stamped_at_end = False
    gaps = True

    def look(self, lines: list[str]) -> None:
        """Nothing depends on it."""

    def finish(self) -> list[Entry]:
        """Nothing waits."""
        return []
