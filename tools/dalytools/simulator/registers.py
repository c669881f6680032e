# SPDX-License-Identifier: GPL-2.0-or-later
"""The registers of both Modbus dialects (field notes d.1, d.2), filled from the battery and settings that A5 has too.

A register that no map names reads FFFF, as on real boards. Settings are where the maps have them; writing one that is
not there is echoed and changes nothing, 000C included: the example of the papers, cell 13 in truth (fact 9).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from dalytools.simulator.settings import CURRENT_ZERO, TEMPERATURE_ZERO

if TYPE_CHECKING:
    from dalytools.simulator.battery import Reading
    from dalytools.simulator.scenario import Dialect, Reserved
    from dalytools.simulator.settings import Settings

ABSENT: Final = 0xFFFF


class Setting(NamedTuple):
    """A setting in a register: its name in the store, how much one count is, what is added on the wire."""

    name: str
    scale: int = 1
    offset: int = 0


def _levels(start: int, *names: str, offset: int = 0) -> dict[int, Setting]:
    """``name_1, name_2`` for each name, in registers from start on."""
    pairs = [f"{name}_{level}" for name in names for level in (1, 2)]
    return {start + place: Setting(name, 1, offset) for place, name in enumerate(pairs)}


SETTINGS: Final[dict[Dialect, dict[int, Setting]]] = {
    "a5": {},
    "d2": {
        0x80: Setting("rated_capacity", 100),
        0x81: Setting("cell_nominal_voltage"),
        0x82: Setting("board_count"),
        **{0x83 + unit: Setting(f"cells_{unit + 1}") for unit in range(3)},
        **{0x86 + unit: Setting(f"sensors_{unit + 1}") for unit in range(3)},
        0x89: Setting("battery_type"),
        0x8A: Setting("sleep"),
        **_levels(0x8B, "cell_high", "cell_low", "pack_high", "pack_low"),
        **_levels(0x93, "charge_current", "discharge_current", offset=CURRENT_ZERO),
        **_levels(
            0x97,
            "charge_temp_high",
            "charge_temp_low",
            "discharge_temp_high",
            "discharge_temp_low",
            offset=TEMPERATURE_ZERO,
        ),
        **_levels(0x9F, "cell_difference", "temp_difference"),
        0xA3: Setting("balance_start"),
        0xA4: Setting("balance_difference"),
        0xA8: Setting("mos_temp_high", 1, TEMPERATURE_ZERO),
        0xCF: Setting("balancer"),
    },
    "81": {
        0x100: Setting("board_number"),
        0x114: Setting("cell_nominal_voltage"),
        0x115: Setting("sleep", 10),
        0x119: Setting("balancer"),
        0x11A: Setting("balance_start"),
        0x11B: Setting("balance_difference"),
        0x120: Setting("key_logic"),
        **_levels(0x130, "cell_high"),
        **_levels(0x134, "cell_low"),
        **_levels(0x138, "pack_high"),
        **_levels(0x13C, "pack_low"),
        **_levels(0x140, "charge_current", offset=CURRENT_ZERO),
        **_levels(0x145, "discharge_current", offset=CURRENT_ZERO),
        **_levels(0x14A, "charge_temp_high", offset=TEMPERATURE_ZERO),
        **_levels(0x14E, "charge_temp_low", offset=TEMPERATURE_ZERO),
        **_levels(0x152, "discharge_temp_high", offset=TEMPERATURE_ZERO),
        **_levels(0x156, "discharge_temp_low", offset=TEMPERATURE_ZERO),
        **_levels(0x15A, "cell_difference"),
        **_levels(0x15E, "temp_difference"),
        **_levels(0x162, "soc_low"),
        0x16E: Setting("short_circuit_current"),
    },
}

MOS_SWITCHES: Final[dict[Dialect, tuple[int, int]]] = {"a5": (-1, -1), "d2": (0xA5, 0xA6), "81": (0x121, 0x122)}
"""Registers that switch the charge and the discharge MOS."""

SOC_WRITES: Final[dict[Dialect, int]] = {"a5": -1, "d2": 0xA7, "81": 0x116}
CLOCKS: Final[dict[Dialect, int]] = {"a5": -1, "d2": 0xD4, "81": 0x123}
COMMANDS: Final = {0xF0: "restart", 0xF1: "shutdown", 0xF2: "zero_current", 0xF3: "reset"}  # D2


class Measured(NamedTuple):
    """What all registers are filled from."""

    reading: Reading
    settings: Settings
    clock: bytes  # YY MM DD hh mm ss
    reserved: Reserved
    discharge_high: bool  # raw current above 30000 means discharge
    soc_off: int  # a lie on demand, in 0.1 %


def d2(now: Measured) -> dict[int, int]:
    """Fill the D2 map: register to value."""
    reading, settings = now.reading, now.settings
    cells, sensors = reading.cells_mv, reading.sensors_c
    unused_sensor = {"zero": 0, "ff": 0x00FF, "stale": 0x0028}[now.reserved]
    words = dict.fromkeys((*range(0x20), *range(0x47, 0x57)), 0)
    words.update({cell if cell < 32 else 0x47 + cell - 32: millivolts for cell, millivolts in enumerate(cells)})
    words.update({0x20 + slot: unused_sensor for slot in range(8)})
    words.update({0x20 + slot: _celsius(degrees) for slot, degrees in enumerate(sensors[:8])})
    faults = reading.fault_bytes
    words.update(
        {
            0x28: reading.pack_dv,
            0x29: _current(now),
            0x2A: _soc(now),
            0x2B: max(cells),
            0x2C: min(cells),
            0x2D: _celsius(max(sensors)),
            0x2E: _celsius(min(sensors)),
            0x2F: reading.state,
            0x30: reading.remaining_mah // 100,
            0x31: len(cells),
            0x32: min(8, len(sensors)),
            0x33: reading.cycles,
            0x34: int(reading.balance_mask > 0),
            0x35: int(reading.charge_mos),
            0x36: int(reading.discharge_mos),
            0x37: sum(cells) // len(cells),
            0x38: max(cells) - min(cells),
            0x39: _watts(reading),
            **{0x3A + word: faults[2 * word + 1] << 8 | faults[2 * word] for word in range(4)},
            0x3E: 0,
            0x40: CURRENT_ZERO,
            0x42: _celsius(sensors[0] + 2),
            0x43: _celsius(sensors[0] + 1),
        }
    )
    words.update({register: _set(settings, setting) for register, setting in SETTINGS["d2"].items()})
    charge, discharge = MOS_SWITCHES["d2"]
    words[charge], words[discharge] = int(reading.charge_mos), int(reading.discharge_mos)
    words[SOC_WRITES["d2"]] = _soc(now)
    texts = settings.texts
    # Software and hardware strings stand there backwards, the battery code does not (field notes d.1).
    words.update(_letters(0xA9, texts.software_version[:16][::-1], 8))
    words.update(_letters(0xB1, texts.hardware_version[:16][::-1], 8))
    words.update(_letters(0xB9, texts.battery_code, 16))
    words.update(_letters(0xC9, texts.password, 3))
    words.update(_words(0xCC, _date(settings)))
    words.update(_words(CLOCKS["d2"], now.clock))
    return words


def p81(now: Measured) -> dict[int, int]:
    """Fill the map of 81: register to value."""
    reading, settings = now.reading, now.settings
    cells, sensors = reading.cells_mv, reading.sensors_c
    high, low, hot, cold = max(cells), min(cells), max(sensors), min(sensors)
    words = dict.fromkeys(range(0x30), 0)
    words.update(dict(enumerate(cells)))
    words.update({0x30 + slot: ABSENT for slot in range(8)})
    words.update({0x30 + slot: _celsius(degrees) for slot, degrees in enumerate(sensors[:8])})
    words.update(
        {
            0x38: reading.pack_dv,
            0x39: _current(now),
            0x3A: _soc(now),
            0x3B: 1000,
            0x3C: len(cells),
            0x3D: min(8, len(sensors)),
            0x3E: high,
            0x3F: cells.index(high) + 1,
            0x40: low,
            0x41: cells.index(low) + 1,
            0x42: high - low,
            0x43: _celsius(hot),
            0x44: sensors.index(hot) + 1,
            0x45: _celsius(cold),
            0x46: sensors.index(cold) + 1,
            0x47: hot - cold,
            0x48: reading.state,
            0x4B: reading.remaining_mah // 100,
            0x4C: reading.cycles,
            0x4D: int(reading.balance_mask > 0),
            0x4E: CURRENT_ZERO,
            0x52: int(reading.charge_mos),
            0x53: int(reading.discharge_mos),
            0x54: 0,
            0x55: 0,
            0x56: 0,
            0x57: sum(cells) // len(cells),
            0x58: _watts(reading),
            0x59: reading.remaining_mah // 1000 * reading.pack_dv // 10 & 0xFFFF,
            0x5A: _celsius(sensors[0] + 2),
            0x5B: _celsius(sensors[0] + 1),
        }
    )
    words.update(_words(0x61, now.clock))
    words.update({register: _set(settings, setting) for register, setting in SETTINGS["81"].items()})
    words.update(_words(0x109, settings.values["rated_capacity"].to_bytes(4)))
    words[SOC_WRITES["81"]] = _soc(now)
    charge, discharge = MOS_SWITCHES["81"]
    words[charge], words[discharge] = int(reading.charge_mos), int(reading.discharge_mos)
    texts = settings.texts
    words.update(_words(CLOCKS["81"], now.clock))
    words.update(_letters(0x126, texts.password, 3))
    words.update(_words(0x129, _date(settings)))
    words.update(_letters(0x178, texts.software_version, 7))
    words.update(_letters(0x17F, texts.hardware_version, 7))
    words.update(_letters(0x18D, texts.serial_number, 12))
    words.update(_letters(0x199, texts.battery_code, 16))
    return words


def _celsius(degrees: int) -> int:
    return min(255, max(0, degrees + TEMPERATURE_ZERO))


def _current(now: Measured) -> int:
    tenths = -now.reading.current_da if now.discharge_high else now.reading.current_da
    return min(65534, max(0, CURRENT_ZERO + tenths))


def _soc(now: Measured) -> int:
    return min(1000, max(0, now.reading.soc_permille + now.soc_off))


def _watts(reading: Reading) -> int:
    return min(65534, reading.pack_dv * abs(reading.current_da) // 100)


def _set(settings: Settings, setting: Setting) -> int:
    return min(65534, max(0, settings.values[setting.name] // setting.scale + setting.offset))


def _date(settings: Settings) -> bytes:
    return bytes(settings.values[f"production_{part}"] & 0xFF for part in ("year", "month", "day")) + b"\0"


def _words(start: int, data: bytes) -> dict[int, int]:
    return {start + at // 2: int.from_bytes(data[at : at + 2]) for at in range(0, len(data), 2)}


def _letters(start: int, text: str, count: int) -> dict[int, int]:
    return _words(start, text.encode("ascii", "replace")[: 2 * count].ljust(2 * count, b"\0"))
