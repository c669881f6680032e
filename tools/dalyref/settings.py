# SPDX-License-Identifier: GPL-2.0-or-later
"""Replies beside those of the paper: settings 50 to 6A, balance 99, wake-up D8 (docs/protocol.md, a.2).

Eight data bytes; what no row names is not explained by anybody, or stale. A write with ID - 40 has the same bytes
(``writes``). Texts in several frames are in ``texts``; 58, 64 and 9A have no layout that two sources agree on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

from dalyref.quantities import Meaning, amperes, celsius, clock, date, number, switch, tenths, text

if TYPE_CHECKING:
    from dalyref.values import Fields

_Row: TypeAlias = tuple[int, int, str, Meaning]
"""First byte, last byte, field, meaning."""

TABLE: dict[int, tuple[_Row, ...]] = {
    0x50: (
        (0, 3, "setting.rated_capacity", number),  # mAh
        (6, 7, "setting.cell_nominal_voltage", number),  # mV; by some 4-7, which is absurd with more than 00 in 4-5
    ),
    0x51: (  # acquisition boards, and the cells and sensors of each
        (0, 0, "setting.board_count", number),
        (1, 1, "setting.cells_1", number),
        (2, 2, "setting.cells_2", number),
        (3, 3, "setting.cells_3", number),
        (4, 4, "setting.sensors_1", number),
        (5, 5, "setting.sensors_2", number),
        (6, 6, "setting.sensors_3", number),
    ),
    0x52: (
        (0, 3, "total.charged", number),  # Ah
        (4, 7, "total.discharged", number),  # Ah
    ),
    0x53: (  # contradicted: one source has bytes 0 and 1 the other way round, and byte 5 in minutes
        (0, 0, "setting.battery_type", number),  # 0 LFP, 1 ternary, 2 LTO
        (1, 1, "setting.operating_mode", number),  # 1 long press, 2 short press
        (2, 4, "production_date", date),
        (5, 6, "setting.sleep", number),  # s
        (7, 7, "setting.current_drift", tenths),  # A
    ),
    0x54: ((0, 7, "firmware_index", text),),
    0x59: (  # mV
        (0, 1, "setting.cell_high_1", number),
        (2, 3, "setting.cell_high_2", number),
        (4, 5, "setting.cell_low_1", number),
        (6, 7, "setting.cell_low_2", number),
    ),
    0x5A: (  # V
        (0, 1, "setting.pack_high_1", tenths),
        (2, 3, "setting.pack_high_2", tenths),
        (4, 5, "setting.pack_low_1", tenths),
        (6, 7, "setting.pack_low_2", tenths),
    ),
    0x5B: (  # A
        (0, 1, "setting.charge_current_1", amperes),
        (2, 3, "setting.charge_current_2", amperes),
        (4, 5, "setting.discharge_current_1", amperes),
        (6, 7, "setting.discharge_current_2", amperes),
    ),
    0x5C: (  # C
        (0, 0, "setting.charge_temp_high_1", celsius),
        (1, 1, "setting.charge_temp_high_2", celsius),
        (2, 2, "setting.charge_temp_low_1", celsius),
        (3, 3, "setting.charge_temp_low_2", celsius),
        (4, 4, "setting.discharge_temp_high_1", celsius),
        (5, 5, "setting.discharge_temp_high_2", celsius),
        (6, 6, "setting.discharge_temp_low_1", celsius),
        (7, 7, "setting.discharge_temp_low_2", celsius),
    ),
    0x5D: (  # %
        (0, 1, "setting.soc_high_1", tenths),
        (2, 3, "setting.soc_high_2", tenths),
        (4, 5, "setting.soc_low_1", tenths),
        (6, 7, "setting.soc_low_2", tenths),
    ),
    0x5E: (
        (0, 1, "setting.cell_difference_1", number),  # mV
        (2, 3, "setting.cell_difference_2", number),
        (4, 4, "setting.temp_difference_1", number),  # C, a difference: no offset
        (5, 5, "setting.temp_difference_2", number),
    ),
    0x5F: (
        (0, 1, "setting.balance_start", number),  # mV
        (2, 3, "setting.balance_difference", number),  # mV
    ),
    0x60: (
        (0, 1, "setting.short_circuit_current", number),  # A
        (2, 3, "setting.shunt_raw", number),  # unit contradicted
    ),
    0x61: ((0, 5, "clock", clock),),
    0x65: (
        (0, 0, "setting.board_number", number),
        (1, 1, "setting.acquisition_units", number),
    ),
    0x66: (
        (0, 0, "setting.heater_start", celsius),
        (2, 2, "setting.fan_start", celsius),
        (4, 4, "setting.key_logic", number),  # 55 none, A5, 5A
    ),
    0x67: ((0, 0, "setting.balancer", switch),),
    0x68: (
        (0, 0, "setting.series_count", number),
        (1, 2, "setting.balance_current_raw", number),  # unit not known
    ),
    0x69: (
        (0, 0, "setting.inverter", number),  # 0 none, 1 Pylon, 2 Growatt, 3 Sofar, 4 Voltronic, 5 GoodWe, 6 SRNE, ...
        (1, 1, "setting.inverter_bus", number),  # 0 RS485, 1 CAN
    ),
    0x99: (
        (0, 0, "balance.active", switch),
        (1, 2, "balance.current_raw", number),  # offset 30000, scale not sure
        (3, 3, "balance.position", number),
    ),
    0xD8: (
        (0, 0, "wakeup.key", switch),
        (1, 1, "wakeup.button", switch),
        (2, 2, "wakeup.rs485", switch),
        (3, 3, "wakeup.can", switch),
        (4, 4, "wakeup.current", switch),
    ),
}


def decode(data_id: int, data: bytes) -> Fields:
    """Decode eight data bytes; an ID that is not in the table has no values."""
    fields: Fields = {}
    for first, last, name, meaning in TABLE.get(data_id, ()):
        value = meaning(data[first : last + 1])
        if value is not None:
            fields["daly." + name] = value
    return fields
