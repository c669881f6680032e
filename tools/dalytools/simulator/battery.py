# SPDX-License-Identifier: GPL-2.0-or-later
"""A battery that moves: cells in series, a load that comes and goes, and what a BMS measures of it.

    current --> charge of each cell --> open-circuit voltage --+--> cell voltage --> extremes, sum, faults, balancing
        |                                                      |
        +---------------------- x resistance of the cell ------+

Only + - * / on floats and one seeded source of chance: the same seed gives the same values on every machine.
"""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dalytools.simulator.chemistry import CHEMISTRIES
from dalytools.simulator.faults import fault_payload

if TYPE_CHECKING:
    from dalytools.simulator.scenario import Pack

_OHM_HOURS = 0.060  # resistance of a cell x its capacity: 0.6 milliohm at 100 Ah
_BALANCE_DIFFERENCE_MV = 5
_BALANCE_A = 0.1
_THERMAL_S = 1800.0  # time constant of warming up and cooling down
_HEATING_C = 9.0  # above ambient, in the long run, at a current of capacity / 1 h


@dataclass(frozen=True, slots=True)
class Reading:
    """What the BMS measured: whole numbers in the units of the wire, but no offsets applied."""

    cells_mv: tuple[int, ...]
    sensors_c: tuple[int, ...]
    current_da: int  # 0.1 A, + charges
    soc_permille: int
    remaining_mah: int
    state: int  # 0 rest, 1 charge, 2 discharge
    charge_mos: bool
    discharge_mos: bool
    balance_mask: int  # bit 0 = cell 1
    faults: frozenset[str]
    fault_bytes: bytes  # the 8 data bytes of 0x98
    charger: bool
    load: bool
    cycles: int
    charged_ah: int  # in its life
    discharged_ah: int

    @property
    def pack_dv(self) -> int:
        """Pack voltage in 0.1 V: the sum of the cells."""
        return (sum(self.cells_mv) + 50) // 100


class Battery:
    """A pack under its load profile. ``advance`` moves it on, ``reading`` is what its BMS measures now."""

    def __init__(self, pack: Pack, seed: str) -> None:
        self.pack = pack
        self.chemistry = CHEMISTRIES[pack.chemistry]
        self._limits = self.chemistry.limits
        self.charge_mos = True  # as commanded; protection may hold it open all the same
        self.discharge_mos = True
        self.forced: set[str] = set()
        self.fault_code = 0
        self._chance = random.Random(seed)  # noqa: S311 - chance that can be repeated, no secret
        self._capacity_ah = pack.capacity_mah / 1000
        ohm = _OHM_HOURS / self._capacity_ah
        self._cell_ah = [self._capacity_ah * (1 + self._off(pack.spread)) for _ in range(pack.cells)]
        self._ohm = [ohm * (1 + self._off(10 * pack.spread)) for _ in range(pack.cells)]
        self._charge = [min(1.0, max(0.0, pack.start_soc / 100 + self._off(pack.spread))) for _ in range(pack.cells)]
        self._sensor_off = [self._off(1.5) for _ in range(pack.sensors)]
        self._remaining_ah = pack.start_soc / 100 * self._capacity_ah
        self._throughput_ah = 0.0  # out of it
        self._charged_ah = 0.0
        self._warm_c = 0.0
        self._phase = 0
        self._phase_left = pack.profile[0].seconds if pack.profile else 0.0
        self._alarms: set[str] = set()
        self._balance = 0
        self._current = 0.0
        self._reading = self._measure()
        self.advance(0.0)

    def _off(self, spread: float) -> float:
        return (self._chance.random() * 2 - 1) * spread

    @property
    def reading(self) -> Reading:
        """The newest measurement."""
        return self._reading

    def set_soc(self, permille: int) -> None:
        """Take the board's word for it: what a write of the state of charge does. The cells stay as they are."""
        self._remaining_ah = min(1000, permille) / 1000 * self._capacity_ah
        self.refresh()

    def refresh(self) -> None:
        """Measure again after a switch or a fault on demand, without time passing."""
        self.advance(0.0)

    def advance(self, seconds: float) -> None:
        """Let so many seconds of the pack's life pass under the load profile, in one step."""
        self._phase_left -= seconds
        before = self._reading
        phase = self._next_phase(before)
        current = phase * (1 + self._off(self.pack.ripple)) if seconds else phase
        if (current > 0 and not before.charge_mos) or (current < 0 and not before.discharge_mos):
            current = 0.0
        self._current = current
        hours = seconds / 3600
        self._remaining_ah = min(self._capacity_ah, max(0.0, self._remaining_ah + current * hours))
        if current < 0:
            self._throughput_ah -= current * hours
        else:
            self._charged_ah += current * hours
        balance = self._balance
        charge = self._charge
        for cell, amperes_hours in enumerate(self._cell_ah):
            through = current - _BALANCE_A if balance >> cell & 1 else current
            charge[cell] = min(1.0, max(0.0, charge[cell] + through * hours / amperes_hours))
        c_rate = current / self._capacity_ah
        self._warm_c += (_HEATING_C * c_rate * c_rate - self._warm_c) * min(1.0, seconds / _THERMAL_S)
        self._reading = self._measure()

    def _next_phase(self, before: Reading) -> float:
        """Amperes of the phase that is on now; an empty or a full cell ends its phase early."""
        profile = self.pack.profile
        if not profile:
            return 0.0
        empty = self._remaining_ah <= 0 or min(before.cells_mv) < self.chemistry.empty_mv
        full = max(before.cells_mv) > self.chemistry.full_mv
        for _ in profile:
            amperes = profile[self._phase].current_a
            if self._phase_left > 0 and not (amperes < 0 and empty) and not (amperes > 0 and full):
                return amperes
            self._phase = (self._phase + 1) % len(profile)
            self._phase_left = profile[self._phase].seconds
        return 0.0

    def _measure(self) -> Reading:
        current = self._current
        table = self.chemistry.by_permille
        cells: list[int] = []
        for charge, ohm in zip(self._charge, self._ohm, strict=True):
            permille = charge * 1000
            step = int(permille)
            volts = table[step]
            volts += (table[step + 1] - volts) * (permille - step) + current * ohm
            cells.append(int(volts * 1000 + 0.5))
        base = self.pack.ambient_c + self._warm_c
        sensors = tuple(_rounded(base + off) for off in self._sensor_off)
        current_da = _rounded(current * 10)
        self._watch(cells, sensors, current)
        faults = self._alarms | self.forced
        if not (self.charge_mos and self.discharge_mos):
            faults.add("mos_off_by_command")
        self._balance = _to_balance(cells, current, self.chemistry.balance_start_mv)
        stops = {stops for name, *_, stops in self._limits if f"{name}_level_2" in faults}
        short = "short_circuit_protect" in faults
        return Reading(
            cells_mv=tuple(cells),
            sensors_c=sensors,
            current_da=current_da,
            soc_permille=_rounded(self._remaining_ah / self._capacity_ah * 1000),
            remaining_mah=_rounded(self._remaining_ah * 1000),
            state=1 if current_da > 0 else 2 if current_da < 0 else 0,
            charge_mos=self.charge_mos and "charge" not in stops and not short,
            discharge_mos=self.discharge_mos and "discharge" not in stops and not short,
            balance_mask=self._balance,
            faults=frozenset(faults),
            fault_bytes=fault_payload(faults, self.fault_code),
            charger=current > 0,
            load=current < 0,
            cycles=self.pack.cycles + int(self._throughput_ah / self._capacity_ah),
            charged_ah=int(self.pack.cycles * self._capacity_ah + self._charged_ah),
            discharged_ah=int(self.pack.cycles * self._capacity_ah + self._throughput_ah),
        )

    def _watch(self, cells: list[int], sensors: tuple[int, ...], current: float) -> None:
        """Raise and clear alarms by their limits; an alarm clears only some way back from its limit."""
        c_rate = current / self._capacity_ah
        values: dict[str, float] = {
            "max_mv": max(cells),
            "min_mv": min(cells),
            "mean_mv": sum(cells) / len(cells),
            "difference_mv": max(cells) - min(cells),
            "max_c": max(sensors),
            "min_c": min(sensors),
            "difference_c": max(sensors) - min(sensors),
            "charge_c": c_rate,
            "discharge_c": -c_rate,
            "soc": self._remaining_ah / self._capacity_ah * 100,
        }
        for fault, quantity, level_1, level_2, back, _ in self._limits:
            value = values[quantity]
            below = fault.endswith("_low")
            for name, limit in ((f"{fault}_level_1", level_1), (f"{fault}_level_2", level_2)):
                if name in self._alarms:
                    over = value < limit + back if below else value > limit - back
                else:
                    over = value <= limit if below else value >= limit
                if over:
                    self._alarms.add(name)
                else:
                    self._alarms.discard(name)


def _rounded(value: float) -> int:
    """Nearest whole number, halves away from zero, so that nothing depends on even and odd."""
    return int(value + 0.5) if value >= 0 else -int(0.5 - value)


def _to_balance(cells: list[int], current: float, start_mv: int) -> int:
    """Cells to bleed: at rest or charging, those well above the lowest once the highest is nearly full."""
    if current < 0 or max(cells) < start_mv:
        return 0
    floor = min(cells) + _BALANCE_DIFFERENCE_MV
    mask = 0
    for cell, millivolts in enumerate(cells):
        if millivolts > floor and millivolts >= start_mv:
            mask |= 1 << cell
    return mask
