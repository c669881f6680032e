# SPDX-License-Identifier: GPL-2.0-or-later
"""The registers of the 81 dialect, requests to 80 + N, replies from 50 + N (docs/protocol.md, d).

    0000-002F cells | 30-37 sensors | 38-73 the pack | A9-AC uptime | 100-16F settings | 178-1A8 texts

Not read, for sources disagree: 3B, 4F-51, 64; for nobody knows the order of their bytes: 66-69, 6D-73 (faults).
"""

from __future__ import annotations

from dalyref.quantities import Meaning, amperes, clock, date, hundreds, number, switch, tenths, text
from dalyref.register_map import RegisterMap, Row, celsius, celsius_of_sensor, milliamperes_not_0, small

TOLD: tuple[Row, ...] = (
    (0x38, 0x38, "pack.voltage", tenths),  # V
    (0x39, 0x39, "pack.current_raw", number),
    (0x39, 0x39, "pack.current", amperes),
    (0x3A, 0x3A, "soc", tenths),  # %
    (0x3C, 0x3C, "cell_count", small),
    (0x3D, 0x3D, "sensor_count", small),
    (0x3E, 0x3E, "cell.max_voltage", number),  # mV
    (0x3F, 0x3F, "cell.max_number", small),
    (0x40, 0x40, "cell.min_voltage", number),
    (0x41, 0x41, "cell.min_number", small),
    (0x42, 0x42, "cell.difference", number),  # mV
    (0x43, 0x43, "temperature.max", celsius),
    (0x44, 0x44, "temperature.max_number", small),
    (0x45, 0x45, "temperature.min", celsius),
    (0x46, 0x46, "temperature.min_number", small),
    (0x47, 0x47, "temperature.difference", number),  # C, no offset
    (0x48, 0x48, "state", small),
    (0x4B, 0x4B, "remaining_capacity", hundreds),  # mAh
    (0x4C, 0x4C, "cycles", number),
    (0x4D, 0x4D, "balance.state", number),
    (0x4E, 0x4E, "balance.current", milliamperes_not_0),
    (0x52, 0x52, "mos.charge", switch),
    (0x53, 0x53, "mos.discharge", switch),
    (0x54, 0x54, "mos.precharge", switch),
    (0x55, 0x55, "heater", switch),
    (0x56, 0x56, "fan", switch),
    (0x57, 0x57, "cell.average_voltage", number),  # mV
    (0x58, 0x58, "power", number),  # W
    (0x59, 0x59, "energy", number),  # Wh
    (0x5A, 0x5A, "temperature.mos", celsius_of_sensor),
    (0x5B, 0x5B, "temperature.board", celsius_of_sensor),
    (0x5C, 0x5C, "temperature.heater", celsius_of_sensor),
    (0x5E, 0x5E, "mileage", tenths),  # km
    (0x61, 0x63, "clock", clock),
    (0xA9, 0xAA, "uptime.total", number),  # s, of its life
    (0xAB, 0xAC, "uptime.since_start", number),  # s, since it was switched on
    (0x178, 0x17E, "software_version", text),
    (0x17F, 0x185, "hardware_version", text),
    (0x18D, 0x198, "serial_number", text),
    (0x199, 0x1A8, "battery_code", text),
)


def _tens_of_seconds(raw: bytes) -> int | None:
    """Give a time, s, sent in tens; none where it is FFFF, which a write has for "never"."""
    return None if raw == b"\xff\xff" else int.from_bytes(raw) * 10


def _limit(register: int, name: str, meaning: Meaning) -> tuple[Row, Row]:
    """Level 1 (warning) and level 2 (protection); return and delay, which follow, have no field."""
    return (
        (register, register, f"setting.{name}_1", meaning),
        (register + 1, register + 1, f"setting.{name}_2", meaning),
    )


SETTINGS: tuple[Row, ...] = (
    (0x100, 0x100, "setting.board_number", number),
    (0x109, 0x10A, "setting.rated_capacity", number),  # mAh
    (0x114, 0x114, "setting.cell_nominal_voltage", number),  # mV
    (0x115, 0x115, "setting.sleep", _tens_of_seconds),
    (0x116, 0x116, "setting.soc", tenths),  # %
    (0x117, 0x117, "setting.balance_current", number),  # mA
    (0x119, 0x119, "setting.balancer", switch),
    (0x11A, 0x11A, "setting.balance_start", number),  # mV
    (0x11B, 0x11B, "setting.balance_difference", number),  # mV
    (0x120, 0x120, "setting.key_logic", small),  # 55 none, A5 discharge and sleep, 5A discharge, AA both, A6 and sleep
    (0x121, 0x121, "setting.mos_charge", switch),
    (0x122, 0x122, "setting.mos_discharge", switch),
    (0x123, 0x125, "clock", clock),
    (0x126, 0x128, "password", text),
    (0x129, 0x12A, "production_date", date),
    *_limit(0x130, "cell_high", number),  # mV
    *_limit(0x134, "cell_low", number),
    *_limit(0x138, "pack_high", tenths),  # V
    *_limit(0x13C, "pack_low", tenths),
    *_limit(0x140, "charge_current", amperes),
    *_limit(0x145, "discharge_current", amperes),
    *_limit(0x14A, "charge_temp_high", celsius),
    *_limit(0x14E, "charge_temp_low", celsius),
    *_limit(0x152, "discharge_temp_high", celsius),
    *_limit(0x156, "discharge_temp_low", celsius),
    *_limit(0x15A, "cell_difference", number),  # mV
    *_limit(0x15E, "temp_difference", number),  # C, no offset
    *_limit(0x162, "soc_low", tenths),  # %
    (0x16E, 0x16E, "setting.short_circuit_current", number),  # A
)

MAP = RegisterMap(
    told=TOLD,
    settings=SETTINGS,
    cells=tuple(range(0x30)),
    sensors=tuple(range(0x30, 0x38)),
    cell_count=0x3C,
    sensor_count=0x3D,
    charge=0x3A,
)
