# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about what replies say: contradiction, zero-reply, fault-raised, fault-standing, unknown-id."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.place import REPLY, Place, address_of, number, place_of, words
from dalytools.findings.rules import found
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalyref.values import Fields
    from dalytools.findings.finding import Finding

_EXAMPLES = 3
_FAULT = "daly.fault."
_STATES = frozenset(("mos_off_by_command", "charging_cabinet_offline"))  # docs/protocol.md, a.98: no faults
_SAYS = {
    "pack_voltage": "pack voltage and the sum of the cells differ",
    "cell_max": "the highest cell voltage (0x91) and the cells (0x95) differ",
    "cell_min": "the lowest cell voltage (0x91) and the cells (0x95) differ",
    "cell_number": "0x91 names a cell that 0x94 says is not there",
    "temperature_max": "the highest temperature (0x92) and the sensors (0x96) differ",
    "temperature_min": "the lowest temperature (0x92) and the sensors (0x96) differ",
    "sensor_number": "0x92 names a sensor that 0x94 says is not there",
    "soc": "SOC differs between 0x90 and Modbus",
}
"""docs/records.md 11, docs/wires.md 1."""


@dataclass(slots=True)
class _Contradiction:
    tally: Tally = field(default_factory=Tally)
    pairs: list[str] = field(default_factory=list[str])


@dataclass(slots=True)
class _Fault:
    raised: Tally = field(default_factory=Tally)
    standing: Tally = field(default_factory=Tally)
    cleared: int = 0


class Values(Watch):
    """Follows what each board says."""

    def __init__(self) -> None:
        self._contradictions = Groups(_Contradiction)
        self._zero = Groups(Tally)
        self._faults = Groups(_Fault)
        self._told: set[tuple[str, object, object]] = set()  # boards whose faults were told before
        self._unknown = Groups(Tally)

    def record(self, record: Decoded, bus: str) -> None:
        """See one record."""
        fields = record.fields
        if record.kind is not Kind.FRAME:
            return
        if "daly.unknown_id" in fields:
            asked = "reply" if fields.get("daly.direction") == REPLY else "request"
            self._unknown[place_of(record, bus, asked)].add(record.number, record.time_ns)
        if fields.get("daly.direction") != REPLY:
            return
        against = words(fields, "daly.contradicts")
        for name, other in zip(words(fields, "daly.contradiction"), against, strict=False):
            group = self._contradictions[_board(record, bus, name)]
            group.tally.add(record.number, record.time_ns)
            if len(group.pairs) < _EXAMPLES:
                group.pairs.append(f"packet {record.number} against {other}")
        if fields.get("daly.pack.voltage") == 0 and fields.get("daly.soc") == 0:
            self._zero[_board(record, bus)].add(record.number, record.time_ns)
        if "daly.fault_count" in fields:
            self._fault(record, bus, fields)

    def _fault(self, record: Decoded, bus: str, fields: Fields) -> None:
        who = bus, fields.get("daly.board"), address_of(fields)
        if who not in self._told and len(self._told) < 4096:
            self._told.add(who)
            for name, value in fields.items():
                if value is True and name.startswith(_FAULT) and name.removeprefix(_FAULT) not in _STATES:
                    group = self._faults[_board(record, bus, name.removeprefix(_FAULT))]
                    group.standing.add(record.number, record.time_ns)
        for name in words(fields, "daly.fault_raised"):
            if name not in _STATES:
                self._faults[_board(record, bus, name)].raised.add(record.number, record.time_ns)
        for name in words(fields, "daly.fault_cleared"):
            if name not in _STATES:
                self._faults[_board(record, bus, name)].cleared += 1

    def findings(self) -> Iterator[Finding]:
        """Say what is contradictory, zero, faulty or unknown."""
        for place, group in self._contradictions.items():
            text = f"{_SAYS.get(place.detail, place.detail)}: {counted(group.tally.count, 'time')}"
            yield found("contradiction", place, group.tally, text, examples=tuple(group.pairs))
        for place, tally in self._zero.items():
            text = f"{counted(tally.count, 'reply', 'replies')} with 0 V and SOC 0 %, which is no battery's state"
            yield found("zero-reply", place, tally, text)
        for place, fault in self._faults.items():
            cleared = f", cleared {counted(fault.cleared, 'time')}" if fault.cleared else ", never cleared"
            if fault.standing.count:
                text = f"set from the first fault reply on{cleared}"
                yield found("fault-standing", place, fault.standing, text)
            if fault.raised.count:
                text = f"raised {counted(fault.raised.count, 'time')}{cleared}"
                yield found("fault-raised", place, fault.raised, text)
        for place, tally in self._unknown.items():
            yield found("unknown-id", place, tally, f"{counted(tally.count, 'frame')} with an ID that is not known")


def _board(record: Decoded, bus: str, detail: str = "") -> Place:
    board = number(record.fields, "daly.board")
    return Place(bus, board, None if board is not None else address_of(record.fields), detail=detail)
