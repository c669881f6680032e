# SPDX-License-Identifier: GPL-2.0-or-later
"""The registers of the D2 dialect (docs/protocol.md, d: the vendor's xlsx, confirmed by captures).

    0000-001F cells | 20-27 sensors | 28-46 the pack | 47-56 more cells | 80-A8 settings | A9-C8 texts | F0-F3 commands

Not read, for sources disagree: 3E, 57-69.
"""

from __future__ import annotations

from dalyref.quantities import amperes, clock, date, hundreds, number, switch, tenths, text
from dalyref.register_map import RegisterMap, Row, backward, celsius, celsius_of_sensor, milliamperes_not_0, small

TOLD: tuple[Row, ...] = (
    (0x28, 0x28, "pack.voltage", tenths),  # V
    (0x29, 0x29, "pack.current_raw", number),
    (0x29, 0x29, "pack.current", amperes),
    (0x2A, 0x2A, "soc", tenths),  # %
    (0x2B, 0x2B, "cell.max_voltage", number),  # mV
    (0x2C, 0x2C, "cell.min_voltage", number),
    (0x2D, 0x2D, "temperature.max", celsius),
    (0x2E, 0x2E, "temperature.min", celsius),
    (0x2F, 0x2F, "state", small),
    (0x30, 0x30, "remaining_capacity", hundreds),  # mAh
    (0x31, 0x31, "cell_count", small),
    (0x32, 0x32, "sensor_count", small),
    (0x33, 0x33, "cycles", number),
    (0x34, 0x34, "balance.state", number),
    (0x35, 0x35, "mos.charge", switch),
    (0x36, 0x36, "mos.discharge", switch),
    (0x37, 0x37, "cell.average_voltage", number),  # mV
    (0x38, 0x38, "cell.difference", number),  # mV
    (0x39, 0x39, "power", number),  # W
    (0x40, 0x40, "balance.current", milliamperes_not_0),
    (0x42, 0x42, "temperature.mos", celsius_of_sensor),
    (0x43, 0x43, "temperature.board", celsius_of_sensor),
    (0xA9, 0xB0, "software_version", backward),
    (0xA9, 0xB0, "software_version_sent", text),
    (0xB1, 0xB8, "hardware_version", backward),
    (0xB1, 0xB8, "hardware_version_sent", text),
    (0xB9, 0xC8, "battery_code", text),
)

SETTINGS: tuple[Row, ...] = (
    (0x80, 0x80, "setting.rated_capacity", hundreds),  # mAh
    (0x81, 0x81, "setting.cell_nominal_voltage", number),  # mV
    (0x82, 0x82, "setting.board_count", number),
    (0x83, 0x83, "setting.cells_1", number),
    (0x84, 0x84, "setting.cells_2", number),
    (0x85, 0x85, "setting.cells_3", number),
    (0x86, 0x86, "setting.sensors_1", number),
    (0x87, 0x87, "setting.sensors_2", number),
    (0x88, 0x88, "setting.sensors_3", number),
    (0x89, 0x89, "setting.battery_type", small),
    (0x8A, 0x8A, "setting.sleep", number),  # s
    (0x8B, 0x8B, "setting.cell_high_1", number),  # mV
    (0x8C, 0x8C, "setting.cell_high_2", number),
    (0x8D, 0x8D, "setting.cell_low_1", number),
    (0x8E, 0x8E, "setting.cell_low_2", number),
    (0x8F, 0x8F, "setting.pack_high_1", tenths),  # V
    (0x90, 0x90, "setting.pack_high_2", tenths),
    (0x91, 0x91, "setting.pack_low_1", tenths),
    (0x92, 0x92, "setting.pack_low_2", tenths),
    (0x93, 0x93, "setting.charge_current_1", amperes),
    (0x94, 0x94, "setting.charge_current_2", amperes),
    (0x95, 0x95, "setting.discharge_current_1", amperes),
    (0x96, 0x96, "setting.discharge_current_2", amperes),
    (0x97, 0x97, "setting.charge_temp_high_1", celsius),
    (0x98, 0x98, "setting.charge_temp_high_2", celsius),
    (0x99, 0x99, "setting.charge_temp_low_1", celsius),
    (0x9A, 0x9A, "setting.charge_temp_low_2", celsius),
    (0x9B, 0x9B, "setting.discharge_temp_high_1", celsius),
    (0x9C, 0x9C, "setting.discharge_temp_high_2", celsius),
    (0x9D, 0x9D, "setting.discharge_temp_low_1", celsius),
    (0x9E, 0x9E, "setting.discharge_temp_low_2", celsius),
    (0x9F, 0x9F, "setting.cell_difference_1", number),  # mV
    (0xA0, 0xA0, "setting.cell_difference_2", number),
    (0xA1, 0xA1, "setting.temp_difference_1", number),  # C, a difference: no offset
    (0xA2, 0xA2, "setting.temp_difference_2", number),
    (0xA3, 0xA3, "setting.balance_start", number),  # mV
    (0xA4, 0xA4, "setting.balance_difference", number),  # mV
    (0xA5, 0xA5, "setting.mos_charge", switch),
    (0xA6, 0xA6, "setting.mos_discharge", switch),
    (0xA7, 0xA7, "setting.soc", tenths),  # %
    (0xA8, 0xA8, "setting.mos_temp_high", celsius),
    (0xC9, 0xCB, "password", text),
    (0xCC, 0xCD, "production_date", date),
    (0xCF, 0xCF, "setting.balancer", switch),
    (0xD4, 0xD6, "clock", clock),
)

MAP = RegisterMap(
    told=TOLD,
    settings=SETTINGS,
    cells=(*range(0x20), *range(0x47, 0x57)),
    sensors=tuple(range(0x20, 0x28)),
    cell_count=0x31,
    sensor_count=0x32,
    charge=0x2A,
    faults=(0x3A, 0x3B, 0x3C, 0x3D),
    commands={0xF0: "restart", 0xF1: "shutdown", 0xF2: "zero_current", 0xF3: "reset"},
)
