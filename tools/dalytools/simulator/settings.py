# SPDX-License-Identifier: GPL-2.0-or-later
"""What a board is set to: one store of values behind all dialects, and where A5 carries them (field notes a.2).

    A5   50 .. 6A read, one frame each (texts: several), u16 and u32 high byte first; writes are read - 40 (10 .. 2A)

    50   capacity mAh u32               .       nominal mV
    51   boards  cells of 1, 2, 3        sensors of 1, 2, 3       .
    52   charged Ah u32                 discharged Ah u32
    53   type    mode    YY  MM  DD     sleep s u16               drift
    54   firmware index, 8 letters
    59   cell mV high 1, 2, low 1, 2            5A  pack 0.1 V, the same
    5B   current 0.1 A + 30000: charge 1, 2, discharge 1, 2
    5C   40 + C: charge high 1, 2, low 1, 2, discharge the same                 5D  SOC 0.1 %: high 1, 2, low 1, 2
    5E   difference mV 1, 2   C 1, C 2          5F  balance start mV, difference mV
    60   short circuit A, shunt                 61  YY MM DD hh mm ss
    65   board number, units                    66  heater 40 + C, ., fan 40 + C, ., key logic
    67   balancer on                            68  cells, balance current u16  69  inverter, its bus

Values are kept in the units of the wire, without offsets; currents in 0.1 A, + charges.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from dalytools.simulator.battery import Battery
    from dalytools.simulator.scenario import Board

CURRENT_ZERO: Final = 30000
TEMPERATURE_ZERO: Final = 40


class Slot(NamedTuple):
    """A value in a frame: its name (``""``: unused bytes), how many bytes, what is added on the wire."""

    name: str
    size: int
    offset: int = 0


def _four(what: str, size: int = 2, offset: int = 0) -> tuple[Slot, ...]:
    """``what_high_1, _2, what_low_1, _2``."""
    return tuple(Slot(f"{what}_{side}_{level}", size, offset) for side in ("high", "low") for level in (1, 2))


LAYOUTS: Final[dict[int, tuple[Slot, ...]]] = {
    0x50: (Slot("rated_capacity", 4), Slot("", 2), Slot("cell_nominal_voltage", 2)),
    0x51: (
        Slot("board_count", 1),
        *(Slot(f"{what}_{unit}", 1) for what in ("cells", "sensors") for unit in (1, 2, 3)),
    ),
    0x53: (
        Slot("battery_type", 1),
        Slot("operating_mode", 1),
        *(Slot(f"production_{part}", 1) for part in ("year", "month", "day")),
        Slot("sleep", 2),
        Slot("current_drift", 1),
    ),
    0x59: _four("cell"),
    0x5A: _four("pack"),
    0x5B: (
        *(Slot(f"charge_current_{level}", 2, CURRENT_ZERO) for level in (1, 2)),
        *(Slot(f"discharge_current_{level}", 2, CURRENT_ZERO) for level in (1, 2)),
    ),
    0x5C: (*_four("charge_temp", 1, TEMPERATURE_ZERO), *_four("discharge_temp", 1, TEMPERATURE_ZERO)),
    0x5D: _four("soc"),
    0x5E: (
        *(Slot(f"cell_difference_{level}", 2) for level in (1, 2)),
        *(Slot(f"temp_difference_{level}", 1) for level in (1, 2)),
    ),
    0x5F: (Slot("balance_start", 2), Slot("balance_difference", 2)),
    0x60: (Slot("short_circuit_current", 2), Slot("shunt_raw", 2)),
    0x65: (Slot("board_number", 1), Slot("acquisition_units", 1)),
    0x66: (
        Slot("heater_start", 1, TEMPERATURE_ZERO),
        Slot("", 1),
        Slot("fan_start", 1, TEMPERATURE_ZERO),
        Slot("", 1),
        Slot("key_logic", 1),
    ),
    0x67: (Slot("balancer", 1),),
    0x68: (Slot("series_count", 1), Slot("balance_current_raw", 2)),
    0x69: (Slot("inverter", 1), Slot("inverter_bus", 1)),
}

TEXT_FRAMES: Final = {0x55: 3, 0x56: 5, 0x57: 5, 0x62: 2, 0x63: 2, 0x6A: 5}
"""Texts in several frames of 7 letters, and how many frames each (field notes a.2)."""

TEXT_NAMES: Final = {
    0x55: "manufacturer",
    0x56: "battery_name",
    0x57: "battery_code",
    0x62: "software_version",
    0x63: "hardware_version",
    0x6A: "serial_number",
}

WRITE_OFFSET: Final = 0x40  # write ID = read ID - 40 (field notes a.3)


class Settings:
    """The store. ``values`` by the names of protocol.md's ``setting.``; writes go into it."""

    def __init__(self, board: Board, battery: Battery) -> None:
        pack, chemistry = board.pack, battery.chemistry
        cells, tenth_amperes = pack.cells, pack.capacity_mah // 100  # the current that fills it in an hour
        per_limit = {name: (int(one), int(two)) for name, quantity, one, two, _, _ in chemistry.by_voltage if quantity}
        year, month, day = pack.production_date
        values: dict[str, int] = {
            "rated_capacity": pack.capacity_mah,
            "cell_nominal_voltage": chemistry.nominal_mv,
            "board_count": 1,
            "cells_1": cells,
            "cells_2": 0,
            "cells_3": 0,
            "sensors_1": pack.sensors,
            "sensors_2": 0,
            "sensors_3": 0,
            "battery_type": chemistry.code,
            "operating_mode": 1,
            "production_year": year % 100,
            "production_month": month,
            "production_day": day,
            "sleep": 3600,
            "current_drift": 0,
            "short_circuit_current": 600,
            "shunt_raw": 333,
            "board_number": board.number,
            "acquisition_units": 1,
            "heater_start": 5,
            "fan_start": 50,
            "key_logic": 0x55,
            "balancer": 1,
            "series_count": cells,
            "balance_current_raw": 100,
            "inverter": 0,
            "inverter_bus": 0,
            "balance_start": chemistry.balance_start_mv,
            "balance_difference": 5,
            "soc_high_1": 1000,
            "soc_high_2": 1000,
            "soc_low_1": 100,
            "soc_low_2": 50,
            "cell_difference_1": 300,
            "cell_difference_2": 500,
            "temp_difference_1": 15,
            "temp_difference_2": 20,
            "mos_temp_high": 90,
            # Charge limits stand below 30000 on the wire, discharge limits above (field notes a.1).
            "charge_current_1": -tenth_amperes,
            "charge_current_2": -tenth_amperes * 6 // 5,
            "discharge_current_1": tenth_amperes * 3 // 2,
            "discharge_current_2": tenth_amperes * 2,
        }
        for side in ("high", "low"):
            for level in (1, 2):
                values[f"cell_{side}_{level}"] = per_limit[f"cell_volt_{side}"][level - 1]
                values[f"pack_{side}_{level}"] = per_limit[f"sum_volt_{side}"][level - 1] * cells // 100
        for what, limits in (("charge_temp", (50, 55, 2, 0)), ("discharge_temp", (60, 65, -15, -20))):
            names = (f"{what}_{side}_{level}" for side in ("high", "low") for level in (1, 2))
            values.update(zip(names, limits, strict=True))
        self.values = values
        self.texts = board.texts

    def payload(self, read_id: int) -> bytes | None:
        """Lay out the one-frame reply to a read, eight bytes; None for an ID without a layout here."""
        layout = LAYOUTS.get(read_id)
        if layout is None:
            return None
        return b"".join(_laid_out(self.values.get(slot.name, 0) + slot.offset, slot.size) for slot in layout).ljust(
            8, b"\0"
        )

    def take(self, read_id: int, payload: bytes) -> bool:
        """Take the values of a write, laid out as the reply of this read; False for an ID without a layout here."""
        layout = LAYOUTS.get(read_id)
        if layout is None:
            return False
        at = 0
        for slot in layout:
            if slot.name:
                self.values[slot.name] = int.from_bytes(payload[at : at + slot.size]) - slot.offset
            at += slot.size
        return True

    def text_payloads(self, read_id: int, frame_base: int) -> list[bytes]:
        """Lay out a text in its frames: number, seven letters; zeros behind its end."""
        text: str = getattr(self.texts, TEXT_NAMES[read_id])
        count = TEXT_FRAMES[read_id]
        letters = text.encode("ascii", "replace")[: 7 * count].ljust(7 * count, b"\0")
        return [bytes((index + frame_base,)) + letters[7 * index : 7 * index + 7] for index in range(count)]


def _laid_out(value: int, size: int) -> bytes:
    return min((1 << 8 * size) - 1, max(0, value)).to_bytes(size)
