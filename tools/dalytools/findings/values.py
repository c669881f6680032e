# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about what replies say: contradiction, zero-reply, fault-raised, fault-standing, unknown-id."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.load import Held, Load
from dalytools.findings.place import REPLY, REQUEST, Place, address_of, number, place_of, words
from dalytools.findings.rules import found
from dalytools.findings.watch import Groups, Watch
from dalytools.findings.zero_run import ZeroRun
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
_MOST_D2, _MOST_ALONE = 64, 256
_SETS_SOC = 0x21  # docs/protocol.md, a.3
_RECENT_NS = 10_000_000_000  # docs/records.md 11
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
        self._runs = Groups(ZeroRun)
        self._faults = Groups(_Fault)
        self._d2: deque[str] = deque(maxlen=_MOST_D2)  # packets of its newest replies
        self._nothings: deque[str] = deque(maxlen=_MOST_D2)  # packets of the newest replies of zeros
        self._soc_set: dict[str, int] = {}  # when a host last wrote it, by bus
        self._boards: dict[str, set[int]] = {}  # who has replied in A5, by bus
        self._alone: dict[str, list[tuple[Board, Held]]] = {}  # SOC against D2, while one board is heard, by bus
        self._unknown = Groups(Tally)

    def record(self, record: Decoded, bus: str) -> None:
        """See one record."""
        fields = record.fields
        if record.kind is not Kind.FRAME:
            return
        if "daly.unknown_id" in fields:
            asked = "reply" if fields.get("daly.direction") == REPLY else "request"
            self._unknown[place_of(record, bus, asked)].add(record.number, record.time_ns)
        if fields.get("daly.direction") == REQUEST:
            if "daly.write" in fields and (fields.get("daly.data_id") == _SETS_SOC or "daly.setting.soc" in fields):
                self._soc_set[bus] = record.time_ns
            if "daly.unanswered" in fields:
                place = _board(record, bus)
                self._cleared(place, self._runs[place].unanswered(fields.get("daly.data_id"), record.time_ns))
        if fields.get("daly.direction") != REPLY:
            return
        self._contradiction(record, bus, fields)
        self._of_zeros(record, bus, fields)
        if "daly.fault_count" in fields:
            self._fault(record, bus, fields)

    def _contradiction(self, record: Decoded, bus: str, fields: Fields) -> None:
        board = bus, number(fields, "daly.board"), address_of(fields)
        dialect = fields.get("daly.dialect")
        if _nothing(fields):
            self._nothings.append(str(record.number))
        if dialect == "d2":
            self._d2.append(str(record.number))
        elif dialect == "a5" and board[1] is not None:
            heard = self._boards.setdefault(bus, set())
            heard.add(board[1])
            if len(heard) > 1:  # D2 names no board: what stood against the first one's SOC was perhaps another's
                self._alone.pop(bus, None)
        for held in self._load.judged(board, record.number, fields):
            self._contradicts(board, held)
        against = words(fields, "daly.contradicts")
        for name, other in zip(words(fields, "daly.contradiction"), against, strict=False):
            if name == "soc" and record.time_ns - self._soc_set.get(bus, -_RECENT_NS) < _RECENT_NS:
                continue  # a host has set it between the two
            if name == "soc" and (_nothing(fields) or other in self._nothings):
                continue  # told as a reply of zeros
            held = Held(name, record.number, record.time_ns, other)
            alone = self._alone.setdefault(bus, [])
            if name == "soc" and (dialect == "d2" or other in self._d2) and len(alone) < _MOST_ALONE:
                alone.append((board, held))
                continue
            if name in _OF_LOAD and self._load.stepped(board, other):
                continue
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
        place, a5 = _board(record, bus), fields.get("daly.dialect") == "a5"
        nothing = not a5 and _nothing(fields)
        if not a5 and (place.board is None or not (nothing or "daly.pack.voltage" in fields)):
            if nothing:
                self._zero[place].add(record.number, record.time_ns)
            return
        run = self._runs[place]
        self._cleared(place, run.replies_at(record.time_ns))
        zero = (
            run.reply(str(fields.get("daly.data", "")), fields.get("daly.data_id")) if a5 else run.state(zero=nothing)
        )
        if zero is None:
            run.waiting.append((record.number, record.time_ns))
        elif not zero:
            self._cleared(place, run.end())
        else:
            for earlier in run.waiting:
                self._zero[place].add(*earlier)
            run.waiting.clear()
            self._zero[place].add(record.number, record.time_ns)

    def _fault(self, record: Decoded, bus: str, fields: Fields) -> None:
        place = _board(record, bus)
        run = self._runs[place]
        cleared = set(words(fields, "daly.fault_cleared"))
        if run.running:
            run.hide(cleared)
            return
        if fields.get("daly.dialect") != "a5" and _nothing(fields):
            run.kept |= cleared
            return
        kept, run.kept = run.kept, set[str]()
        standing = {name.removeprefix(_FAULT) for name in fields if name.startswith(_FAULT) and fields[name] is True}
        self._cleared(place, cleared | (kept - standing))
        if not run.told:
            run.told = True
            for name in standing - _STATES:
                self._faults[_board(record, bus, name)].standing.add(record.number, record.time_ns)
            return
        for name in words(fields, "daly.fault_raised"):
            if name not in _STATES and name not in kept:
                self._faults[_board(record, bus, name)].raised.add(record.number, record.time_ns)

    def _cleared(self, place: Place, names: set[str]) -> None:
        for name in names - _STATES:
            self._faults[replace(place, detail=name)].cleared += 1

    def findings(self) -> Iterator[Finding]:
        """Say what is contradictory, zero, faulty or unknown."""
        for place, run in list(self._runs.items()):
            self._cleared(place, run.end())
        for board, held in (one for alone in self._alone.values() for one in alone):
            self._contradicts(board, held)
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


def _nothing(fields: Fields) -> bool:
    """Tell whether a reply of Modbus says what no battery can: 0 V and 0 %, or a cell of 0 V and a capacity of 0."""
    return (fields.get("daly.pack.voltage") == 0 and fields.get("daly.soc") == 0) or (
        fields.get("daly.setting.rated_capacity") == 0 and fields.get("daly.setting.cell_nominal_voltage") == 0
    )
