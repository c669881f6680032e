# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about what replies say: contradiction, zero-reply, fault-raised, fault-standing, unknown-id."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.load import Held, Load
from dalytools.findings.place import REPLY, Place, address_of, number, place_of, words
from dalytools.findings.rules import found
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalyref.values import Fields
    from dalytools.findings.finding import Finding
    from dalytools.findings.load import Board

_EXAMPLES = 3
_OF_LOAD = frozenset(("pack_voltage", "cell_max", "cell_min"))
"""Contradictions that a step of the load between the two replies explains."""
_NEVER_ZERO = frozenset((0x90, 0x91, 0x94, 0x95))
"""Of these eight bytes of zero say what can't be: 0 V, cell number 0, no cells, frame number 0."""
_NUMBERED = frozenset((0x95, 0x96))
"""Of these zeros behind the frame number may be slots that are not used."""
_ZERO = "00" * 8
_MOST_ZERO = 64
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
        self._load = Load()
        self._zero = Groups(Tally)
        self._runs = Groups(list[tuple[int, int] | None])
        """Replies of zeros in a row, packet and time; None: they were counted, and so is what follows."""
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
        self._contradiction(record, bus, fields)
        self._of_zeros(record, bus, fields)
        if "daly.fault_count" in fields:
            self._fault(record, bus, fields)

    def _contradiction(self, record: Decoded, bus: str, fields: Fields) -> None:
        board = bus, number(fields, "daly.board"), address_of(fields)
        for held in self._load.judged(board, fields, record.time_ns):
            self._contradicts(board, held)
        against = words(fields, "daly.contradicts")
        for name, other in zip(words(fields, "daly.contradiction"), against, strict=False):
            held = Held(name, record.number, record.time_ns, other)
            # A reply that has the current itself was judged by it.
            if name not in _OF_LOAD or "daly.pack.current" in fields or not self._load.hold(board, held):
                self._contradicts(board, held)

    def _contradicts(self, board: Board, held: Held) -> None:
        bus, named, address = board
        group = self._contradictions[Place(bus, named, None if named is not None else address, detail=held.name)]
        group.tally.add(held.packet, held.time_ns)
        if len(group.pairs) < _EXAMPLES:
            group.pairs.append(f"packet {held.packet} against {held.other}")

    def _of_zeros(self, record: Decoded, bus: str, fields: Fields) -> None:
        """Follow replies of nothing but zeros: right for some IDs, but not in a row with one where they can't be."""
        if fields.get("daly.dialect") != "a5":
            if fields.get("daly.pack.voltage") == 0 and fields.get("daly.soc") == 0:
                self._zero[_board(record, bus)].add(record.number, record.time_ns)
            return
        place = _board(record, bus)
        run = self._runs[place]
        data, data_id = str(fields.get("daly.data", "")), fields.get("daly.data_id")
        numbered = data_id in _NUMBERED and data[2:] == _ZERO[2:]
        if data != _ZERO and not numbered:
            run.clear()
            return
        if len(run) < _MOST_ZERO and (data != _ZERO or data_id not in _NEVER_ZERO):
            if run and run[-1] is None:
                self._zero[place].add(record.number, record.time_ns)
            else:
                run.append((record.number, record.time_ns))
            return
        for earlier in run:
            if earlier is not None:
                self._zero[place].add(*earlier)
        run[:] = [None]
        self._zero[place].add(record.number, record.time_ns)

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
        for board, held in self._load.rest():
            self._contradicts(board, held)
        for place, group in self._contradictions.items():
            text = f"{_SAYS.get(place.detail, place.detail)}: {counted(group.tally.count, 'time')}"
            yield found("contradiction", place, group.tally, text, examples=tuple(group.pairs))
        for place, tally in self._zero.items():
            replies = counted(tally.count, "reply", "replies")
            text = f"{replies} of nothing but zeros, such as 0 V with SOC 0 %: no battery's state"
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
