# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about writes, and about what boards of Modbus refuse: write, write-denied, write-unconfirmed, modbus-*."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.place import ECHO, number, place_of, words
from dalytools.findings.rules import found
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalyref.values import Fields
    from dalytools.findings.finding import Finding

_MOST_SHOWN = 5
_REMEMBERED = 256  # requests
_MOST_TEXT = 100
_SHOWN = ("daly.setting.", "daly.command", "daly.clock", "daly.production_date")
"""What a write sets; a password is not among them."""
_MOS = {"daly.setting.mos_charge": "charge MOS", "daly.setting.mos_discharge": "discharge MOS"}
_SOC = "daly.setting.soc"


@dataclass(slots=True)
class _Write:
    tally: Tally = field(default_factory=Tally)
    unanswered: Tally = field(default_factory=Tally)
    what: dict[str, None] = field(default_factory=dict[str, None])


@dataclass(slots=True)
class _Denied:
    tally: Tally = field(default_factory=Tally)
    said: dict[str, None] = field(default_factory=dict[str, None])


class Written(Watch):
    """Follows writes by board and ID or register."""

    def __init__(self) -> None:
        self._writes = Groups(_Write)
        self._asked: OrderedDict[int, str] = OrderedDict()  # a write's packet: what it sets
        self._denied = Groups(_Denied)
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
            what = self._asked[record.number] = _what(record)
            if len(self._asked) > _REMEMBERED:
                self._asked.popitem(last=False)
            if len(write.what) < _MOST_SHOWN:
                write.what[what] = None
            if "daly.unanswered" in fields:
                write.unanswered.add(record.number, record.time_ns)
        if fields.get("daly.write_result") == "denied":
            denied = self._denied[place_of(record, bus)]
            denied.tally.add(record.number, record.time_ns)
            asked = self._asked.get(number(fields, "daly.request_in") or 0, "")
            if asked and len(denied.said) < _MOST_SHOWN:
                denied.said[f"asked: {asked}, the board says: {_what(record)}"] = None
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
        for place, denied in self._denied.items():
            text = f"{counted(denied.tally.count, 'write')} answered with something else; {'; '.join(denied.said)}"
            yield found("write-denied", place, denied.tally, text.removesuffix("; "))
        for place, tally in self._exceptions.items():
            yield found("modbus-exception", place, tally, f"{counted(tally.count, 'exception')}")
        for place, tally in self._ambiguous.items():
            text = f"{counted(tally.count, 'reply', 'replies')} that fit several requests under way"
            yield found("modbus-ambiguous", place, tally, text)


def _what(record: Decoded) -> str:
    """Say what a write sets, or its reply says, by field names; else its bytes. Of a password only that it is one."""
    if "daly.password" in record.fields:
        return "a password"
    named = _named(record.fields)
    if named:
        return ", ".join(named)[:_MOST_TEXT]
    if "daly.modbus.value" in record.fields:
        return f"value {', '.join(words(record.fields, 'daly.modbus.value'))}"[:_MOST_TEXT]
    data = str(record.fields.get("daly.data", ""))
    return f"data {data}" if data else f"{len(record.data)} bytes"


def _named(fields: Fields) -> list[str]:
    return [_said(name, value) for name, value in fields.items() if name.startswith(_SHOWN)]


def _said(name: str, value: object) -> str:
    if name in _MOS:
        return f"{_MOS[name]} {'on' if value else 'off'}"
    return f"SOC {value} %" if name == _SOC else f"{name.removeprefix('daly.').removeprefix('setting.')} {value}"
