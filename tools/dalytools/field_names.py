# SPDX-License-Identifier: GPL-2.0-or-later
"""The names that both readings use (DESIGN 6): the one thing they share.

A test holds the dissector (``tshark -G fields``) and the reference decoder to this list.
"""

from __future__ import annotations

_HEADER = (
    "kind transport dialect start address data_id unknown_id length data checksum checksum.status direction board retry"
)
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
_SETTINGS = """
setting.rated_capacity setting.cell_nominal_voltage setting.board_count setting.cells_1 setting.cells_2
setting.cells_3 setting.sensors_1 setting.sensors_2 setting.sensors_3 total.charged total.discharged
setting.battery_type setting.operating_mode production_date setting.sleep setting.current_drift firmware_index
setting.cell_high_1 setting.cell_high_2 setting.cell_low_1 setting.cell_low_2 setting.pack_high_1
setting.pack_high_2 setting.pack_low_1 setting.pack_low_2 setting.charge_current_1 setting.charge_current_2
setting.discharge_current_1 setting.discharge_current_2 setting.charge_temp_high_1 setting.charge_temp_high_2
setting.charge_temp_low_1 setting.charge_temp_low_2 setting.discharge_temp_high_1
setting.discharge_temp_high_2 setting.discharge_temp_low_1 setting.discharge_temp_low_2 setting.soc_high_1
setting.soc_high_2 setting.soc_low_1 setting.soc_low_2 setting.cell_difference_1 setting.cell_difference_2
setting.temp_difference_1 setting.temp_difference_2 setting.balance_start setting.balance_difference
setting.short_circuit_current setting.shunt_raw setting.mos_temp_high clock setting.board_number
setting.acquisition_units setting.heater_start setting.fan_start setting.key_logic setting.balancer
setting.series_count setting.balance_current_raw setting.balance_current setting.inverter setting.inverter_bus
setting.mos_charge setting.mos_discharge setting.soc command password alarm.level alarm.class alarm.value alarm.delay
alarm.recovery alarm.recovery_delay alarm.discharge alarm.discharge_delay alarm.charge alarm.charge_delay
balance.active balance.current_raw balance.position balance.state balance.current wakeup.key wakeup.button
wakeup.rs485 wakeup.can wakeup.current cell.average_voltage cell.difference temperature.difference power
energy temperature.mos temperature.board temperature.heater mos.precharge heater heater.current fan mileage
soh time_to_full uptime.total uptime.since_start limit.active limit.current limit.duty
software_version_sent hardware_version_sent
"""
_MODBUS = """
modbus.address modbus.function modbus.register modbus.count modbus.byte_count modbus.value modbus.exception
modbus.absent modbus.ambiguous modbus.assumed modbus.crc modbus.crc.status
"""
_CAN = "can.priority can.destination can.source can.register can.remote"
_HKMS_LEVELS = """
cell_high cell_low cell_difference charge_temp_high charge_temp_low discharge_temp_high discharge_temp_low
temp_difference pack_high pack_low charge_current discharge_current soc_low soh_low mos_temp_high
thermal_runaway
"""
_HKMS_FAULTS = """
mos_temp_high_level_1 mos_temp_high_level_2 board_temp_high_level_1 board_temp_high_level_2
thermal_runaway balance_communication balance_condition
smart_charger smart_discharger charge_undervoltage discharge_overvoltage parallel_communication
afe_communication afe_sampling voltage_detect cell_temp_disconnected flash chg_mos dischg_mos precharge_mos
heating
"""
_REST = "reserved undecoded foreign"

FIELD_NAMES: tuple[str, ...] = tuple(
    f"daly.{name}"
    for name in (
        *" ".join((_HEADER, _LINKS, _TROUBLE, _WRITES, _0X90, _0X91, _0X92, _0X93, _0X94)).split(),
        *" ".join((_0X95, _TABLE, _0X96, _SENSORS, _TEXTS, _0X97)).split(),
        *(f"fault.{name}" for name in _0X98.split()),
        *" ".join((_FAULTS, _CHANGES, _SETTINGS, _MODBUS, _CAN)).split(),
        *(f"level.{name}" for name in _HKMS_LEVELS.split()),
        *(f"fault.{name}" for name in _HKMS_FAULTS.split()),
        *_REST.split(),
    )
)
"""Every field of a record, in the order of the paper."""

VIEW_NAMES: tuple[str, ...] = ("daly.continued_in", "daly.began_in")
"""Fields that the dissector alone has: they tell how a record lies in Wireshark's packets."""
