# SPDX-License-Identifier: GPL-2.0-or-later
"""The names that both readings use (DESIGN 6): the one thing they share.

A test holds the dissector (``tshark -G fields``) and the reference decoder to this list.
"""

from __future__ import annotations

_HEADER = "kind transport dialect start address data_id length data checksum checksum.status direction board retry"
_LINKS = "request_in reply_in response_time"
_TROUBLE = "unanswered unasked late_to other_board second_host"
_WRITES = "write write_result"
_CHANGES = "changed changed_from contradiction contradicts"
_0X90 = "pack.voltage pack.gather_voltage pack.current pack.current_raw soc pack.state"
_0X91 = "cell.max_voltage cell.max_number cell.min_voltage cell.min_number"
_0X92 = "temperature.max temperature.max_number temperature.min temperature.min_number"
_0X93 = "state mos.charge mos.discharge life remaining_capacity"
_0X94 = "cell_count sensor_count charger load di1 di2 di3 di4 do1 do2 do3 do4 cycles"
_0X95 = "frame_number cell.voltage cells.voltage cells.count cells.min cells.max cells.average cells.spread"
_TABLE = f"cells.min_number cells.max_number {' '.join(f'cell.{number:02d}' for number in range(1, 49))}"
_SENSORS = """
sensors.temperature sensors.count sensors.min sensors.max sensors.average sensors.spread
sensors.min_number sensors.max_number
"""
_TEXTS = "text_part manufacturer battery_name battery_code software_version hardware_version serial_number"
_0X96 = "temperature burst.missing burst.repeat burst.cut_off reassembled_in"
_0X97 = "balance.mask balance.cell balance.active_cell"
_0X98 = """
cell_volt_high_level_1 cell_volt_high_level_2 cell_volt_low_level_1 cell_volt_low_level_2
sum_volt_high_level_1 sum_volt_high_level_2 sum_volt_low_level_1 sum_volt_low_level_2
chg_temp_high_level_1 chg_temp_high_level_2 chg_temp_low_level_1 chg_temp_low_level_2
dischg_temp_high_level_1 dischg_temp_high_level_2 dischg_temp_low_level_1 dischg_temp_low_level_2
chg_overcurrent_level_1 chg_overcurrent_level_2 dischg_overcurrent_level_1 dischg_overcurrent_level_2
soc_high_level_1 soc_high_level_2 soc_low_level_1 soc_low_level_2
diff_volt_level_1 diff_volt_level_2 diff_temp_level_1 diff_temp_level_2
chg_mos_temp_high dischg_mos_temp_high chg_mos_temp_sensor dischg_mos_temp_sensor
chg_mos_adhesion dischg_mos_adhesion chg_mos_open_circuit dischg_mos_open_circuit
afe_collect_chip voltage_collect_dropped cell_temp_sensor eeprom
rtc precharge communication internal_communication
current_module sum_voltage_detect short_circuit_protect low_volt_forbidden_chg
mos_off_by_command charging_cabinet_offline
"""
_FAULTS = "fault_code fault_count fault_raised fault_cleared"
_MODBUS = "modbus.address modbus.function modbus.crc modbus.crc.status"
_REST = "reserved undecoded foreign"

FIELD_NAMES: tuple[str, ...] = tuple(
    f"daly.{name}"
    for name in (
        *" ".join((_HEADER, _LINKS, _TROUBLE, _WRITES, _0X90, _0X91, _0X92, _0X93, _0X94)).split(),
        *" ".join((_0X95, _TABLE, _0X96, _SENSORS, _TEXTS, _0X97)).split(),
        *(f"fault.{name}" for name in _0X98.split()),
        *" ".join((_FAULTS, _CHANGES, _MODBUS, _REST)).split(),
    )
)
"""Every field of a record, in the order of the paper."""

VIEW_NAMES: tuple[str, ...] = ("daly.continued_in", "daly.began_in")
"""Fields that the dissector alone has: they tell how a record lies in Wireshark's packets."""
