# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about writes that change nothing: write-no-switch, write-no-effect (field notes, fact 9 and d)."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.place import REPLY, REQUEST, Place, address_of, number, place_of
from dalytools.findings.rules import found
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalytools.findings.finding import Finding

_REMEMBERED = 256  # requests, switches
_READINGS = {"d2": 0x80, "81": 0x61}
"""Registers below it hold readings (docs/protocol.md, d.1 and d.2)."""
_CELLS = {"d2": 0x20, "81": 0x30}
_SWITCHES = {"daly.setting.mos_charge": "daly.mos.charge", "daly.setting.mos_discharge": "daly.mos.discharge"}
_NAMES = {"daly.mos.charge": "charge MOS", "daly.mos.discharge": "discharge MOS"}
_SETTLED_NS = 2_000_000_000
"""A switch may take so long to show."""

_Switch = tuple[str, int | None, int | None, str]


@dataclass(slots=True)
class _Confirmed:
    """A switch that a board said it took."""

    place: Place
    on: bool
    time_ns: int
    other: Tally = field(default_factory=Tally)
    """Readings since that say the contrary."""


@dataclass(slots=True)
class _Without:
    tally: Tally = field(default_factory=Tally)
    said: list[str] = field(default_factory=list[str])


class Effects(Watch):
    """Follows what a write should have changed."""

    def __init__(self) -> None:
        self._readings = Groups(Tally)
        self._asked: OrderedDict[int, dict[str, bool]] = OrderedDict()  # request's packet: switches it sets
        self._confirmed: OrderedDict[_Switch, _Confirmed] = OrderedDict()
        self._without = Groups(_Without)

    def record(self, record: Decoded, bus: str) -> None:
        """See one record."""
        fields = record.fields
        if record.kind is not Kind.FRAME:
            return
        if fields.get("daly.direction") == REQUEST and "daly.write" in fields:
            switches = {_SWITCHES[name]: bool(fields[name]) for name in _SWITCHES if name in fields}
            if switches:
                self._asked[record.number] = switches
                if len(self._asked) > _REMEMBERED:
                    self._asked.popitem(last=False)
            register = number(fields, "daly.modbus.register")
            if register is not None and register < _READINGS.get(str(fields.get("daly.dialect")), 0):
                self._readings[place_of(record, bus)].add(record.number, record.time_ns)
        elif fields.get("daly.direction") == REPLY:
            self._reply(record, bus)

    def _reply(self, record: Decoded, bus: str) -> None:
        fields = record.fields
        who = bus, number(fields, "daly.board"), address_of(fields)
        switches = self._asked.get(number(fields, "daly.request_in") or 0, {})
        if fields.get("daly.write_result") == "confirmed":
            for name, on in switches.items():
                self._close((*who, name))
                self._confirmed[*who, name] = _Confirmed(place_of(record, bus), on, record.time_ns)
                if len(self._confirmed) > _REMEMBERED:
                    self._close(next(iter(self._confirmed)))
        for name in _NAMES:
            if name not in fields:
                continue
            confirmed = self._confirmed.get((*who, name))
            if confirmed is None or record.time_ns - confirmed.time_ns < _SETTLED_NS:
                continue
            if bool(fields[name]) is confirmed.on:
                del self._confirmed[*who, name]
            else:
                confirmed.other.add(record.number, record.time_ns)

    def _close(self, switch: _Switch) -> None:
        """Judge a switch: no reading since said that it was taken."""
        confirmed = self._confirmed.pop(switch, None)
        if confirmed is None or not confirmed.other.count:
            return
        without = self._without[confirmed.place]
        without.tally.add(confirmed.other.first_packet, confirmed.other.first_ns)
        if len(without.said) < 3:
            was, says = ("on", "off") if confirmed.on else ("off", "on")
            without.said.append(
                f"the {_NAMES[switch[3]]} was switched {was}, confirmed, and "
                f"{counted(confirmed.other.count, 'later reading')} say {says}"
            )

    def findings(self) -> Iterator[Finding]:
        """Say which writes could not, or did not, change anything."""
        for switch in list(self._confirmed):
            self._close(switch)
        for place, tally in self._readings.items():
            register = place.register or 0
            holds = "a reading"
            for dialect, cells in _CELLS.items():
                if register < cells and (dialect == "81") == (place.board is not None):
                    holds = f"the voltage of cell {register + 1}"
            text = f"{counted(tally.count, 'write')} to a register that holds {holds}: echoed, but nothing switches"
            yield found("write-no-switch", place, tally, text)
        for place, without in self._without.items():
            yield found("write-no-effect", place, without.tally, "; ".join(without.said))
