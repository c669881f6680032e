# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about bytes and the capture itself: damaged, foreign, line-errors, port-lost, dropped, clock-step."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalycapture.captured import CapturedPacket
from dalyref import bluetooth_module, can_foreign
from dalyref.kinds import Kind
from dalytools.findings.finding import Severity, Tally
from dalytools.findings.place import Place
from dalytools.findings.rules import found
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalyref.packet import Packet
    from dalytools.findings.finding import Finding
    from dalytools.findings.limits import Limits

_DAMAGED = {Kind.BAD_CHECKSUM: "bad checksum", Kind.SHORT: "cut off", Kind.JUNK: "junk"}
_BACK_NS = 100_000_000
"""Times of one interface may lie so far back: adapters hand over late, and are corrected."""
_EVENTS = (
    ("clock step", "clock-step"),
    ("port lost", "port-lost"),
    ("the computer slept", "port-lost"),
    ("line errors", "line-errors"),
    ("dropped", "dropped"),
)
"""How the sniffer's events begin (dalycapture.sniffer), and the rule each breaks."""
_MOST_SAID = 200
_A5 = 0xA5
"""How a frame begins: where a capture does so too, it did not join in the middle of one."""
_LONGEST = 255
"""Bytes of the longest frame, a Modbus reply: a rest of one is shorter."""
_CAN = frozenset((can_foreign.VICTRON, can_foreign.PYLONTECH_HV, can_foreign.DEYE, can_foreign.AMBIGUOUS))
_ON_CAN = "a pack may send an inverter's frames by itself: a client must tell them from Daly's by their identifiers"
_EXAMPLES = 3


@dataclass(slots=True)
class _Line:
    """The bytes of one bus."""

    total: int = 0
    damaged: int = 0
    kinds: dict[str, int] = field(default_factory=dict[str, int])
    tally: Tally = field(default_factory=Tally)
    last: Decoded | None = None
    """A damaged record that was the newest: the end of a capture may have cut it."""
    begun: bool = False
    rest: Decoded | None = None
    """What looks like the end of a frame that began before the capture."""


@dataclass(slots=True)
class _Event:
    tally: Tally = field(default_factory=Tally)
    said: list[str] = field(default_factory=list[str])

    def add(self, number: int, time_ns: int, text: str) -> None:
        self.tally.add(number, time_ns)
        if text and len(self.said) < _EXAMPLES:
            self.said.append(f"packet {number}: {text[:_MOST_SAID]}")


@dataclass(slots=True)
class _Drops:
    tally: Tally = field(default_factory=Tally)
    packets: int = 0


class Wire(Watch):
    """Counts bytes outside good frames, other people's traffic, and what the sniffer says of itself."""

    def __init__(self, limits: Limits) -> None:
        self._limit = limits.damaged_percent
        self._lines = Groups(_Line)
        self._foreign = Groups(Tally)
        self._events: dict[str, _Event] = {}
        self._drops = _Drops()
        self._newest_ns: dict[int, int] = {}  # by interface

    def packet(self, packet: Packet) -> None:
        """See a packet: its time against the one before it of the same interface, and what was lost before it."""
        before = self._newest_ns.get(packet.interface)
        if packet.time_ns and before is not None and packet.time_ns < before - _BACK_NS:
            back = (before - packet.time_ns) / 1e9
            self._event("clock-step", packet.number, packet.time_ns, f"{back:.3f} s before the packet before it")
        if packet.time_ns and len(self._newest_ns) < 4096:
            self._newest_ns[packet.interface] = packet.time_ns
        if isinstance(packet, CapturedPacket) and packet.dropped:
            self._drops.packets += packet.dropped
            self._drops.tally.add(packet.number, packet.time_ns)

    def record(self, record: Decoded, bus: str) -> None:
        """See one record."""
        if record.kind is Kind.EVENT:
            self._of_event(record)
            return
        line = self._lines[Place(bus)]
        line.total += len(record.data)
        self._count(line, line.last)
        line.last = None
        if record.kind is Kind.FOREIGN:
            detail = str(record.fields.get("daly.foreign", ""))
            if detail != bluetooth_module.NAME:  # of the board itself: nothing strange, and no other device
                self._foreign[Place(bus, detail=detail)].add(record.number, record.time_ns)
        elif record.kind in _DAMAGED:
            rest = record.kind is not Kind.BAD_CHECKSUM and record.data[0] != _A5 and len(record.data) < _LONGEST
            if line.begun or not rest:
                line.last = record
            else:
                line.total -= len(record.data)  # joined in the middle of a frame
                line.rest = record
        line.begun = True

    @staticmethod
    def _count(line: _Line, record: Decoded | None) -> None:
        if record is None:
            return
        line.damaged += len(record.data)
        name = _DAMAGED[record.kind]
        line.kinds[name] = line.kinds.get(name, 0) + 1
        line.tally.add(record.number, record.time_ns)

    def _of_event(self, record: Decoded) -> None:
        """Tell by its first words what an event of the sniffer says."""
        said = record.comment.lower()
        for words, rule in _EVENTS:
            if said.startswith(words):
                self._event(rule, record.number, record.time_ns, record.comment)
        if "overrun" in said:
            self._event("dropped", record.number, record.time_ns, record.comment)

    def _event(self, rule: str, number: int, time_ns: int, text: str) -> None:
        self._events.setdefault(rule, _Event()).add(number, time_ns, text)

    def findings(self) -> Iterator[Finding]:
        """Say how much was damaged, what is not Daly's, and what the capture lacks."""
        for place, line in self._lines.items():
            if line.rest is not None and not line.total:  # there is nothing else, and no frame is known to have begun
                line.total = len(line.rest.data)
                self._count(line, line.rest)
            if line.last is not None and line.last.kind is not Kind.SHORT:  # short: the capture's end cut it
                self._count(line, line.last)
                line.last = None
            if line.tally.count:
                share = 100 * line.damaged / line.total
                kinds = ", ".join(f"{count} {kind}" for kind, count in line.kinds.items())
                text = f"{share:.2f} % of {counted(line.total, 'byte')} belong to no good frame ({kinds})"
                severity = Severity.WARNING if share > self._limit else Severity.NOTE
                yield found("damaged", place, line.tally, text, severity=severity)
        for place, tally in self._foreign.items():
            advice = _ON_CAN if place.detail in _CAN else ""
            yield found("foreign", place, tally, f"{counted(tally.count, 'record')} of {place.detail}", advice=advice)
        for rule, event in self._events.items():
            text = f"{counted(event.tally.count, 'time')}"
            yield found(rule, Place(), event.tally, text, examples=tuple(event.said))
        if self._drops.packets:
            text = f"{counted(self._drops.packets, 'packet')} lost before others, as the capture says"
            yield found("dropped", Place(detail="packets"), self._drops.tally, text)
