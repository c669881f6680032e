-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Fields beyond the paper V1.2: settings, limits, clock, alarms, and what only Modbus, CAN's HKMS dialect or other data IDs
-- tell. Each description ends with how sure the reading is; the sources are in docs/protocol.md (a.2, a.3, d).

local types = require("daly_field_types")

local plain, hex, number, named = types.plain, types.hex, types.number, types.named
local double, text, boolean = types.double, types.text, types.boolean

local M = {}

local NAMES = require("daly_settings").NAMES

-- stylua: ignore start

--- Declare them, each under its name without "daly.". `add`: see daly_field_types.new.
function M.declare(add)
  -- Ratings, field notes a.2: 0x50 to 0x53; Modbus 80 to 8A (D2), 100 to 117 (81).
  add("setting.rated_capacity", "setting.rated_capacity", plain(ProtoField.uint32, "Rated capacity", "Rated capacity, mAh; 0x50 bytes 0-3, D2 80, 81 109-10A [seen by several]"))
  add("setting.cell_nominal_voltage", "setting.cell_nominal_voltage", plain(ProtoField.uint32, "Nominal cell voltage", "Nominal cell voltage, mV; 0x50 bytes 6-7 (some sources: 4-7), D2 81, 81 114 [seen by several]"))
  add("setting.board_count", "setting.board_count", plain(ProtoField.uint16, "Acquisition boards", "Acquisition boards; 0x51 byte 0, D2 82 [seen by several]"))
  add("setting.cells_1", "setting.cells_1", plain(ProtoField.uint16, "Cells of board 1", "Cells of acquisition board 1; 0x51 byte 1, D2 83 [seen by several]"))
  add("setting.cells_2", "setting.cells_2", plain(ProtoField.uint16, "Cells of board 2", "Cells of acquisition board 2; 0x51 byte 2, D2 84 [seen by several]"))
  add("setting.cells_3", "setting.cells_3", plain(ProtoField.uint16, "Cells of board 3", "Cells of acquisition board 3; 0x51 byte 3, D2 85 [seen by several]"))
  add("setting.sensors_1", "setting.sensors_1", plain(ProtoField.uint16, "Sensors of board 1", "Sensors of acquisition board 1; 0x51 byte 4, D2 86 [seen by several]"))
  add("setting.sensors_2", "setting.sensors_2", plain(ProtoField.uint16, "Sensors of board 2", "Sensors of acquisition board 2; 0x51 byte 5, D2 87 [seen by several]"))
  add("setting.sensors_3", "setting.sensors_3", plain(ProtoField.uint16, "Sensors of board 3", "Sensors of acquisition board 3; 0x51 byte 6, D2 88 [seen by several]"))
  add("total.charged", "total.charged", plain(ProtoField.uint32, "Charged in all", "Charge taken in so far, Ah; 0x52 bytes 0-3 [seen by several]"))
  add("total.discharged", "total.discharged", plain(ProtoField.uint32, "Discharged in all", "Charge given so far, Ah; 0x52 bytes 4-7 [seen by several]"))
  add("setting.battery_type", "setting.battery_type", named("Battery type", NAMES.battery_type, "0 LFP, 1 ternary, 2 LTO; 0x53 byte 0, D2 89 [contradicted in 0x53: one source has bytes 0 and 1 the other way round]"))
  add("setting.operating_mode", "setting.operating_mode", named("Operating mode", NAMES.operating_mode, "1 long press, 2 short press; 0x53 byte 1 [contradicted: one source has bytes 0 and 1 the other way round]"))
  add("production_date", "production_date", text("Production date", "20YY-MM-DD; 0x53 bytes 2-4, D2 CC, 81 129 [contradicted in 0x53; seen by several in Modbus]"))
  add("setting.sleep", "setting.sleep", plain(ProtoField.uint32, "Sleep after", "Time without current before sleep, s; 0x53 bytes 5-6, D2 8A, 81 115 [contradicted in 0x53: one source has byte 5 in minutes]"))
  add("setting.current_drift", "setting.current_drift", double("Current drift", "Current taken for zero, A; 0x53 byte 7, 0.1 A [seen once]"))
  add("firmware_index", "firmware_index", text("Firmware index", "Eight characters; 0x54 [seen by several]"))

  -- Limits, field notes a.2: 0x59 to 0x60; Modbus D2 8B to A8, 81 130 to 16E.
  add("setting.cell_high_1", "setting.cell_high_1", plain(ProtoField.uint16, "Cell high, level 1", "Cell voltage too high, level 1, mV; 0x59, D2 8B, 81 130 [seen by several]"))
  add("setting.cell_high_2", "setting.cell_high_2", plain(ProtoField.uint16, "Cell high, level 2", "Cell voltage too high, level 2, mV; 0x59, D2 8C, 81 131 [seen by several]"))
  add("setting.cell_low_1", "setting.cell_low_1", plain(ProtoField.uint16, "Cell low, level 1", "Cell voltage too low, level 1, mV; 0x59, D2 8D, 81 134 [seen by several]"))
  add("setting.cell_low_2", "setting.cell_low_2", plain(ProtoField.uint16, "Cell low, level 2", "Cell voltage too low, level 2, mV; 0x59, D2 8E, 81 135 [seen by several]"))
  add("setting.pack_high_1", "setting.pack_high_1", double("Pack high, level 1", "Pack voltage too high, level 1, V; 0x5A, D2 8F, 81 138 [seen by several]"))
  add("setting.pack_high_2", "setting.pack_high_2", double("Pack high, level 2", "Pack voltage too high, level 2, V; 0x5A, D2 90, 81 139 [seen by several]"))
  add("setting.pack_low_1", "setting.pack_low_1", double("Pack low, level 1", "Pack voltage too low, level 1, V; 0x5A, D2 91, 81 13C [seen by several]"))
  add("setting.pack_low_2", "setting.pack_low_2", double("Pack low, level 2", "Pack voltage too low, level 2, V; 0x5A, D2 92, 81 13D [seen by several]"))
  add("setting.charge_current_1", "setting.charge_current_1", double("Charge current, level 1", "Charge current too high, level 1, as sent, (raw - 30000) / 10, A; 0x5B, D2 93, 81 140 [seen by several]"))
  add("setting.charge_current_2", "setting.charge_current_2", double("Charge current, level 2", "Charge current too high, level 2, as sent, (raw - 30000) / 10, A; 0x5B, D2 94, 81 141 [seen by several]"))
  add("setting.discharge_current_1", "setting.discharge_current_1", double("Discharge current, level 1", "Discharge current too high, level 1, as sent, (raw - 30000) / 10, A; 0x5B, D2 95, 81 145 [seen by several]"))
  add("setting.discharge_current_2", "setting.discharge_current_2", double("Discharge current, level 2", "Discharge current too high, level 2, as sent, (raw - 30000) / 10, A; 0x5B, D2 96, 81 146 [seen by several]"))
  add("setting.charge_temp_high_1", "setting.charge_temp_high_1", plain(ProtoField.int16, "Charge temperature high, level 1", "Charge temperature high, level 1, C, offset 40; 0x5C byte 0, D2 97, 81 14A [seen by several]"))
  add("setting.charge_temp_high_2", "setting.charge_temp_high_2", plain(ProtoField.int16, "Charge temperature high, level 2", "Charge temperature high, level 2, C, offset 40; 0x5C byte 1, D2 98, 81 14B [seen by several]"))
  add("setting.charge_temp_low_1", "setting.charge_temp_low_1", plain(ProtoField.int16, "Charge temperature low, level 1", "Charge temperature low, level 1, C, offset 40; 0x5C byte 2, D2 99, 81 14E [seen by several]"))
  add("setting.charge_temp_low_2", "setting.charge_temp_low_2", plain(ProtoField.int16, "Charge temperature low, level 2", "Charge temperature low, level 2, C, offset 40; 0x5C byte 3, D2 9A, 81 14F [seen by several]"))
  add("setting.discharge_temp_high_1", "setting.discharge_temp_high_1", plain(ProtoField.int16, "Discharge temperature high, level 1", "Discharge temperature high, level 1, C, offset 40; 0x5C byte 4, D2 9B, 81 152 [seen by several]"))
  add("setting.discharge_temp_high_2", "setting.discharge_temp_high_2", plain(ProtoField.int16, "Discharge temperature high, level 2", "Discharge temperature high, level 2, C, offset 40; 0x5C byte 5, D2 9C, 81 153 [seen by several]"))
  add("setting.discharge_temp_low_1", "setting.discharge_temp_low_1", plain(ProtoField.int16, "Discharge temperature low, level 1", "Discharge temperature low, level 1, C, offset 40; 0x5C byte 6, D2 9D, 81 156 [seen by several]"))
  add("setting.discharge_temp_low_2", "setting.discharge_temp_low_2", plain(ProtoField.int16, "Discharge temperature low, level 2", "Discharge temperature low, level 2, C, offset 40; 0x5C byte 7, D2 9E, 81 157 [seen by several]"))
  add("setting.soc_high_1", "setting.soc_high_1", double("SOC too high, level 1", "SOC too high, level 1, %; 0x5D, 0.1 % [seen once]"))
  add("setting.soc_high_2", "setting.soc_high_2", double("SOC too high, level 2", "SOC too high, level 2, %; 0x5D, 0.1 % [seen once]"))
  add("setting.soc_low_1", "setting.soc_low_1", double("SOC too low, level 1", "SOC too low, level 1, %; 0x5D, 0.1 %, 81 162 [seen once]"))
  add("setting.soc_low_2", "setting.soc_low_2", double("SOC too low, level 2", "SOC too low, level 2, %; 0x5D, 0.1 %, 81 163 [seen once]"))
  add("setting.cell_difference_1", "setting.cell_difference_1", plain(ProtoField.uint16, "Cell difference, level 1", "Highest minus lowest cell too high, level 1, mV; 0x5E, D2 9F, 81 15A [seen by several]"))
  add("setting.cell_difference_2", "setting.cell_difference_2", plain(ProtoField.uint16, "Cell difference, level 2", "Highest minus lowest cell too high, level 2, mV; 0x5E, D2 A0, 81 15B [seen by several]"))
  add("setting.temp_difference_1", "setting.temp_difference_1", plain(ProtoField.uint16, "Temperature difference, level 1", "Hottest minus coldest sensor too high, level 1, C, no offset; 0x5E byte 4, D2 A1, 81 15E [seen by several]"))
  add("setting.temp_difference_2", "setting.temp_difference_2", plain(ProtoField.uint16, "Temperature difference, level 2", "Hottest minus coldest sensor too high, level 2, C, no offset; 0x5E byte 5, D2 A2, 81 15F [seen by several]"))
  add("setting.balance_start", "setting.balance_start", plain(ProtoField.uint16, "Balancing from", "Cell voltage from which balancing may begin, mV; 0x5F bytes 0-1, D2 A3, 81 11A [seen by several]"))
  add("setting.balance_difference", "setting.balance_difference", plain(ProtoField.uint16, "Balancing from a difference of", "Difference of cells from which balancing may begin, mV; 0x5F bytes 2-3, D2 A4, 81 11B [seen by several]"))
  add("setting.short_circuit_current", "setting.short_circuit_current", plain(ProtoField.uint16, "Short circuit current", "Short circuit from this current on, A; 0x60 bytes 0-1, 81 16E [seen by several]"))
  add("setting.shunt_raw", "setting.shunt_raw", plain(ProtoField.uint16, "Shunt, raw", "Shunt, unit contradicted: micro-ohm or 0.001 mOhm; 0x60 bytes 2-3 [seen by several; unit contradicted]"))
  add("setting.mos_temp_high", "setting.mos_temp_high", plain(ProtoField.int16, "MOS temperature high", "MOS temperature too high, C, offset 40; D2 A8 [seen by several]"))

  -- Clock, boards, switches: 0x61 to 0x69; Modbus D2 A5 to D6, 81 100 to 12A.
  add("clock", "clock", text("Clock", "20YY-MM-DD hh:mm:ss; 0x61, write 0x21, D2 D4-D6, 81 61-63 and 123-125 [seen by several]"))
  add("setting.board_number", "setting.board_number", plain(ProtoField.uint16, "Board number", "Number of this board; 0x65 byte 0, 81 100 [seen once]"))
  add("setting.acquisition_units", "setting.acquisition_units", number("Acquisition units", "Acquisition units; 0x65 byte 1 [seen once]"))
  add("setting.heater_start", "setting.heater_start", plain(ProtoField.int16, "Heater from", "Heater starts at, C, offset 40; 0x66 byte 0 [seen once]"))
  add("setting.fan_start", "setting.fan_start", plain(ProtoField.int16, "Fan from", "Fan starts at, C, offset 40; 0x66 byte 2 [seen once]"))
  add("setting.key_logic", "setting.key_logic", hex(ProtoField.uint8, "Key logic", "What the key does: 55 nothing, A5 discharge and sleep, 5A discharge, AA both, A6 both and sleep; 0x66 byte 4, 81 120 [seen once]"))
  add("setting.balancer", "setting.balancer", boolean("Balancer", "Active balancer on; 0x67 byte 0, D2 CF, 81 119 [seen by several]"))
  add("setting.series_count", "setting.series_count", number("Cells in series", "Cells in series, as set for the balancer; 0x68 byte 0 [seen once]"))
  add("setting.balance_current_raw", "setting.balance_current_raw", plain(ProtoField.uint16, "Balance current, raw", "Balance current, unit not known; 0x68 bytes 1-2 [seen once]"))
  add("setting.balance_current", "setting.balance_current", plain(ProtoField.uint16, "Balance current, as set", "Current that the active balancer may take, mA; 81 117 [seen by two]"))
  add("setting.inverter", "setting.inverter", named("Inverter", NAMES.inverter, "Kind of inverter it speaks with; 0x69 byte 0 [seen once]"))
  add("setting.inverter_bus", "setting.inverter_bus", named("Inverter bus", NAMES.inverter_bus, "0 RS485, 1 CAN; 0x69 byte 1 [seen once]"))
  add("setting.mos_charge", "setting.mos_charge", boolean("Charge MOS switch", "Charge MOS as switched: on or off; 0xDA byte 0 (request and reply), D2 A5, 81 121, HKMS 182A [contradicted by the article, which has 00 for on; seen by several]"))
  add("setting.mos_discharge", "setting.mos_discharge", boolean("Discharge MOS switch", "Discharge MOS as switched: on or off; 0xD9 byte 0 (request and reply), D2 A6, 81 122, HKMS 182C [contradicted by the article, which has 00 for on; seen by several]"))
  add("setting.soc", "setting.soc", double("SOC to set", "State of charge to set, %; 0x21 bytes 6-7, D2 A7, 81 116, HKMS 161E and 181E [seen by several]"))
  add("command", "command", text("Command", "restart, shutdown, zero_current or reset: 0x00, D2 F0-F3; generated [seen by several]"))
  add("password", "password", text("Password", "Six characters that anybody can read; D2 C9-CB, 81 126-128 [seen by several]"))

  -- Alarm grid, 0x70 to 0x8A: nine classes, three levels.
  add("alarm.level", "alarm.level", number("Alarm level", "1 to 3; 0x70 to 0x8A [seen once]"))
  add("alarm.class", "alarm.class", text("Alarm class", "cell_high, cell_low, current, temp_high, temp_low, pack_high, pack_low, cell_difference, temp_difference; 0x70 to 0x8A [seen once]"))
  add("alarm.value", "alarm.value", double("Alarm from", "Alarm from this value on, mV, V or C by its class; bytes 0-1 [seen once]"))
  add("alarm.delay", "alarm.delay", double("Alarm delay", "Alarm after, s; bytes 2-3, 0.01 s [seen once]"))
  add("alarm.recovery", "alarm.recovery", double("Alarm until", "Alarm ends at this value, mV, V or C by its class; bytes 4-5 [seen once]"))
  add("alarm.recovery_delay", "alarm.recovery_delay", double("Recovery delay", "Alarm ends after, s; bytes 6-7, 0.01 s [seen once]"))
  add("alarm.discharge", "alarm.discharge", double("Discharge alarm from", "Discharge current, (raw - 30000) / 10, A; current class bytes 0-1 [seen once]"))
  add("alarm.discharge_delay", "alarm.discharge_delay", double("Discharge alarm delay", "Alarm after, s; current class bytes 2-3, 0.01 s [seen once]"))
  add("alarm.charge", "alarm.charge", double("Charge alarm from", "Charge current, (raw - 30000) / 10, A; current class bytes 4-5 [seen once]"))
  add("alarm.charge_delay", "alarm.charge_delay", double("Charge alarm delay", "Alarm after, s; current class bytes 6-7, 0.01 s [seen once]"))

  -- More of what a pack does: 0x99, 0xD8; Modbus 34 to 5E.
  add("balance.active", "balance.active", boolean("Balancing", "Balancer at work; 0x99 byte 0 [seen once]"))
  add("balance.current_raw", "balance.current_raw", plain(ProtoField.uint16, "Balance current, raw", "Balance current, offset 30000, scale not sure; 0x99 bytes 1-2 [seen once]"))
  add("balance.position", "balance.position", number("Balance position", "Cell that is balanced; 0x99 byte 3 [seen once]"))
  add("balance.state", "balance.state", plain(ProtoField.uint16, "Balance state", "0, 1, 2; D2 34, 81 4D, HKMS 040A byte 0 [seen by several]"))
  add("balance.current", "balance.current", plain(ProtoField.int32, "Balance current", "Balance current, raw - 30000, mA; D2 40, 81 4E, HKMS 040A bytes 2-3 [contradicted: one list has 0.1 A]"))
  add("wakeup.key", "wakeup.key", boolean("Woken by key", "0xD8 byte 0, HKMS 040B byte 2 bit 0 [seen by several]"))
  add("wakeup.button", "wakeup.button", boolean("Woken by button", "0xD8 byte 1, HKMS 040B byte 2 bit 1 [seen by several]"))
  add("wakeup.rs485", "wakeup.rs485", boolean("Woken by RS485", "0xD8 byte 2, HKMS 040B byte 2 bit 2 [seen by several]"))
  add("wakeup.can", "wakeup.can", boolean("Woken by CAN", "0xD8 byte 3, HKMS 040B byte 2 bit 3 [seen by several]"))
  add("wakeup.current", "wakeup.current", boolean("Woken by current", "Charge or discharge current; 0xD8 byte 4, HKMS 040B byte 2 bit 4 [seen by several]"))
  add("cell.average_voltage", "cell.average_voltage", plain(ProtoField.uint16, "Average cell voltage", "As the board says it, mV; D2 37, 81 57 [seen by several]"))
  add("cell.difference", "cell.difference", plain(ProtoField.uint16, "Cell difference", "Highest minus lowest cell, as the board says it, mV; D2 38, 81 42, HKMS 0404 bytes 6-7 [seen by several]"))
  add("temperature.difference", "temperature.difference", plain(ProtoField.uint16, "Temperature difference", "Hottest minus coldest sensor, as the board says it, C; 81 47, HKMS 0405 byte 4 [seen by several]"))
  add("power", "power", plain(ProtoField.uint16, "Power", "W; D2 39, 81 58, HKMS 0403 bytes 0-1 [seen by several]"))
  add("energy", "energy", plain(ProtoField.uint16, "Energy", "Wh; 81 59, HKMS 0403 bytes 2-3 [seen by several]"))
  add("temperature.mos", "temperature.mos", plain(ProtoField.int16, "MOS temperature", "C, offset 40; D2 42, 81 5A, HKMS 0403 byte 4 [seen by several]"))
  add("temperature.board", "temperature.board", plain(ProtoField.int16, "Board temperature", "C, offset 40; D2 43, 81 5B, HKMS 0403 byte 5 [seen by several]"))
  add("temperature.heater", "temperature.heater", plain(ProtoField.int16, "Heater temperature", "C, offset 40; 81 5C, HKMS 0403 byte 6 [seen by several]"))
  add("mos.precharge", "mos.precharge", boolean("Precharge MOS", "Precharge MOS on; 81 54, HKMS 0406 byte 2 [seen by several]"))
  add("heater", "heater", boolean("Heater", "Heater on; 81 55, HKMS 0406 byte 3 [seen by several]"))
  add("fan", "fan", boolean("Fan", "Fan on; 81 56, HKMS 0406 byte 4 [seen by several]"))
  add("heater.current", "heater.current", plain(ProtoField.uint8, "Heater current", "A; HKMS 0403 byte 7 [seen by several]"))
  add("soh", "soh", plain(ProtoField.uint16, "SOH", "State of health, %; HKMS 040D bytes 3-4 [seen by several]"))
  add("time_to_full", "time_to_full", plain(ProtoField.uint16, "Time to full", "Until charged, min; HKMS 040B bytes 0-1 [seen by several]"))
  add("uptime.total", "uptime.total", plain(ProtoField.uint32, "Uptime in all", "Time that the board has run in its life, s; 81 A9-AA [seen by several]"))
  add("uptime.since_start", "uptime.since_start", plain(ProtoField.uint32, "Uptime", "Time since the board was switched on, s; 81 AB-AC [seen by several]"))
  add("limit.active", "limit.active", boolean("Limiting", "Limiter of the charge current at work; HKMS 040D byte 0 [seen by several]"))
  add("limit.current", "limit.current", double("Limit current", "(raw - 30000) / 10, A; HKMS 040D bytes 1-2 [seen by several]"))
  add("limit.duty", "limit.duty", double("Limit duty", "Duty of the limiter's PWM, %; HKMS 040D bytes 5-6, 0.1 % [seen by several]"))
  add("mileage", "mileage", double("Remaining mileage", "km; 81 5E, 0.1 km [seen by several]"))
  add("software_version_sent", "software_version_sent", text("Software version, as sent", "As the bytes come, before they are put in order; D2 A9-B0 [seen by several]"))
  add("hardware_version_sent", "hardware_version_sent", text("Hardware version, as sent", "As the bytes come, before they are put in order; D2 B1-B8 [seen by several]"))
end

-- stylua: ignore end

return M
