# SPDX-License-Identifier: GPL-2.0-or-later
"""What is remembered of one board, and what its records say about each other (docs/records.md, sections 9 and 11).

    90  pack voltage ------- 1 % ----- sum of the table of 95
    91  highest, lowest ---- 20 mV --- table of 95      their numbers --- cell count of 94
    92  highest, lowest ---- 2 C ----- table of 96      their numbers --- sensor count of 94

Counts are of `int` 0 where they are not known. Packet numbers begin at 1.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from dalyref import cells, faults
from dalyref.values import put

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.options import Options
    from dalyref.values import Fields


@dataclass(frozen=True, slots=True)
class Seen:
    """When and where a record was seen."""

    number: int
    """Of its packet."""
    start_ns: int
    end_ns: int


@dataclass(frozen=True, slots=True)
class Load:
    """What the board was doing, by its newest 93 and 90 that were not all zeros; None where there was none."""

    state: int | None
    current: int | None
    """Raw, 0.1 A."""

    def like(self, other: Load) -> bool:
        """Tell whether voltages of the two moments can be compared: same state, currents within 1 A."""
        if None not in (self.state, other.state) and self.state != other.state:
            return False
        return self.current is None or other.current is None or abs(self.current - other.current) <= 10


@dataclass(frozen=True, slots=True)
class Extremes:
    """The highest and the lowest: cells in mV, or temperatures as sent (raw), each with where it was seen."""

    seen: Seen
    load: Load
    high: int
    low: int


@dataclass(frozen=True, slots=True)
class Total:
    """Voltage of the whole pack: raw (0.1 V) of a 90, or the sum of the cells (mV) of a table."""

    seen: Seen
    load: Load
    value: int


_Findings = list[tuple[str, int]]
"""(name, packet of the other record)"""


@dataclass(slots=True, eq=False)
class Board:
    """What is known of the battery that answers with one address byte."""

    options: Options
    cells: int = 0
    sensors: int = 0
    cells_from: int = 0
    sensors_from: int = 0
    state: int | None = None
    counted_from_0: set[int] = field(default_factory=set[int])
    """Data IDs of bursts that had a frame number 0."""
    _load_state: int | None = None
    _current: int | None = None
    _faults: tuple[int, int] | None = None  # bits, packet
    _mos: tuple[bytes, int] | None = None
    _status: tuple[bytes, int] | None = None
    _pack: Total | None = None
    _sum: Total | None = None
    _cell_extremes: Extremes | None = None
    _cell_table: Extremes | None = None
    _heat_extremes: Extremes | None = None
    _heat_table: Extremes | None = None
    _age_ns: int = field(init=False)

    def __post_init__(self) -> None:
        self._age_ns = self.options.limit_ns(self.options.age)

    def reply(self, seen: Seen, data_id: int, data: bytes, fields: Fields) -> None:
        """Take a reply that is one frame: add what it changes and contradicts."""
        match data_id:
            case 0x90:
                if self.state is not None:
                    fields["daly.pack.state"] = self.state
                if any(data):
                    self._current = int.from_bytes(data[4:6])
                self._pack = Total(seen, self._load(), int.from_bytes(data[:2]))
                if self._near(seen, self._sum):
                    self._report(fields, self._compare_sums(self._pack, cast("Total", self._sum), at=self._sum))
            case 0x91:
                mine = self._cell_extremes = Extremes(
                    seen, self._load(), int.from_bytes(data[:2]), int.from_bytes(data[3:5])
                )
                found = self._compare_cells(mine, self._cell_table)
                if self.cells and max(data[2], data[5]) > self.cells:
                    found.append(("cell_number", self.cells_from))
                self._report(fields, found)
            case 0x92:
                mine = self._heat_extremes = Extremes(seen, self._load(), data[0], data[2])
                found = self._compare_heat(mine, self._heat_table, reported=mine)
                if self.sensors and max(data[1], data[3]) > self.sensors:
                    found.append(("sensor_number", self.sensors_from))
                self._report(fields, found)
            case 0x93:
                self._take_mos(seen, data, fields)
            case 0x94:
                self._take_status(seen, data, fields)
            case 0x98:
                self._take_faults(seen, data, fields)
            case _:
                pass

    def cell_table(self, seen: Seen, voltages: Sequence[int], fields: Fields) -> None:
        """Take the voltages (mV) of all cells, of a board whose count is known."""
        mine = self._cell_table = Extremes(seen, self._load(), max(voltages), min(voltages))
        self._sum = Total(seen, self._load(), sum(voltages))
        found = self._compare_cells(mine, self._cell_extremes)
        if self._near(seen, self._pack):
            found += self._compare_sums(cast("Total", self._pack), self._sum, at=self._pack)
        self._report(fields, found)

    def sensor_table(self, seen: Seen, raw: Sequence[int], fields: Fields) -> None:
        """Take the temperatures (as sent) of all sensors, of a board whose count is known."""
        there = [value for value in raw if cells.is_there(value)]
        if not there:
            self._heat_table = None
            return
        mine = self._heat_table = Extremes(seen, self._load(), max(there), min(there))
        reported = self._heat_extremes
        if reported is not None:
            self._report(fields, self._compare_heat(mine, reported, reported=reported))

    def _load(self) -> Load:
        return Load(self._load_state, self._current)

    def _near(self, seen: Seen, other: Total | Extremes | None) -> bool:
        return other is not None and seen.start_ns - other.seen.end_ns <= self._age_ns

    def _compare_sums(self, pack: Total, total: Total, *, at: Total | None) -> _Findings:
        difference = abs(pack.value * 100 - total.value)
        if not pack.load.like(total.load):
            return []
        if at and pack.value and total.value and difference * 100 > self.options.sum_tolerance * total.value:
            return [("pack_voltage", at.seen.number)]
        return []

    def _compare_cells(self, mine: Extremes, theirs: Extremes | None) -> _Findings:
        found: _Findings = []
        if theirs is None or not self._near(mine.seen, theirs) or not mine.load.like(theirs.load):
            return found
        if not mine.high or not theirs.high:
            return found
        if abs(mine.high - theirs.high) > self.options.cell_tolerance:
            found.append(("cell_max", theirs.seen.number))
        if abs(mine.low - theirs.low) > self.options.cell_tolerance:
            found.append(("cell_min", theirs.seen.number))
        return found

    def _compare_heat(self, mine: Extremes, theirs: Extremes | None, *, reported: Extremes) -> _Findings:
        """Compare; `reported`: which of the two is the 92, whose minimum says nothing where it equals its maximum."""
        found: _Findings = []
        if theirs is None or not self._near(mine.seen, theirs):
            return found
        limit = self.options.temperature_tolerance
        if cells.is_there(reported.high) and abs(mine.high - theirs.high) > limit:
            found.append(("temperature_max", theirs.seen.number))
        if cells.is_there(reported.low) and reported.low != reported.high and abs(mine.low - theirs.low) > limit:
            found.append(("temperature_min", theirs.seen.number))
        return found

    @staticmethod
    def _report(fields: Fields, found: _Findings) -> None:
        put(fields, "daly.contradiction", [name for name, _ in found])
        put(fields, "daly.contradicts", [number for _, number in found])

    @staticmethod
    def _changed(fields: Fields, names: Sequence[str], since: int) -> None:
        if names:
            put(fields, "daly.changed", names)
            fields["daly.changed_from"] = since

    def _take_mos(self, seen: Seen, data: bytes, fields: Fields) -> None:
        if self._mos is not None:
            before, since = self._mos
            names = ["state"] * (data[0] != before[0])
            names += ["charge_mos"] * (bool(data[1]) != bool(before[1]))
            names += ["discharge_mos"] * (bool(data[2]) != bool(before[2]))
            self._changed(fields, names, since)
        self.state = data[0]
        if any(data):
            self._load_state = data[0]
        self._mos = (data, seen.number)

    def _take_status(self, seen: Seen, data: bytes, fields: Fields) -> None:
        names: list[str] = []
        if 1 <= data[0] <= cells.MOST_CELLS:
            if self.cells not in (0, data[0]):
                names.append("cell_count")
            self.cells, self.cells_from = data[0], seen.number
        if 1 <= data[1] <= cells.MOST_SENSORS:
            if self.sensors not in (0, data[1]):
                names.append("sensor_count")
            self.sensors, self.sensors_from = data[1], seen.number
        if self._status is not None:
            before, since = self._status
            names += ["charger"] * (bool(data[2]) != bool(before[2]))
            names += ["load"] * (bool(data[3]) != bool(before[3]))
            self._changed(fields, names, since)
        self._status = (data, seen.number)

    def _take_faults(self, seen: Seen, data: bytes, fields: Fields) -> None:
        found = faults.bits(data)
        if self._faults is not None:
            before, since = self._faults
            put(fields, "daly.fault_raised", faults.names(found & ~before))
            put(fields, "daly.fault_cleared", faults.names(before & ~found))
            if found != before:
                fields["daly.changed_from"] = since
        self._faults = (found, seen.number)
