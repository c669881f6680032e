-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- The registers of both Modbus dialects (docs/protocol.md d): what each holds.
--
--   { field's name, first register, registers, kind (daly_quantities), unit, SETS }
--
-- SETS marks settings: what a write would set, shown on writes too. The others are shown on replies to reads only. A
-- register that no line names shows its raw value and nothing else. Pure Lua, no Wireshark.

local quantities = require("daly_quantities")
local settings = require("daly_settings")

local M = {}

local byte, sub = string.byte, string.sub

local SETS = true

--- The highest value of a cell (FFFF is none) and of a sensor (of one byte, offset 40).
M.HIGHEST_CELL, M.HIGHEST_SENSOR = 0xFFFE, 0xFF

--- The last register that can be named.
M.LAST = 0xFFFF

-- stylua: ignore
local D2 = {
  { "pack.voltage",                    0x28, 1, "tenth", " V" },
  { "pack.current_raw",                0x29, 1, "number" },
  { "pack.current",                    0x29, 1, "current", " A" },
  { "soc",                             0x2A, 1, "tenth", " %" },
  { "cell.max_voltage",                0x2B, 1, "number", " mV" },
  { "cell.min_voltage",                0x2C, 1, "number", " mV" },
  { "temperature.max",                 0x2D, 1, "temperature", " C" },
  { "temperature.min",                 0x2E, 1, "temperature", " C" },
  { "state",                           0x2F, 1, "name" },
  { "remaining_capacity",              0x30, 1, "hundreds", " mAh" },
  { "cell_count",                      0x31, 1, "number" },
  { "sensor_count",                    0x32, 1, "number" },
  { "cycles",                          0x33, 1, "number" },
  { "balance.state",                   0x34, 1, "number" },
  { "mos.charge",                      0x35, 1, "switch" },
  { "mos.discharge",                   0x36, 1, "switch" },
  { "cell.average_voltage",            0x37, 1, "number", " mV" },
  { "cell.difference",                 0x38, 1, "number", " mV" },
  { "power",                           0x39, 1, "number", " W" },
  { "balance.current",                 0x40, 1, "offset", " mA" },
  { "temperature.mos",                 0x42, 1, "temperature", " C" },
  { "temperature.board",               0x43, 1, "temperature", " C" },
  { "setting.rated_capacity",          0x80, 1, "hundreds", " mAh", SETS },
  { "setting.cell_nominal_voltage",    0x81, 1, "number", " mV", SETS },
  { "setting.board_count",             0x82, 1, "number", nil, SETS },
  { "setting.cells_1",                 0x83, 1, "number", nil, SETS },
  { "setting.cells_2",                 0x84, 1, "number", nil, SETS },
  { "setting.cells_3",                 0x85, 1, "number", nil, SETS },
  { "setting.sensors_1",               0x86, 1, "number", nil, SETS },
  { "setting.sensors_2",               0x87, 1, "number", nil, SETS },
  { "setting.sensors_3",               0x88, 1, "number", nil, SETS },
  { "setting.battery_type",            0x89, 1, "name", nil, SETS },
  { "setting.sleep",                   0x8A, 1, "number", " s", SETS },
  { "setting.cell_high_1",             0x8B, 1, "number", " mV", SETS },
  { "setting.cell_high_2",             0x8C, 1, "number", " mV", SETS },
  { "setting.cell_low_1",              0x8D, 1, "number", " mV", SETS },
  { "setting.cell_low_2",              0x8E, 1, "number", " mV", SETS },
  { "setting.pack_high_1",             0x8F, 1, "tenth", " V", SETS },
  { "setting.pack_high_2",             0x90, 1, "tenth", " V", SETS },
  { "setting.pack_low_1",              0x91, 1, "tenth", " V", SETS },
  { "setting.pack_low_2",              0x92, 1, "tenth", " V", SETS },
  { "setting.charge_current_1",        0x93, 1, "current", " A", SETS },
  { "setting.charge_current_2",        0x94, 1, "current", " A", SETS },
  { "setting.discharge_current_1",     0x95, 1, "current", " A", SETS },
  { "setting.discharge_current_2",     0x96, 1, "current", " A", SETS },
  { "setting.charge_temp_high_1",      0x97, 1, "temperature", " C", SETS },
  { "setting.charge_temp_high_2",      0x98, 1, "temperature", " C", SETS },
  { "setting.charge_temp_low_1",       0x99, 1, "temperature", " C", SETS },
  { "setting.charge_temp_low_2",       0x9A, 1, "temperature", " C", SETS },
  { "setting.discharge_temp_high_1",   0x9B, 1, "temperature", " C", SETS },
  { "setting.discharge_temp_high_2",   0x9C, 1, "temperature", " C", SETS },
  { "setting.discharge_temp_low_1",    0x9D, 1, "temperature", " C", SETS },
  { "setting.discharge_temp_low_2",    0x9E, 1, "temperature", " C", SETS },
  { "setting.cell_difference_1",       0x9F, 1, "number", " mV", SETS },
  { "setting.cell_difference_2",       0xA0, 1, "number", " mV", SETS },
  { "setting.temp_difference_1",       0xA1, 1, "number", " C", SETS },
  { "setting.temp_difference_2",       0xA2, 1, "number", " C", SETS },
  { "setting.balance_start",           0xA3, 1, "number", " mV", SETS },
  { "setting.balance_difference",      0xA4, 1, "number", " mV", SETS },
  { "setting.mos_charge",              0xA5, 1, "switch", nil, SETS },
  { "setting.mos_discharge",           0xA6, 1, "switch", nil, SETS },
  { "setting.soc",                     0xA7, 1, "tenth", " %", SETS },
  { "setting.mos_temp_high",           0xA8, 1, "temperature", " C", SETS },
  { "software_version",                0xA9, 8, "reversed" },
  { "software_version_sent",           0xA9, 8, "text" },
  { "hardware_version",                0xB1, 8, "reversed" },
  { "hardware_version_sent",           0xB1, 8, "text" },
  { "battery_code",                    0xB9, 16, "text" },
  { "password",                        0xC9, 3, "text", nil, SETS },
  { "production_date",                 0xCC, 2, "date", nil, SETS },
  { "setting.balancer",                0xCF, 1, "switch", nil, SETS },
  { "clock",                           0xD4, 3, "clock", nil, SETS },
}

-- stylua: ignore
local R81 = {
  { "pack.voltage",                    0x38, 1, "tenth", " V" },
  { "pack.current_raw",                0x39, 1, "number" },
  { "pack.current",                    0x39, 1, "current", " A" },
  { "soc",                             0x3A, 1, "tenth", " %" },
  { "cell_count",                      0x3C, 1, "number" },
  { "sensor_count",                    0x3D, 1, "number" },
  { "cell.max_voltage",                0x3E, 1, "number", " mV" },
  { "cell.max_number",                 0x3F, 1, "number" },
  { "cell.min_voltage",                0x40, 1, "number", " mV" },
  { "cell.min_number",                 0x41, 1, "number" },
  { "cell.difference",                 0x42, 1, "number", " mV" },
  { "temperature.max",                 0x43, 1, "temperature", " C" },
  { "temperature.max_number",          0x44, 1, "number" },
  { "temperature.min",                 0x45, 1, "temperature", " C" },
  { "temperature.min_number",          0x46, 1, "number" },
  { "temperature.difference",          0x47, 1, "number", " C" },
  { "state",                           0x48, 1, "name" },
  { "remaining_capacity",              0x4B, 1, "hundreds", " mAh" },
  { "cycles",                          0x4C, 1, "number" },
  { "balance.state",                   0x4D, 1, "number" },
  { "balance.current",                 0x4E, 1, "offset", " mA" },
  { "mos.charge",                      0x52, 1, "switch" },
  { "mos.discharge",                   0x53, 1, "switch" },
  { "mos.precharge",                   0x54, 1, "switch" },
  { "heater",                          0x55, 1, "switch" },
  { "fan",                             0x56, 1, "switch" },
  { "cell.average_voltage",            0x57, 1, "number", " mV" },
  { "power",                           0x58, 1, "number", " W" },
  { "energy",                          0x59, 1, "number", " Wh" },
  { "temperature.mos",                 0x5A, 1, "temperature", " C" },
  { "temperature.board",               0x5B, 1, "temperature", " C" },
  { "temperature.heater",              0x5C, 1, "temperature", " C" },
  { "mileage",                         0x5E, 1, "tenth", " km" },
  { "clock",                           0x61, 3, "clock" },
  { "uptime.total",                    0xA9, 2, "number", " s" },
  { "uptime.since_start",              0xAB, 2, "number", " s" },
  { "setting.board_number",            0x100, 1, "number", nil, SETS },
  { "setting.rated_capacity",          0x109, 2, "number", " mAh", SETS },
  { "setting.cell_nominal_voltage",    0x114, 1, "number", " mV", SETS },
  { "setting.sleep",                   0x115, 1, "tens", " s", SETS },
  { "setting.soc",                     0x116, 1, "tenth", " %", SETS },
  { "setting.balance_current",         0x117, 1, "number", " mA", SETS },
  { "setting.balancer",                0x119, 1, "switch", nil, SETS },
  { "setting.balance_start",           0x11A, 1, "number", " mV", SETS },
  { "setting.balance_difference",      0x11B, 1, "number", " mV", SETS },
  { "setting.key_logic",               0x120, 1, "hex", nil, SETS },
  { "setting.mos_charge",              0x121, 1, "switch", nil, SETS },
  { "setting.mos_discharge",           0x122, 1, "switch", nil, SETS },
  { "clock",                           0x123, 3, "clock", nil, SETS },
  { "password",                        0x126, 3, "text", nil, SETS },
  { "production_date",                 0x129, 2, "date", nil, SETS },
  { "setting.cell_high_1",               0x130, 1, "number", " mV", SETS },
  { "setting.cell_high_2",               0x131, 1, "number", " mV", SETS },
  { "setting.cell_low_1",                0x134, 1, "number", " mV", SETS },
  { "setting.cell_low_2",                0x135, 1, "number", " mV", SETS },
  { "setting.pack_high_1",               0x138, 1, "tenth", " V", SETS },
  { "setting.pack_high_2",               0x139, 1, "tenth", " V", SETS },
  { "setting.pack_low_1",                0x13C, 1, "tenth", " V", SETS },
  { "setting.pack_low_2",                0x13D, 1, "tenth", " V", SETS },
  { "setting.charge_current_1",          0x140, 1, "current", " A", SETS },
  { "setting.charge_current_2",          0x141, 1, "current", " A", SETS },
  { "setting.discharge_current_1",       0x145, 1, "current", " A", SETS },
  { "setting.discharge_current_2",       0x146, 1, "current", " A", SETS },
  { "setting.charge_temp_high_1",        0x14A, 1, "temperature", " C", SETS },
  { "setting.charge_temp_high_2",        0x14B, 1, "temperature", " C", SETS },
  { "setting.charge_temp_low_1",         0x14E, 1, "temperature", " C", SETS },
  { "setting.charge_temp_low_2",         0x14F, 1, "temperature", " C", SETS },
  { "setting.discharge_temp_high_1",     0x152, 1, "temperature", " C", SETS },
  { "setting.discharge_temp_high_2",     0x153, 1, "temperature", " C", SETS },
  { "setting.discharge_temp_low_1",      0x156, 1, "temperature", " C", SETS },
  { "setting.discharge_temp_low_2",      0x157, 1, "temperature", " C", SETS },
  { "setting.cell_difference_1",         0x15A, 1, "number", " mV", SETS },
  { "setting.cell_difference_2",         0x15B, 1, "number", " mV", SETS },
  { "setting.temp_difference_1",         0x15E, 1, "number", " C", SETS },
  { "setting.temp_difference_2",         0x15F, 1, "number", " C", SETS },
  { "setting.soc_low_1",                 0x162, 1, "tenth", " %", SETS },
  { "setting.soc_low_2",                 0x163, 1, "tenth", " %", SETS },
  { "setting.short_circuit_current",   0x16E, 1, "number", " A", SETS },
  { "software_version",                0x178, 7, "text" },
  { "hardware_version",                0x17F, 7, "text" },
  { "serial_number",                   0x18D, 12, "text" },
  { "battery_code",                    0x199, 16, "text" },
}

-- What is a byte on other wires: none where the high byte is not 0.
local BYTES = {
  ["state"] = true,
  ["cell_count"] = true,
  ["sensor_count"] = true,
  ["cell.max_number"] = true,
  ["cell.min_number"] = true,
  ["temperature.max_number"] = true,
  ["temperature.min_number"] = true,
  ["setting.battery_type"] = true,
  ["setting.key_logic"] = true,
}

-- None where the register is 0.
-- Of temperatures 00FF is none either: no sensor.
local NOT_ZERO = {
  d2 = { ["temperature.mos"] = true, ["temperature.board"] = true, ["balance.current"] = true },
  ["81"] = {
    ["temperature.mos"] = true,
    ["temperature.board"] = true,
    ["temperature.heater"] = true,
    ["balance.current"] = true,
  },
}

local NAMES = { ["state"] = settings.NAMES.state, ["setting.battery_type"] = settings.NAMES.battery_type }

-- FF is padding in these, and no register that is not there.
local PADDED = { text = true, reversed = true }

local function map(dialect, list, more)
  more.at, more.sets, more.other_half, more.named = {}, {}, {}, {}
  for i = 1, #list do
    local name, register, count, kind, unit, sets = table.unpack(list[i], 1, 6)
    local entry = {
      name = name,
      register = register,
      count = count,
      kind = kind,
      read = quantities.read[kind],
      unit = unit,
      names = NAMES[name],
      small = BYTES[name] or kind == "temperature",
      not_zero = NOT_ZERO[dialect][name],
      sensor = NOT_ZERO[dialect][name] and kind == "temperature",
      padded = PADDED[kind],
      wide = count == 2 and kind == "number", -- half of it may well be FFFF
    }
    if entry.wide then
      more.other_half[register], more.other_half[register + 1] = register + 1, register
    end
    for place = register, register + count - 1 do
      more.named[place] = true
    end
    for _, index in ipairs({ more.at, sets and more.sets or {} }) do
      index[register] = index[register] or {}
      table.insert(index[register], entry)
    end
  end
  return more
end

-- Cells and sensors: { first register, last register, number of the first }.
M.MAPS = {
  d2 = map("d2", D2, {
    cells = { { 0x00, 0x1F, 1 }, { 0x47, 0x56, 33 } },
    sensors = { { 0x20, 0x27, 1 } },
    cell_count = 0x31,
    sensor_count = 0x32,
    voltage = 0x28,
    soc = 0x2A,
    state = 0x2F,
    charge = 0x35,
    discharge = 0x36,
    settings = 0x80, -- from here on
    faults = 0x3A, -- to 3D: low byte of the first is byte 0 of 0x98, its high byte byte 1, and so on
    commands = { [0xF0] = "restart", [0xF1] = "shutdown", [0xF2] = "zero_current", [0xF3] = "reset" },
  }),
  ["81"] = map("81", R81, {
    cells = { { 0x00, 0x2F, 1 } },
    sensors = { { 0x30, 0x37, 1 } },
    cell_count = 0x3C,
    sensor_count = 0x3D,
    voltage = 0x38,
    soc = 0x3A,
    state = 0x48,
    charge = 0x52,
    discharge = 0x53,
    settings = 0x100,
    commands = {},
  }),
}

--- The value of an entry whose first register stands at raw[at], or nil where it is none. `written`: a host writes it,
-- so FFFF is a value; in what a board tells it is a register that the board does not have.
function M.value(entry, raw, at, written)
  local count = entry.count
  if count == 1 then
    local high, low = byte(raw, at, at + 1)
    if
      (high == 0xFF and low == 0xFF and not written)
      or (entry.small and high ~= 0)
      or (entry.not_zero and high + low == 0)
      or (entry.sensor and low == 0xFF)
    then
      return nil
    end
  elseif entry.wide and not written then
    if sub(raw, at, at + 3) == "\xFF\xFF\xFF\xFF" then
      return nil
    end
  elseif not entry.padded and not written then
    for i = 0, count - 1 do
      if sub(raw, at + 2 * i, at + 2 * i + 1) == "\xFF\xFF" then
        return nil
      end
    end
  end
  return entry.read(raw, at, 2 * count)
end

--- Of a frame whose registers begin with `start`, at raw[at]: the value of one of its `count` registers, or nil where
-- it is not among them.
function M.register(raw, at, start, count, register)
  local place = register - start
  if place < 0 or place >= count then
    return nil
  end
  local high, low = byte(raw, at + 2 * place, at + 2 * place + 1)
  return high * 256 + low
end

--- Whether one of a frame's registers, as M.register has them, is none that the board has: it reads FFFF, and is not
-- half of a number. There are none behind FFFF, though a reply may have words for them.
function M.is_absent(known, raw, at, start, count, register)
  if register > M.LAST or M.register(raw, at, start, count, register) ~= 0xFFFF then
    return false
  end
  local other = known.other_half[register]
  return (other and M.register(raw, at, start, count, other) or 0xFFFF) == 0xFFFF
end

--- Whether a map says what a register holds, or what it is part of.
function M.is_named(known, register)
  local faults = known.faults
  return known.named[register]
    or M.number_of(known.cells, register) ~= nil
    or M.number_of(known.sensors, register) ~= nil
    or (faults ~= nil and register >= faults and register < faults + 4)
end

--- Which cell or sensor a register holds, by a map's `cells` or `sensors`; nil where it is none.
function M.number_of(ranges, register)
  for i = 1, #ranges do
    local range = ranges[i]
    if register >= range[1] and register <= range[2] then
      return register - range[1] + range[3]
    end
  end
  return nil
end

--- All `most` cells or sensors of a frame, in order; nil where one is not among its registers, or is none: FFFF, or
-- above `highest`.
function M.all(ranges, most, highest, raw, at, start, count)
  local list = {}
  for i = 1, #ranges do
    local range = ranges[i]
    for register = range[1], range[2] do
      local number = register - range[1] + range[3]
      if number > most then
        return list
      end
      local value = M.register(raw, at, start, count, register)
      if not value or value > highest then
        return nil
      end
      list[number] = value
    end
  end
  return #list == most and list or nil
end

--- The eight bytes of 0x98 in a frame's fault words, or nil.
function M.faults(known, raw, at, start, count)
  local first = known.faults
  if not first or first < start or first + 4 > start + count then
    return nil
  end
  local a, b, c, d, e, f, g, h = byte(raw, at + 2 * (first - start), at + 2 * (first - start) + 7)
  if a + b == 510 or c + d == 510 or e + f == 510 or g + h == 510 then
    return nil -- FFFF
  end
  return string.char(b, a, d, c, f, e, h, g)
end

return M
