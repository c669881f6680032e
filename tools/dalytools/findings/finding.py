# SPDX-License-Identifier: GPL-2.0-or-later
"""A finding: what belongs together (one rule, one board, one ID), how often, from where to where, and what to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dalytools.findings.place import Place


class Severity(IntEnum):
    """How bad. note: worth knowing; warning: look at it; error: something is wrong, and CI shall stop."""

    NOTE = 1
    WARNING = 2
    ERROR = 3

    def __str__(self) -> str:
        return self.name.lower()


SEVERITIES = {str(severity): severity for severity in Severity}
"""By the names that users type."""


@dataclass(slots=True)
class Tally:
    """How often something was seen, first and last: packet as Wireshark counts, time in ns since 1970 UTC."""

    count: int = 0
    first_packet: int = 0
    last_packet: int = 0
    first_ns: int = 0
    last_ns: int = 0

    def add(self, number: int, time_ns: int) -> None:
        """Count one more."""
        if not self.count:
            self.first_packet, self.first_ns = number, time_ns
        self.count += 1
        self.last_packet, self.last_ns = number, time_ns


@dataclass(slots=True)
class Finding:
    """One line of what was found in one capture."""

    rule: str
    severity: Severity
    place: Place
    tally: Tally
    text: str
    """What was seen, in words for people."""
    advice: str
    """What to do about it."""
    examples: tuple[str, ...] = field(default=())
    """A few of the cases, each in a line."""

    @property
    def key(self) -> tuple[str, str]:
        """What makes two findings, of two captures too, the same one."""
        return self.rule, str(self.place)
