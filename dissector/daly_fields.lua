-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Every field and expert note of the protocol. `tshark -G fields` prints what is written here: each description says
-- what the value is, its unit, and where that is known from ("V1.2": the paper Daly UART/485 V1.2; "field notes": what real
-- devices do, see docs/protocol.md).

local faults = require("daly_faults")
local data_ids = require("daly_data_ids")
local types = require("daly_field_types")

local M = {}

M.KINDS = { "frame", "bad_checksum", "short", "junk", "foreign", "event" }

local DIRECTION = { [1] = "Request", [2] = "Reply", [3] = "Echo" }
local CHECKSUM = { [0] = "Bad", [1] = "Good", [2] = "Unverified" }
local STATE = require("daly_settings").NAMES.state
local CHARGER = { [0] = "disconnected", [1] = "connected" }

M.STATE = STATE

-- How sure each is, behind its description in brackets: "documented" in the vendor's paper V1.2, "generated" by us, and, where
-- the field notes know more or otherwise:
for name, word in pairs({
  ["daly.address"] = "documented; more host addresses are seen by several",
  ["daly.pack.gather_voltage"] = "documented; 0 on every device seen",
  ["daly.pack.current"] = "documented; its sign is contradicted",
  ["daly.life"] = "documented; taken for cycles by some programs, wrongly",
  ["daly.charger"] = "documented; seen wrong by one",
  ["daly.cycles"] = "seen by several",
  ["daly.frame_number"] = "documented from 0, contradicted: from 1 on every device seen",
  ["daly.balance.mask"] = "documented; contradicted by boards with an active balancer",
  ["daly.balance.cell"] = "documented; contradicted by boards with an active balancer",
  ["daly.balance.active_cell"] = "seen by two",
  ["daly.fault.mos_off_by_command"] = "seen by several",
  ["daly.fault.charging_cabinet_offline"] = "another vendor paper, not seen",
  ["daly.text_part"] = "seen by several",
  ["daly.manufacturer"] = "seen once",
  ["daly.battery_name"] = "seen once",
  ["daly.battery_code"] = "seen by several",
  ["daly.software_version"] = "seen by several",
  ["daly.hardware_version"] = "seen by several",
  ["daly.serial_number"] = "seen once",
  ["daly.reserved"] = "seen by several",
  ["daly.undecoded"] = "as on the wire",
}) do
  types.SURE[name] = word
end

local declared = types.new()
local add, plain, hex, number, named = declared.add, types.plain, types.hex, types.number, types.named
local double, text, bytes, boolean, packet = types.double, types.text, types.bytes, types.boolean, types.packet
local u16, u32 = ProtoField.uint16, ProtoField.uint32

-- stylua: ignore start

-- Every record.
add("kind",           "kind",             text("Record",         "What the record is: frame, bad_checksum, short, junk, foreign, event; generated (docs/records.md)"))
add("transport",      "transport",        text("Transport",      "The medium: uart, can, ble, tcp; generated"))
add("dialect",        "dialect",          text("Dialect",        "a5 (also on CAN), hkms, d2 or 81: which of Daly's protocols; generated"))
add("undecoded",      "undecoded",        bytes("Bytes",         "Bytes that are shown as they are"))
add("foreign",        "foreign",          text("Foreign traffic", "Whose traffic it is: Modbus RTU of another address with right CRC, Sinowealth with right CRC-8, Pylontech RS485 and JBD with right sum, other frames on a CAN bus, the Bluetooth module's own; generated (docs/wires.md)"))
add("continued_in",   "continued_in",     packet("Continued in", frametype.NONE, "Packet in which the record that begins here ends; generated"))
add("began_in",       "began_in",         packet("Began in",     frametype.NONE, "Packet in which this record began; generated"))

-- Frame, V1.2 section 2.3.
add("start",          "start",            hex(ProtoField.uint8, "Start flag", "A5, fixed; V1.2 2.3"))
add("address",        "address",          hex(ProtoField.uint8, "Address",    "Request: who asks, 40 PC, 80 Bluetooth app, 20 GPRS, 41..4F PC to board 2..16; reply: board number; V1.2 2.2, field notes fact 3"))
add("data_id",        "data_id",          hex(ProtoField.uint8, "Data ID",    "What is asked or answered; V1.2 section 3", data_ids))
add("unknown_id",     "unknown_id",       boolean("Unknown data ID", "The data ID stands in no paper and no field note: its bytes are shown as they are; generated (docs/protocol.md)"))
add("length",         "length",           hex(ProtoField.uint8, "Data length", "Bytes of data, always 8; V1.2 2.3"))
add("data",           "data",             bytes("Data",          "The eight data bytes; V1.2 2.3"))
add("checksum",       "checksum",         hex(ProtoField.uint8, "Checksum",   "Low byte of the sum of all bytes before; V1.2 2.3 note 2"))
add("checksum_status", "checksum.status", named("Checksum status", CHECKSUM,  "0 Bad, 1 Good, 2 Unverified; generated"))

-- What the frame is to others, docs/records.md 5 to 7.
add("direction",      "direction",        named("Direction", DIRECTION,      "1 request (address 20 hex and up), 2 reply, 3 echo of a request; generated, field notes facts 3 and 4"))
add("board",          "board",            number("Board",                    "Board 1..16 that is asked or answers, absent when not known; generated, field notes b"))
add("retry",          "retry",            boolean("Retry",                   "The same request was sent before and is still unanswered; generated"))
add("request_in",     "request_in",       packet("Request in", frametype.REQUEST, "Packet of the request that this replies to; generated"))
add("reply_in",       "reply_in",         packet("Reply in", frametype.RESPONSE, "Packet of the first reply to this request, known in a second pass (-2); generated"))
add("unanswered",     "unanswered",       boolean("Unanswered",              "No reply came while the request waited, known in a second pass (-2); generated (docs/records.md 7)"))
add("unasked",        "unasked",          boolean("Unasked",                 "Reply that belongs to no request, on a bus where requests are seen; generated (docs/records.md 7)"))
add("late_to",        "late_to",          packet("Late reply to", frametype.REQUEST, "Packet of the request that this reply came too late for; generated (docs/records.md 7)"))
add("other_board",    "other_board",      boolean("Another board",           "Another board answers than the request names; generated (docs/records.md 7)"))
add("second_host",    "second_host",      boolean("Second host",             "Another host than the one before asks on the same bus, within the time a request waits; generated (docs/records.md 7)"))
add("write",          "write",            boolean("Write",                   "The request writes: 00 restart, D9, DA MOS switches, 10..2A settings; generated, field notes a.3"))
add("write_result",   "write_result",     text("Result of the write",        "What the reply says of the write: confirmed, denied or answered; generated (docs/records.md 10)"))
add("response_time",  "response_time",    double("Response time",            "From the request's last byte to the reply's first, s; generated from time stamps, position in the packet and baud rate"))

-- 0x90, V1.2 section 3.
add("pack_voltage",   "pack.voltage",     double("Pack voltage",             "Cumulative total voltage, V; V1.2 0x90 bytes 0-1, 0.1 V"))
add("gather_voltage", "pack.gather_voltage", double("Gather voltage",        "Gather total voltage, V; V1.2 0x90 bytes 2-3, 0.1 V; 0 on every device seen"))
add("current",        "pack.current",     double("Current",                  "Current as sent, (raw - 30000) / 10, A; V1.2 0x90 bytes 4-5; which sign is charging differs between boards, see daly.pack.state"))
add("current_raw",    "pack.current_raw", plain(u16, "Current, raw",         "Current as on the wire, offset 30000, 0.1 A; V1.2 0x90 bytes 4-5"))
add("soc",            "soc",              double("SOC",                      "State of charge, %; V1.2 0x90 bytes 6-7, 0.1 %"))
add("pack_state",     "pack.state",       named("State", STATE,              "State in the newest 0x93 of this board, beside the current whose sign does not tell it; 0 stationary, 1 charging, 2 discharging; generated"))

-- 0x91.
add("cell_max",       "cell.max_voltage", plain(u16, "Highest cell voltage", "Maximum cell voltage, mV; V1.2 0x91 bytes 0-1"))
add("cell_max_number", "cell.max_number", number("Highest cell",             "Number of the cell with the maximum voltage; V1.2 0x91 byte 2"))
add("cell_min",       "cell.min_voltage", plain(u16, "Lowest cell voltage",  "Minimum cell voltage, mV; V1.2 0x91 bytes 3-4"))
add("cell_min_number", "cell.min_number", number("Lowest cell",              "Number of the cell with the minimum voltage; V1.2 0x91 byte 5"))

-- 0x92.
add("temp_max",       "temperature.max",  plain(ProtoField.int16, "Highest temperature", "Maximum temperature, C; V1.2 0x92 byte 0, offset 40; -40 and 215 mean no sensor (field notes a.92)"))
add("temp_max_number", "temperature.max_number", number("Hottest sensor",    "Number of the sensor with the maximum temperature; V1.2 0x92 byte 1"))
add("temp_min",       "temperature.min",  plain(ProtoField.int16, "Lowest temperature", "Minimum temperature, C; V1.2 0x92 byte 2, offset 40"))
add("temp_min_number", "temperature.min_number", number("Coldest sensor",    "Number of the sensor with the minimum temperature; V1.2 0x92 byte 3"))

-- 0x93.
add("state",          "state",            named("State", STATE,              "0 stationary, 1 charging, 2 discharging; V1.2 0x93 byte 0"))
add("mos_charge",     "mos.charge",       boolean("Charge MOS",              "Charge MOS on; V1.2 0x93 byte 1"))
add("mos_discharge",  "mos.discharge",    boolean("Discharge MOS",           "Discharge MOS on; V1.2 0x93 byte 2"))
add("life",           "life",             number("Life",                     "BMS life, a counter that runs 0..255, not charge cycles; V1.2 0x93 byte 3"))
add("remaining",      "remaining_capacity", plain(u32, "Remaining capacity", "Remaining capacity, mAh; V1.2 0x93 bytes 4-7"))

-- 0x94.
add("cell_count",     "cell_count",       number("Cells",                    "Cells in series; V1.2 0x94 byte 0"))
add("sensor_count",   "sensor_count",     number("Temperature sensors",      "Temperature sensors; V1.2 0x94 byte 1"))
add("charger",        "charger",          named("Charger", CHARGER,          "0 disconnected, 1 connected; V1.2 0x94 byte 2; often 0 while charging (field notes a.94)"))
add("load",           "load",             named("Load", CHARGER,             "0 disconnected, 1 connected; V1.2 0x94 byte 3"))
for i = 1, 4 do
  add("di" .. i,      "di" .. i,          boolean("DI" .. i,                 "Input DI" .. i .. "; V1.2 0x94 byte 4 bit " .. (i - 1)))
end
for i = 1, 4 do
  add("do" .. i,      "do" .. i,          boolean("DO" .. i,                 "Output DO" .. i .. "; V1.2 0x94 byte 4 bit " .. (i + 3)))
end
add("cycles",         "cycles",           plain(u16, "Charge cycles",        "Charge cycles; 0x94 bytes 5-6: reserved in V1.2, cycles in V1.0 and in every driver (field notes a.94)"))

-- 0x95, 0x96.
add("frame_number",   "frame_number",     number("Frame number",             "Which frame of several; V1.2 0x95, 0x96 byte 0: from 0, FF invalid; every device seen counts from 1 (field notes fact 1)"))
add("cell_voltage",   "cell.voltage",     plain(u16, "Cell voltage",         "Voltage of one cell, mV, once per cell in order; V1.2 0x95 bytes 1-6"))
add("temperature",    "temperature",      plain(ProtoField.int16, "Temperature", "Temperature of one sensor, C, once per sensor in order; V1.2 0x96 bytes 1-7, offset 40; -40 and 215 mean no sensor"))
add("missing",        "burst.missing",    number("Missing frame",            "Number of a frame that is missing before this one; generated (docs/records.md 8)"))
add("again",          "burst.repeat",     boolean("Repeated frame",          "The burst had this frame number before; generated (docs/records.md 8)"))
add("cut_off",        "burst.cut_off",    boolean("Burst cut off",           "The burst ends here, before its last cell or sensor; known in a second pass (-2); generated (docs/records.md 8)"))
add("reassembled_in", "reassembled_in",   packet("Put together in", frametype.NONE, "Packet that has the whole table or text of this burst; generated (docs/records.md 8)"))
add("cells_voltage",  "cells.voltage",    plain(u16, "All cells",            "Voltages of all cells, mV, in order, in the record that completes the burst; generated from 0x95"))
add("cells_count",    "cells.count",      number("Number of cells",          "Cells in this table; generated from 0x95"))
add("cells_min",      "cells.min",        plain(u16, "Lowest",               "Lowest of all cells, mV; generated from 0x95"))
add("cells_max",      "cells.max",        plain(u16, "Highest",              "Highest of all cells, mV; generated from 0x95"))
add("cells_average",  "cells.average",    double("Average",                  "Average of all cells, mV; generated from 0x95"))
add("cells_spread",   "cells.spread",     plain(u16, "Spread",               "Highest minus lowest of all cells, mV; generated from 0x95"))
add("cells_min_number", "cells.min_number", number("Lowest cell",            "Number of the lowest of all cells, the first of equals; generated from 0x95"))
add("cells_max_number", "cells.max_number", number("Highest cell",           "Number of the highest of all cells, the first of equals; generated from 0x95"))
for i = 1, 48 do
  local two = string.format("%02d", i)
  add("cell." .. i,   "cell." .. two,     plain(u16, "Cell " .. i,           "Voltage of cell " .. i .. ", mV, in the record that has the table of all; generated from 0x95"))
end
add("sensors_temperature", "sensors.temperature", plain(ProtoField.int16, "All sensors", "Temperatures of all sensors, C, in order, in the record that completes the burst; -40 and 215 mean no sensor; generated from 0x96"))
add("sensors_count",  "sensors.count",    number("Number of sensors",        "Sensors in this table; generated from 0x96"))
add("sensors_min",    "sensors.min",      plain(ProtoField.int16, "Lowest",  "Lowest temperature of the sensors that are there, C; generated from 0x96"))
add("sensors_max",    "sensors.max",      plain(ProtoField.int16, "Highest", "Highest temperature of the sensors that are there, C; generated from 0x96"))
add("sensors_average", "sensors.average", double("Average",                  "Average of the sensors that are there, C; generated from 0x96"))
add("sensors_spread", "sensors.spread",   plain(u16, "Spread",               "Highest minus lowest temperature, C; generated from 0x96"))
add("sensors_min_number", "sensors.min_number", number("Coldest sensor",     "Number of the coldest sensor that is there, the first of equals; generated from 0x96"))
add("sensors_max_number", "sensors.max_number", number("Hottest sensor",     "Number of the hottest sensor that is there, the first of equals; generated from 0x96"))

-- Texts over several frames, field notes a.2.
add("text_part",      "text_part",        text("Part of a text",             "Bytes 1-7 of one frame of a text, other than 20..7E as ?; field notes a.2"))
add("text.55",        "manufacturer",     text("Manufacturer",               "Manufacturer, put together from the frames of 0x55; field notes a.2"))
add("text.56",        "battery_name",     text("Battery name",               "Battery name, put together from the frames of 0x56; field notes a.2"))
add("text.57",        "battery_code",     text("Battery code",               "Battery code or serial number, put together from the frames of 0x57; field notes a.2"))
add("text.62",        "software_version", text("Software version",           "Software version, put together from the frames of 0x62; field notes a.2"))
add("text.63",        "hardware_version", text("Hardware version",           "Hardware version, put together from the frames of 0x63; field notes a.2"))
add("text.6A",        "serial_number",    text("Serial number",              "Serial number, put together from the frames of 0x6A; field notes a.2"))

-- 0x97.
add("balance_mask",   "balance.mask",     hex(ProtoField.uint64, "Balance mask", "Bit 0 = cell 1: 0 closed, 1 open; V1.2 0x97 bits 0-47"))
add("balance_cell",   "balance.cell",     number("Balancing cell",           "Number of a cell whose bit is set in the mask; V1.2 0x97"))
add("balance_active", "balance.active_cell", number("Active balance cell",   "Byte 1 as boards with an active balancer mean it: number of the cell being balanced, 0 none; field notes a.97, not in V1.2"))

-- 0x98.
for _, bit in ipairs(faults.BITS) do
  local source = bit.state and "field notes a.98; reserved in V1.2" or "V1.2"
  add("fault." .. bit[3], "fault." .. bit[3], boolean(bit[4],                "1 error, 0 none; " .. source .. " 0x98 byte " .. bit[1] .. " bit " .. bit[2]))
end
add("fault_code",     "fault_code",       number("Fault code",               "Fault code, 0 none; V1.2 0x98 byte 7"))
add("fault_count",    "fault_count",      number("Faults",                   "How many of the paper's 48 fault bits are set; generated"))
add("fault_raised",   "fault_raised",     text("Raised",                     "Name of a bit that came since the last 0x98 of this board; generated"))
add("fault_cleared",  "fault_cleared",    text("Cleared",                    "Name of a bit that went since the last 0x98 of this board; generated"))

-- What changed since the record before of this kind, and what contradicts another; docs/records.md 9, 11.
add("changed",        "changed",          text("Changed",                    "What changed since the last 0x93 or 0x94 of this board: state, charge_mos, discharge_mos, cell_count, sensor_count, charger, load; generated"))
add("changed_from",   "changed_from",     packet("Changed since", frametype.NONE, "Packet of the record before of this kind of this board; generated"))
add("contradiction",  "contradiction",    text("Contradiction",              "What this record says otherwise than another of this board: pack_voltage, cell_max, cell_min, cell_number, temperature_max, temperature_min, sensor_number, soc; generated"))
add("contradicts",    "contradicts",      packet("Contradicts", frametype.NONE, "Packet of that other record; generated"))

add("reserved",       "reserved",         bytes("Reserved",                  "Reserved bytes and slots of no cell: stale bytes on many boards (field notes fact 2)"))

-- stylua: ignore end

require("daly_fields_settings").declare(add)
require("daly_fields_wires").declare(add)

M.fields = declared.fields
M.list = declared.list

-- stylua: ignore
M.experts = {
  bad_checksum = ProtoExpert.new("daly.checksum.bad", "Checksum is wrong", expert.group.CHECKSUM, expert.severity.ERROR),
  short = ProtoExpert.new("daly.short", "Frame is cut off", expert.group.MALFORMED, expert.severity.WARN),
  junk = ProtoExpert.new("daly.junk", "Bytes that are no frame", expert.group.UNDECODED, expert.severity.NOTE),
  echo = ProtoExpert.new("daly.echo", "Echo of the request: the BMS sleeps, or the adapter hears itself", expert.group.RESPONSE_CODE, expert.severity.NOTE),
  severe = ProtoExpert.new("daly.fault.severe", "Level 2 fault", expert.group.RESPONSE_CODE, expert.severity.WARN),
  missing = ProtoExpert.new("daly.burst.incomplete", "Frame missing in a burst", expert.group.SEQUENCE, expert.severity.WARN),
  cut_off = ProtoExpert.new("daly.burst.short", "Burst is cut off", expert.group.SEQUENCE, expert.severity.WARN),
  unanswered = ProtoExpert.new("daly.no_reply", "No reply", expert.group.SEQUENCE, expert.severity.WARN),
  unasked = ProtoExpert.new("daly.no_request", "Nobody asked for this reply, or the request was damaged", expert.group.SEQUENCE, expert.severity.NOTE),
  late = ProtoExpert.new("daly.late", "Late reply", expert.group.SEQUENCE, expert.severity.WARN),
  slow = ProtoExpert.new("daly.slow", "Slow reply", expert.group.SEQUENCE, expert.severity.NOTE),
  retry = ProtoExpert.new("daly.resent", "Request sent again, still unanswered", expert.group.SEQUENCE, expert.severity.NOTE),
  other_board = ProtoExpert.new("daly.wrong_board", "Another board answers than was asked", expert.group.PROTOCOL, expert.severity.WARN),
  second_host = ProtoExpert.new("daly.two_hosts", "Two hosts ask on this bus", expert.group.PROTOCOL, expert.severity.WARN),
  write = ProtoExpert.new("daly.writes", "Request that writes", expert.group.REQUEST_CODE, expert.severity.WARN),
  confirmed = ProtoExpert.new("daly.write.confirmed", "The board confirms the write", expert.group.RESPONSE_CODE, expert.severity.NOTE),
  denied = ProtoExpert.new("daly.write.denied", "The board denies the write", expert.group.RESPONSE_CODE, expert.severity.ERROR),
  raised = ProtoExpert.new("daly.fault.raised", "Fault raised", expert.group.RESPONSE_CODE, expert.severity.WARN),
  cleared = ProtoExpert.new("daly.fault.cleared", "Fault cleared", expert.group.RESPONSE_CODE, expert.severity.NOTE),
  changed = ProtoExpert.new("daly.switched", "State or switch changed", expert.group.RESPONSE_CODE, expert.severity.NOTE),
  contradiction = ProtoExpert.new("daly.contradictory", "Two records contradict each other", expert.group.PROTOCOL, expert.severity.NOTE),
  ambiguous = ProtoExpert.new("daly.modbus.several_requests", "Requests for different registers wait that this reply fits: its registers can't be named", expert.group.SEQUENCE, expert.severity.NOTE),
  exception = ProtoExpert.new("daly.modbus.refused", "The board refuses", expert.group.RESPONSE_CODE, expert.severity.WARN),
  cell_13 = ProtoExpert.new("daly.modbus.cell_13", "Register 000C is the switch in the example of the vendor's article; in truth it is the voltage of cell 13, and a write to it switches nothing. The switches are 00A5 and 00A6", expert.group.PROTOCOL, expert.severity.NOTE),
  again = ProtoExpert.new("daly.burst.repeated", "Frame repeated in a burst", expert.group.SEQUENCE, expert.severity.WARN),
}

return M
