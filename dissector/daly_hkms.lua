-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- HKMS dialect of CAN: what its registers hold (docs/protocol.md, c.2). All numbers of several bytes are big-endian,
-- but the balance mask.
--
--   register (13 bits) | destination | source       b0 b1 b2 b3 b4 b5 b6 b7

local fields = require("daly_fields").fields
local STATE = require("daly_fields").STATE
local experts = require("daly_fields").experts
local classic = require("daly_can_classic")
local faults = require("daly_faults")
local hkms_bus = require("daly_hkms_bus")
local view = require("daly_view")

local M = {}

local byte, format, floor, concat = string.byte, string.format, math.floor, table.concat
local out = view.out

local function u16(data, first)
  local high, low = byte(data, first + 1, first + 2)
  return high * 256 + low
end

local function on(value)
  return value ~= 0 and "on" or "off"
end

local names = hkms_bus.NAMES

-- By register: show(data) adds the fields, words(data) returns the words. Both are for frames of `from` bytes at least:
-- bytes behind those may be missing.
local show, words = {}, {}
local from = {
  [0x0402] = 6,
  [0x0403] = 6,
  [0x0404] = 8,
  [0x0405] = 4,
  [0x0406] = 3,
  [0x0407] = 1,
  [0x0408] = 8,
  [0x0409] = 8,
  [0x040A] = 8,
  [0x040B] = 2,
  [0x040D] = 7,
  [0x040E] = 8,
}

-- 0402: voltage.2 current.2 soc.2 life.1
show[0x0402] = function(data)
  out.value(fields.pack_voltage, 0, 2, u16(data, 0) / 10, " V")
  out.value(fields.current, 2, 2, (u16(data, 2) - 30000) / 10, " A")
  out.bytes(fields.current_raw, 2, 2)
  out.value(fields.soc, 4, 2, u16(data, 4) / 10, " %")
  if #data >= 7 then
    out.bytes(fields.life, 6, 1)
  end
end

words[0x0402] = function(data)
  return format("%.1f V  %.1f A  SOC %.1f %%", u16(data, 0) / 10, (u16(data, 2) - 30000) / 10, u16(data, 4) / 10)
end

-- 0403: power.2 energy.2 mos_temperature.1 board_temperature.1 heater_temperature.1 heater_current.1
show[0x0403] = function(data)
  out.bytes(fields["power"], 0, 2, " W")
  out.bytes(fields["energy"], 2, 2, " Wh")
  out.value(fields["temperature.mos"], 4, 1, byte(data, 5) - 40, " C")
  out.value(fields["temperature.board"], 5, 1, byte(data, 6) - 40, " C")
  if #data >= 7 then
    out.value(fields["temperature.heater"], 6, 1, byte(data, 7) - 40, " C")
  end
  if #data >= 8 then
    out.bytes(fields["heater.current"], 7, 1, " A")
  end
end

words[0x0403] = function(data)
  return format("%d W  %d Wh  MOS %d C  board %d C", u16(data, 0), u16(data, 2), byte(data, 5) - 40, byte(data, 6) - 40)
end

-- 0404: max.2 number.1 min.2 number.1 difference.2
show[0x0404] = function()
  out.bytes(fields.cell_max, 0, 2, " mV")
  out.bytes(fields.cell_max_number, 2, 1)
  out.bytes(fields.cell_min, 3, 2, " mV")
  out.bytes(fields.cell_min_number, 5, 1)
  out.bytes(fields["cell.difference"], 6, 2, " mV")
end

words[0x0404] = function(data)
  return format(
    "max %d mV (cell %d)  min %d mV (cell %d)  difference %d mV",
    u16(data, 0),
    byte(data, 3),
    u16(data, 3),
    byte(data, 6),
    u16(data, 6)
  )
end

-- 0405: max.1 number.1 min.1 number.1 difference.1
show[0x0405] = function(data)
  out.value(fields.temp_max, 0, 1, byte(data, 1) - 40, " C")
  out.bytes(fields.temp_max_number, 1, 1)
  out.value(fields.temp_min, 2, 1, byte(data, 3) - 40, " C")
  out.bytes(fields.temp_min_number, 3, 1)
  if #data >= 5 then
    out.bytes(fields["temperature.difference"], 4, 1, " C")
  end
end

words[0x0405] = function(data)
  local max, hottest, min, coldest = byte(data, 1, 4)
  return format("max %d C (sensor %d)  min %d C (sensor %d)", max - 40, hottest, min - 40, coldest)
end

-- 0406: charge.1 discharge.1 precharge.1 heater.1 fan.1
show[0x0406] = function(data)
  local charge, discharge, precharge, heater, fan = byte(data, 1, 5)
  out.value(fields.mos_charge, 0, 1, charge ~= 0)
  out.value(fields.mos_discharge, 1, 1, discharge ~= 0)
  out.value(fields["mos.precharge"], 2, 1, precharge ~= 0)
  if heater then
    out.value(fields["heater"], 3, 1, heater ~= 0)
  end
  if fan then
    out.value(fields["fan"], 4, 1, fan ~= 0)
  end
end

words[0x0406] = function(data)
  local charge, discharge, precharge = byte(data, 1, 3)
  return format("charge MOS %s  discharge MOS %s  precharge MOS %s", on(charge), on(discharge), on(precharge))
end

-- 0407: state.1 charger.1 load.1
show[0x0407] = function(data)
  out.bytes(fields.state, 0, 1)
  if #data >= 2 then
    out.bytes(fields.charger, 1, 1)
  end
  if #data >= 3 then
    out.bytes(fields.load, 2, 1)
  end
end

words[0x0407] = function(data)
  local state = byte(data)
  return STATE[state] or format("state %d", state)
end

-- 0408: cells.1 sensors.1 remaining.4 cycles.2
show[0x0408] = function()
  out.bytes(fields.cell_count, 0, 1)
  out.bytes(fields.sensor_count, 1, 1)
  out.bytes(fields.remaining, 2, 4, " mAh")
  out.bytes(fields.cycles, 6, 2)
end

words[0x0408] = function(data)
  local cells, sensors = byte(data, 1, 2)
  local remaining = u16(data, 2) * 65536 + u16(data, 4)
  return format("%d cells  %d sensors  remaining %.0f mAh  %d cycles", cells, sensors, remaining, u16(data, 6))
end

-- 0409: faults, of which most are those of 0x98. The others: byte, bit, name.
local MORE_FAULTS = {
  { 3, 4, "mos_temp_high_level_1" },
  { 3, 5, "mos_temp_high_level_2" },
  { 3, 6, "board_temp_high_level_1" },
  { 3, 7, "board_temp_high_level_2" },
  { 6, 6, "thermal_runaway" },
  { 6, 7, "heating" },
  { 7, 0, "balance_communication" },
  { 7, 1, "balance_condition" },
}

show[0x0409] = function(data)
  for _, bits in ipairs({ faults.BITS, MORE_FAULTS }) do
    for i = 1, #bits do
      out.value(fields["fault." .. bits[i][3]], bits[i][1], 1, faults.is_set(data, 1, bits[i]))
    end
  end
end

words[0x0409] = function(data)
  local set = {}
  for _, bits in ipairs({ faults.BITS, MORE_FAULTS }) do
    for i = 1, #bits do
      if faults.is_set(data, 1, bits[i]) then
        set[#set + 1] = bits[i][3]
      end
    end
  end
  return #set > 0 and concat(set, ", ") or "none"
end

-- The cells of a mask of 32 bits, bit 0 of its first byte is cell 1: { byte, cell, byte, cell, ... }.
local function balancing(data)
  local list = {}
  for i = 0, 3 do
    local bits = byte(data, 5 + i)
    for k = 0, 7 do
      if floor(bits / 2 ^ k) % 2 == 1 then
        list[#list + 1] = 4 + i
        list[#list + 1] = 8 * i + k + 1
      end
    end
  end
  return list
end

-- 040A: state.1 -.1 current.2 mask.4 (little-endian)
show[0x040A] = function(data)
  out.value(fields["balance.state"], 0, 1, byte(data, 1))
  out.value(fields["balance.current"], 2, 2, u16(data, 2) - 30000, " mA")
  out.little(fields.balance_mask, 4, 4)
  local cells = balancing(data)
  for i = 1, #cells, 2 do
    out.value(fields.balance_cell, cells[i], 1, cells[i + 1])
  end
end

words[0x040A] = function(data)
  local cells, list = balancing(data), {}
  for i = 2, #cells, 2 do
    list[#list + 1] = format("%d", cells[i])
  end
  return format(
    "state %d  %d mA  %s",
    byte(data, 1),
    u16(data, 2) - 30000,
    #list > 0 and "cells " .. concat(list, " ") or "no cell"
  )
end

local WAKEUPS = { "key", "button", "rs485", "can", "current" } -- bits 0 to 4

-- 040B: minutes.2 wakeup.1
show[0x040B] = function(data)
  out.bytes(fields["time_to_full"], 0, 2, " min")
  local bits = byte(data, 3)
  for i = 1, bits and #WAKEUPS or 0 do
    out.value(fields["wakeup." .. WAKEUPS[i]], 2, 1, floor(bits / 2 ^ (i - 1)) % 2 == 1)
  end
end

words[0x040B] = function(data)
  local bits, list = byte(data, 3) or 0, {}
  for i = 1, #WAKEUPS do
    if floor(bits / 2 ^ (i - 1)) % 2 == 1 then
      list[#list + 1] = WAKEUPS[i]
    end
  end
  return format("full in %d min", u16(data, 0)) .. (#list > 0 and "  woken by " .. concat(list, ", ") or "")
end

-- 040D: active.1 current.2 soh.2 duty.2
show[0x040D] = function(data)
  out.value(fields["limit.active"], 0, 1, byte(data) ~= 0)
  out.value(fields["limit.current"], 1, 2, (u16(data, 1) - 30000) / 10, " A")
  out.bytes(fields["soh"], 3, 2, " %")
  out.value(fields["limit.duty"], 5, 2, u16(data, 5) / 10, " %")
end

words[0x040D] = function(data)
  return format(
    "limiter %s  %.1f A  duty %.1f %%  SOH %d %%",
    on(byte(data)),
    (u16(data, 1) - 30000) / 10,
    u16(data, 5) / 10,
    u16(data, 3)
  )
end

-- 040E: page.1, then seven bytes of the fault block. Of its bytes 0 to 7: bits 0-2, bits 3-5 (levels), bit 6, bit 7.
-- stylua: ignore
local LEVELS = {
  [0] = { "cell_high",           "cell_low",            false,                   "smart_charger" },
  [1] = { "cell_difference",     "charge_temp_high",    false,                   "smart_discharger" },
  [2] = { "charge_temp_low",     "discharge_temp_high", "chg_mos_temp_high",     "chg_mos_temp_sensor" },
  [3] = { "discharge_temp_low",  "temp_difference",     "dischg_mos_temp_high",  "dischg_mos_temp_sensor" },
  [4] = { "pack_high",           "pack_low",            "short_circuit_protect", false },
  [5] = { "charge_current",      "discharge_current",   "charge_undervoltage",   "discharge_overvoltage" },
  [6] = { "soc_low",             "soh_low",             false,                   "parallel_communication" },
  [7] = { "mos_temp_high",       "thermal_runaway",     false,                   false },
}

-- Of its bytes 11 to 13: bits 0 to 7.
-- stylua: ignore
local FAULTS = {
  [11] = { "afe_collect_chip", "afe_communication", "afe_sampling", "voltage_detect",
           "voltage_collect_dropped", "sum_voltage_detect", "current_module", "cell_temp_sensor" },
  [12] = { "cell_temp_disconnected", "eeprom", "flash", "rtc", "chg_mos", "dischg_mos", "precharge_mos", "precharge" },
  [13] = { false, false, false, false, false, false, false, "heating" },
}

-- What a page of the block says: { data byte, "level." or "fault." and name, value, ... }, nil: there is no such page.
local function block(data)
  local page = byte(data)
  if page ~= 1 and page ~= 2 then
    return nil
  end
  local list = {}
  local function add(at, name, value)
    local n = #list
    list[n + 1], list[n + 2], list[n + 3] = at, name, value
  end
  for at = 1, 7 do
    local bits = byte(data, at + 1)
    local place = 7 * (page - 1) + at - 1
    local levels, bools = LEVELS[place], FAULTS[place]
    if levels then
      add(at, "level." .. levels[1], bits % 8)
      add(at, "level." .. levels[2], floor(bits / 8) % 8)
      for i = 6, 7 do
        if levels[i - 3] then
          add(at, "fault." .. levels[i - 3], floor(bits / 2 ^ i) % 2 == 1)
        end
      end
    elseif bools then
      for i = 0, 7 do
        if bools[i + 1] then
          add(at, "fault." .. bools[i + 1], floor(bits / 2 ^ i) % 2 == 1)
        end
      end
    end
  end
  return list
end

show[0x040E] = function(data)
  out.bytes(fields.frame_number, 0, 1)
  local list = block(data)
  for i = 1, list and #list or 0, 3 do
    out.value(fields[list[i + 1]], list[i], 1, list[i + 2])
  end
end

words[0x040E] = function(data)
  local list, set = block(data), {}
  for i = 1, list and #list or 0, 3 do
    local name, value = list[i + 1], list[i + 2]
    if value == true then
      set[#set + 1] = name:sub(7)
    elseif value ~= false and value > 0 then
      set[#set + 1] = format("%s level %d", name:sub(7), value)
    end
  end
  return format("page %d  %s", byte(data), #set > 0 and concat(set, ", ") or list and "none" or "")
end

-- Writes: value.2
local function show_switch(field)
  return function(data)
    out.value(field, 0, 2, u16(data, 0) ~= 0)
  end
end

local function switch_words(what)
  return function(data)
    return format("switches the %s %s", what, on(u16(data, 0)))
  end
end

show[0x182A], words[0x182A] = show_switch(fields["setting.mos_charge"]), switch_words("charge MOS")
show[0x182C], words[0x182C] = show_switch(fields["setting.mos_discharge"]), switch_words("discharge MOS")

for _, register in ipairs({ 0x161E, 0x181E }) do
  show[register] = function(data)
    out.value(fields["setting.soc"], 0, 2, u16(data, 0) / 10, " %")
  end
  words[register] = function(data)
    return format("sets SOC to %.1f %%", u16(data, 0) / 10)
  end
end

-- The frame at hand.
local shape, remote

local function who(at_hand)
  if at_hand.keep_alive then
    return "Host 0x80", "All boards"
  elseif at_hand.writes then
    return view.host_name(at_hand.source), format("Board %d", at_hand.destination)
  end
  return format("Board %d", at_hand.source), "Host"
end

local function show_head(length)
  out.made(fields.dialect, "hkms")
  out.made(fields["can.register"], shape.register)
  classic.show_head(shape, length, remote)
end

-- Cells and sensors, which look as 0x95 and 0x96 do.
local as_a5 = {}

function as_a5.names()
  return format("Board %d  0x%04X %s: ", shape.source, shape.register, names[shape.register]), who(shape)
end

function as_a5.board()
  return shape.source
end

function as_a5.show()
  show_head(8)
end

-- Whether a frame looks as one of a data ID does.
local function is_as_a5(frame)
  return hkms_bus.AS_A5[frame.shape.register] and frame.length == 8 and not frame.shape.keep_alive
end

--- The bytes of a frame for daly_stat.
function M.counted(frame)
  local of = frame.shape
  if is_as_a5(frame) then
    return hkms_bus.as_a5(of, frame.raw)
  end
  return hkms_bus.counted(of.register, of.keep_alive and 0 or of.board or 0, frame.raw)
end

--- For daly_view.one. `frame`: { raw = its bytes, shape =, slot =, remote =, length = }.
function M.show(item, frame, wanted)
  shape, remote = frame.shape, frame.remote
  local data, length = frame.raw, frame.length
  local register = shape.register
  if is_as_a5(frame) then
    return view.a5_on(item, hkms_bus.as_a5(shape, data), frame.slot, as_a5)
  end
  local source, destination = who(shape)
  if wanted then
    show_head(length)
    out.made(fields.direction, (shape.writes or shape.keep_alive) and 1 or 2)
    if shape.board then
      out.made(fields.board, shape.board)
    end
    if shape.writes then
      out.made(fields.write, true)
    end
  end
  if shape.keep_alive then
    return "Keep-alive", source, destination
  end
  local enough = length >= (shape.writes and 2 or from[register] or 9)
  if wanted and enough and show[register] then
    show[register](data)
  end
  local said = enough and words[register] and words[register](data) or view.hex_words(data, 1, length)
  local text = format("0x%04X %s", register, names[register])
  if shape.writes then
    out.note(item, experts.write, "WRITE: " .. said)
    return format("WRITE board %d  %s: %s", shape.destination, text, said), source, destination
  end
  return format("Board %d  %s: %s", shape.source, text, said), source, destination
end

return M
