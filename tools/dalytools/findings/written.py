# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about writes, and about what boards of Modbus refuse: write, write-denied, write-unconfirmed, modbus-*."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.place import ECHO, place_of
from dalytools.findings.rules import found
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalyref.values import Fields
    from dalytools.findings.finding import Finding

_MOST_SHOWN = 5
_MOST_TEXT = 100
_SHOWN = ("daly.setting.", "daly.command", "daly.clock", "daly.production_date", "daly.modbus.value")
"""What a write sets; a password is not among them."""


@dataclass(slots=True)
class _Write:
    tally: Tally = field(default_factory=Tally)
    unanswered: Tally = field(default_factory=Tally)
    what: dict[str, None] = field(default_factory=dict[str, None])


class Written(Watch):
    """Follows writes by board and ID or register."""

    def __init__(self) -> None:
        self._writes = Groups(_Write)
        self._denied = Groups(Tally)
        self._exceptions = Groups(Tally)
        self._ambiguous = Groups(Tally)

    def record(self, record: Decoded, bus: str) -> None:
        """See one record."""
        fields = record.fields
        if record.kind is not Kind.FRAME:
            return
        if "daly.write" in fields and fields.get("daly.direction") != ECHO:
            write = self._writes[place_of(record, bus)]
            write.tally.add(record.number, record.time_ns)
            if len(write.what) < _MOST_SHOWN:
                write.what[_what(record)] = None
            if "daly.unanswered" in fields:
                write.unanswered.add(record.number, record.time_ns)
        if fields.get("daly.write_result") == "denied":
            self._denied[place_of(record, bus)].add(record.number, record.time_ns)
        if "daly.modbus.exception" in fields:
            code = f"exception {fields['daly.modbus.exception']}"
            self._exceptions[place_of(record, bus, code)].add(record.number, record.time_ns)
        if "daly.modbus.ambiguous" in fields:
            self._ambiguous[place_of(record, bus)].add(record.number, record.time_ns)

    def findings(self) -> Iterator[Finding]:
        """Say what was written, and what came of it."""
        for place, write in self._writes.items():
            yield found("write", place, write.tally, f"{counted(write.tally.count, 'write')}: {'; '.join(write.what)}")
            if write.unanswered.count:
                text = f"{write.unanswered.count} of {counted(write.tally.count, 'write')} got no reply"
                yield found("write-unconfirmed", place, write.unanswered, text)
        for place, tally in self._denied.items():
            yield found("write-denied", place, tally, f"{counted(tally.count, 'write')} answered with something else")
        for place, tally in self._exceptions.items():
            yield found("modbus-exception", place, tally, f"{counted(tally.count, 'exception')}")
        for place, tally in self._ambiguous.items():
            text = f"{counted(tally.count, 'reply', 'replies')} that fit several requests under way"
            yield found("modbus-ambiguous", place, tally, text)


def _what(record: Decoded) -> str:
    """Say what a write sets, by the field names; else its bytes. Of a password only that it is one."""
    if "daly.password" in record.fields:
        return "a password"
    named = _named(record.fields)
    if named:
        return ", ".join(named)[:_MOST_TEXT]
    data = str(record.fields.get("daly.data", ""))
    return f"data {data}" if data else f"{len(record.data)} bytes"


def _named(fields: Fields) -> list[str]:
    return [
        f"{name.removeprefix('daly.').removeprefix('setting.')} {value}"
        for name, value in fields.items()
        if name.startswith(_SHOWN)
    ]
