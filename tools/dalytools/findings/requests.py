# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about who asks: unanswered, silent, two-hosts, echo, asleep, other-dialect."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref import addresses, can_foreign
from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.limits import SILENT_AFTER
from dalytools.findings.place import ECHO, REPLY, REQUEST, Place, address_of, number, place_of
from dalytools.findings.rules import found
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalytools.findings.finding import Finding

_DIALECTS = {"a5": "A5 (UART/485)", "d2": "Modbus D2", "81": "Modbus 81", "hkms": "HKMS CAN"}
_REMEMBERED = 1024  # requests
_INVERTERS = frozenset((can_foreign.VICTRON, can_foreign.PYLONTECH_HV))
_OTHER_BATTERIES = ("Sinowealth", "JBD")
_MODBUS = "Modbus"
_ANSWERS_81, _ASKS_81 = range(0x51, 0x61), 0x30
"""50 + N answers what 80 + N was asked (docs/records.md 2)."""
_WAITS_NS = 1_000_000_000
_LONG_S = 3.0
"""A board that is quiet so long did not just miss a request."""
_SOMETIMES = (
    "answered at other times: look for damaged bytes and other hosts at these packets, and for requests that come too "
    "fast (few boards answer any closer than 60 ms)"
)


@dataclass(slots=True)
class _Asked:
    """Requests to one place."""

    asked: int = 0
    answered: int = 0
    retries: int = 0
    unanswered: Tally = field(default_factory=Tally)


@dataclass(slots=True)
class _Line:
    """What one address is told, over all IDs."""

    asked: int = 0
    answered: int = 0
    late: int = 0
    """Replies that came when their request had been given up."""
    unanswered: Tally = field(default_factory=Tally)
    echoes: Tally = field(default_factory=Tally)
    echoed_unanswered: Tally = field(default_factory=Tally)
    """Requests that came back, and that nobody answered."""
    quiet: Tally = field(default_factory=Tally)
    """Unanswered requests since the last answer, for what was answered before."""
    longest: Tally = field(default_factory=Tally)
    """The longest such time that an answer ended."""
    ids: set[int] = field(default_factory=set[int])

    def spoke(self) -> None:
        """Take note of an answer: what was quiet before is over."""
        if self.quiet.last_ns - self.quiet.first_ns > self.longest.last_ns - self.longest.first_ns:
            self.longest = self.quiet
        if self.quiet.count:
            self.quiet = Tally()


@dataclass(slots=True)
class _Hosts:
    seconds: Tally = field(default_factory=Tally)
    names: set[int] = field(default_factory=set[int])


@dataclass(slots=True)
class _Dialect:
    asked: int = 0
    answered: int = 0
    replies: int = 0
    unanswered: Tally = field(default_factory=Tally)


class Requests(Watch):
    """Counts requests by place, by address and by dialect."""

    def __init__(self) -> None:
        self._asked = Groups(_Asked)
        self._lines = Groups(_Line)
        self._hosts = Groups(_Hosts)
        self._dialects: dict[tuple[str, str], _Dialect] = {}
        self._given_up: OrderedDict[int, _Line] = OrderedDict()  # packet of an unanswered request: its line
        self._last: dict[tuple[str, bytes], Decoded] = {}  # the newest request with these bytes, for its echo
        self._written: dict[str, tuple[int, int]] = {}  # register and time of the newest write of D2, by bus
        self._foreign: set[str] = set()  # whose other traffic is there

    def record(self, record: Decoded, bus: str) -> None:
        """Count a request or an echo; of replies only their dialect."""
        direction = record.fields.get("daly.direction")
        if record.kind is Kind.FOREIGN and len(self._foreign) < 16:
            self._foreign.add(str(record.fields.get("daly.foreign", "")))
        if record.kind is not Kind.FRAME or direction is None:
            return
        key = bus, str(record.fields.get("daly.dialect", ""))
        dialect = self._dialects.setdefault(key, _Dialect())
        if direction == REPLY:
            dialect.replies += 1
            late = self._given_up.get(number(record.fields, "daly.late_to") or 0)
            if late is not None:
                late.late += 1
                late.spoke()
            if "daly.modbus.ambiguous" in record.fields:  # one of several requests was answered
                line = self._lines[_line(record, bus)]
                line.answered += 1
                dialect.answered += 1
                line.spoke()
        elif direction == ECHO:
            self._echo(record, bus)
        elif direction == REQUEST:
            self._request(record, bus, dialect)

    def _request(self, record: Decoded, bus: str, dialect: _Dialect) -> None:
        fields = record.fields
        asked, line = self._asked[place_of(record, bus)], self._lines[_line(record, bus)]
        data_id = number(fields, "daly.data_id")
        if data_id is not None:
            line.ids.add(data_id)
        hosts = self._hosts[Place(bus)]
        host = number(fields, "daly.can.source" if "daly.can.source" in fields else "daly.address")
        if host is not None and (len(hosts.names) < 16 or "daly.second_host" in fields):
            hosts.names.add(addresses.host(host))
        if "daly.second_host" in fields:
            hosts.seconds.add(record.number, record.time_ns)
        asked.retries += "daly.retry" in fields
        for group in (asked, line, dialect):
            group.asked += 1
            if "daly.reply_in" in fields:
                group.answered += 1
            elif "daly.unanswered" in fields:
                group.unanswered.add(record.number, record.time_ns)
        if "daly.reply_in" in fields:
            line.spoke()
        elif "daly.unanswered" in fields:
            if asked.answered:
                line.quiet.add(record.number, record.time_ns)
            if self._may_be_answer(record, bus):
                line.answered += 1
                dialect.answered += 1
            self._given_up[record.number] = line
            if len(self._given_up) > _REMEMBERED:
                self._given_up.popitem(last=False)
        if len(self._last) > 256:
            self._last.clear()
        self._last[bus, record.data] = record

    def _may_be_answer(self, record: Decoded, bus: str) -> bool:
        """Tell whether it may be the answer to a write of D2, with another value: both have the same address."""
        register = number(record.fields, "daly.modbus.register")
        if "daly.write" not in record.fields or record.fields.get("daly.dialect") != "d2" or register is None:
            return False
        before = self._written.get(bus)
        self._written[bus] = register, record.time_ns
        return before is not None and before[0] == register and 0 <= record.time_ns - before[1] < _WAITS_NS

    def _echo(self, record: Decoded, bus: str) -> None:
        line = self._lines[_line(record, bus)]
        line.echoes.add(record.number, record.time_ns)
        original = self._last.get((bus, record.data))
        if original is not None and "daly.unanswered" in original.fields:
            line.echoed_unanswered.add(record.number, record.time_ns)

    def findings(self) -> Iterator[Finding]:
        """Say what stayed unanswered, and why that may be."""
        for place, line in self._lines.items():
            yield from self._of_line(place, line)
        for place, asked in self._asked.items():
            if asked.unanswered.count:
                retried = f" ({counted(asked.retries, 'retry', 'retries')} among them)" if asked.retries else ""
                text = f"{asked.unanswered.count} of {counted(asked.asked, 'request')}{retried} got no reply in time"
                advice = _SOMETIMES if asked.answered else ""
                yield found("unanswered", place, asked.unanswered, text, advice=advice)
        for place, hosts in self._hosts.items():
            if hosts.seconds.count:
                names = " and ".join(_host_name(name) for name in sorted(hosts.names))
                text = f"{names} ask on one bus; {counted(hosts.seconds.count, 'time')} within a second of the other"
                yield found("two-hosts", place, hosts.seconds, text)
        yield from self._of_dialects()

    def _of_line(self, place: Place, line: _Line) -> Iterator[Finding]:
        if not line.answered and not line.late and line.unanswered.count >= SILENT_AFTER and not line.echoes.count:
            seconds = (line.unanswered.last_ns - line.unanswered.first_ns) / 1e9
            text = f"nothing ever answered: {counted(line.asked, 'request')} in {seconds:.1f} s"
            yield found("silent", place, line.unanswered, text, advice=self._silence(place))
        if line.echoes.count:
            text = f"{counted(line.echoes.count, 'request')} came back unchanged"
            if line.echoes.count >= line.asked and line.answered:
                text += ", every one, answered or not: the adapter or the host hears itself"
            elif line.echoed_unanswered.count:
                text += f", {line.echoed_unanswered.count} of them never answered: the board seems to sleep"
            yield found("echo", place, line.echoes, text)
        if line.echoed_unanswered.count >= 2 and (line.echoed_unanswered.count * 2 > line.echoes.count):
            text = f"{line.echoed_unanswered.count} requests came back and were not answered"
            yield found("asleep", place, line.echoed_unanswered, text)
        elif line.answered >= SILENT_AFTER and line.quiet.count >= SILENT_AFTER:
            text = f"answered {counted(line.answered, 'request')}, then none of the last {line.quiet.count}"
            yield found("asleep", place, line.quiet, text)
        elif line.longest.count >= SILENT_AFTER and _seconds(line.longest) >= _LONG_S:
            text = (
                f"answered none of {line.longest.count} requests in {_seconds(line.longest):.1f} s, then it did again"
            )
            yield found("asleep", place, line.longest, text)

    def _silence(self, place: Place) -> str:
        """Advise on an address that nobody answers (field notes, fact 3 and g.1)."""
        heard = [other for other, line in self._lines.items() if line.answered and other != place]
        if heard and all(other.detail != place.detail for other in heard):
            names = " and ".join(dict.fromkeys(_speaks(other) for other in heard))
            return f"a board on this bus answers in {names}, and in nothing else: set the client to that dialect"
        heard = [other for other in heard if other.detail == place.detail]
        if heard:
            names = ", ".join(map(str, heard[:4]))
            return f"{names} answers: ask that, or give the board the number that is asked"
        if self._foreign & _INVERTERS:
            return (
                "an inverter's protocol is on the bus, which the pack sends by itself: in such a mode a board answers "
                "no polls. Read those frames, or set the board's CAN to Daly's own protocol (250 kbit/s)"
            )
        for maker in _OTHER_BATTERIES:
            if maker in self._foreign:
                return (
                    f"somebody on this bus talks with a {maker} board, which does not know Daly's protocol: if it is "
                    f"this pack, use a program for {maker} boards"
                )
        if place.data_id is None and (place.board or 0) > 1:
            return (
                f"is there a board with the number {place.board}? Board 1 answers 0x40; check its power and wiring too"
            )
        if place.board == 1:
            return (
                "check power, wiring (A and B) and baud rate; a board with another number N answers 0x3F + N only; "
                "some boards answer Modbus (D2, 81) alone; or it sleeps"
            )
        return "ask 0x40 instead: many boards do not answer 0x80 or 0x20; check power, wiring (A and B) and baud rate"

    def _of_dialects(self) -> Iterator[Finding]:
        for (bus, name), dialect in self._dialects.items():
            if dialect.answered or dialect.unanswered.count < SILENT_AFTER:
                continue
            others = [
                _DIALECTS.get(other, other)
                for (its_bus, other), its in self._dialects.items()
                if its_bus == bus and other != name and its.replies
            ]
            if others:
                here = _DIALECTS.get(name, name)
                text = f"no request in {here} was answered, but a board answers in {' and '.join(others)}"
                yield found("other-dialect", Place(bus, detail=here), dialect.unanswered, text)


def _seconds(tally: Tally) -> float:
    return (tally.last_ns - tally.first_ns) / 1e9


def _line(record: Decoded, bus: str) -> Place:
    """Whom a request is for, whatever it asks; or a reply of Modbus comes from."""
    board = number(record.fields, "daly.board")
    address = address_of(record.fields)
    modbus = "daly.modbus.address" in record.fields
    if modbus and address is not None:
        return Place(bus, address=address + _ASKS_81 if address in _ANSWERS_81 else address, detail=_MODBUS)
    return Place(bus, board) if board is not None else Place(bus, address=address)


def _speaks(place: Place) -> str:
    """Name the dialect that is spoken there."""
    if place.detail != _MODBUS:
        return _DIALECTS["a5"]
    return _DIALECTS["d2" if place.address == 0xD2 else "81"]


def _host_name(host: int) -> str:
    """Name a host as ``addresses.host`` tells hosts apart."""
    return "host 0x40 (PC, RS-485)" if 0x40 <= host <= 0x4F else f"host 0x{host:02X}"
