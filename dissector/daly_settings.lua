-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Data IDs beyond the paper's 0x90 to 0x98: settings, clock, alarms and what else boards tell, and writes
-- (docs/protocol.md a.2, a.3). Each is a list of the values in its eight bytes:
--
--   { field's name, first byte, bytes, kind (daly_quantities), unit, names of a kind "name" }
--
-- Bytes that no line names are shown as they are, and not guessed at. Pure Lua, no Wireshark.

local M = {}

--- Names of values, by field.
M.NAMES = {
  state = { [0] = "stationary", [1] = "charging", [2] = "discharging" },
  battery_type = { [0] = "LFP", [1] = "ternary", [2] = "LTO" },
  operating_mode = { [1] = "long press", [2] = "short press" },
  inverter = {
    [0] = "none",
    [1] = "Pylon",
    [2] = "Growatt",
    [3] = "Sofar",
    [4] = "Voltronic",
    [5] = "GoodWe",
    [6] = "SRNE",
    [7] = "MUST",
    [8] = "Victron",
  },
  inverter_bus = { [0] = "RS485", [1] = "CAN" },
}
local NAMES = M.NAMES

-- stylua: ignore
local READS = {
  [0x50] = {
    { "setting.rated_capacity",         0, 4, "number", " mAh" },
    { "setting.cell_nominal_voltage",   6, 2, "number", " mV" }, -- some have 4 bytes; with others than 00 no voltage
  },
  [0x51] = {
    { "setting.board_count",            0, 1, "number" },
    { "setting.cells_1",                1, 1, "number" },
    { "setting.cells_2",                2, 1, "number" },
    { "setting.cells_3",                3, 1, "number" },
    { "setting.sensors_1",              4, 1, "number" },
    { "setting.sensors_2",              5, 1, "number" },
    { "setting.sensors_3",              6, 1, "number" },
  },
  [0x52] = {
    { "total.charged",                  0, 4, "number", " Ah" },
    { "total.discharged",               4, 4, "number", " Ah" },
  },
  [0x53] = {
    { "setting.battery_type",           0, 1, "name", nil, NAMES.battery_type },
    { "setting.operating_mode",         1, 1, "name", nil, NAMES.operating_mode },
    { "production_date",                2, 3, "date" },
    { "setting.sleep",                  5, 2, "number", " s" },
    { "setting.current_drift",          7, 1, "tenth", " A" },
  },
  [0x54] = {
    { "firmware_index",                 0, 8, "text" },
  },
  [0x58] = {},
  [0x59] = {
    { "setting.cell_high_1",            0, 2, "number", " mV" },
    { "setting.cell_high_2",            2, 2, "number", " mV" },
    { "setting.cell_low_1",             4, 2, "number", " mV" },
    { "setting.cell_low_2",             6, 2, "number", " mV" },
  },
  [0x5A] = {
    { "setting.pack_high_1",            0, 2, "tenth", " V" },
    { "setting.pack_high_2",            2, 2, "tenth", " V" },
    { "setting.pack_low_1",             4, 2, "tenth", " V" },
    { "setting.pack_low_2",             6, 2, "tenth", " V" },
  },
  [0x5B] = {
    { "setting.charge_current_1",       0, 2, "current", " A" },
    { "setting.charge_current_2",       2, 2, "current", " A" },
    { "setting.discharge_current_1",    4, 2, "current", " A" },
    { "setting.discharge_current_2",    6, 2, "current", " A" },
  },
  [0x5C] = {
    { "setting.charge_temp_high_1",     0, 1, "temperature", " C" },
    { "setting.charge_temp_high_2",     1, 1, "temperature", " C" },
    { "setting.charge_temp_low_1",      2, 1, "temperature", " C" },
    { "setting.charge_temp_low_2",      3, 1, "temperature", " C" },
    { "setting.discharge_temp_high_1",  4, 1, "temperature", " C" },
    { "setting.discharge_temp_high_2",  5, 1, "temperature", " C" },
    { "setting.discharge_temp_low_1",   6, 1, "temperature", " C" },
    { "setting.discharge_temp_low_2",   7, 1, "temperature", " C" },
  },
  [0x5D] = {
    { "setting.soc_high_1",             0, 2, "tenth", " %" },
    { "setting.soc_high_2",             2, 2, "tenth", " %" },
    { "setting.soc_low_1",              4, 2, "tenth", " %" },
    { "setting.soc_low_2",              6, 2, "tenth", " %" },
  },
  [0x5E] = {
    { "setting.cell_difference_1",      0, 2, "number", " mV" },
    { "setting.cell_difference_2",      2, 2, "number", " mV" },
    { "setting.temp_difference_1",      4, 1, "number", " C" },
    { "setting.temp_difference_2",      5, 1, "number", " C" },
  },
  [0x5F] = {
    { "setting.balance_start",          0, 2, "number", " mV" },
    { "setting.balance_difference",     2, 2, "number", " mV" },
  },
  [0x60] = {
    { "setting.short_circuit_current",  0, 2, "number", " A" },
    { "setting.shunt_raw",              2, 2, "number" },
  },
  [0x61] = {
    { "clock",                          0, 6, "clock" },
  },
  [0x64] = {},
  [0x65] = {
    { "setting.board_number",           0, 1, "number" },
    { "setting.acquisition_units",      1, 1, "number" },
  },
  [0x66] = {
    { "setting.heater_start",           0, 1, "temperature", " C" },
    { "setting.fan_start",              2, 1, "temperature", " C" },
    { "setting.key_logic",              4, 1, "hex" },
  },
  [0x67] = {
    { "setting.balancer",               0, 1, "switch" },
  },
  [0x68] = {
    { "setting.series_count",           0, 1, "number" },
    { "setting.balance_current_raw",    1, 2, "number" },
  },
  [0x69] = {
    { "setting.inverter",               0, 1, "name", nil, NAMES.inverter },
    { "setting.inverter_bus",           1, 1, "name", nil, NAMES.inverter_bus },
  },
  [0x99] = {
    { "balance.active",                 0, 1, "switch" },
    { "balance.current_raw",            1, 2, "number" },
    { "balance.position",               3, 1, "number" },
  },
  [0x9A] = {},
  [0xD8] = {
    { "wakeup.key",                     0, 1, "switch" },
    { "wakeup.button",                  1, 1, "switch" },
    { "wakeup.rs485",                   2, 1, "switch" },
    { "wakeup.can",                     3, 1, "switch" },
    { "wakeup.current",                 4, 1, "switch" },
  },
  -- The reply to a write of a switch carries the new state, and stale bytes.
  [0xD9] = {
    { "setting.mos_discharge",          0, 1, "switch" },
  },
  [0xDA] = {
    { "setting.mos_charge",             0, 1, "switch" },
  },
}

-- The alarm grid: ID = 70 + 9 x (level - 1) + class.
local CLASSES = {
  [0] = "cell_high",
  "cell_low",
  "current",
  "temp_high",
  "temp_low",
  "pack_high",
  "pack_low",
  "cell_difference",
  "temp_difference",
}
local ALARM_FIRST, ALARM_LAST = 0x70, 0x8A

-- Kind and unit of a class's values.
local ALARM_VALUES = {
  cell_high = { "double", " mV" },
  cell_low = { "double", " mV" },
  pack_high = { "tenth", " V" },
  pack_low = { "tenth", " V" },
  cell_difference = { "double", " mV" },
  temp_difference = { "double", " C" },
}

--- Level and class of an ID of the alarm grid, or nil.
function M.alarm(id)
  if id < ALARM_FIRST or id > ALARM_LAST then
    return nil
  end
  local class = (id - ALARM_FIRST) % 9
  return math.floor((id - ALARM_FIRST) / 9) + 1, CLASSES[class]
end

for id = ALARM_FIRST, ALARM_LAST do
  local _, class = M.alarm(id)
  local value = ALARM_VALUES[class]
  if class == "current" then
    READS[id] = {
      { "alarm.discharge", 0, 2, "current", " A" },
      { "alarm.discharge_delay", 2, 2, "hundredth", " s" },
      { "alarm.charge", 4, 2, "current", " A" },
      { "alarm.charge_delay", 6, 2, "hundredth", " s" },
    }
  elseif value then
    READS[id] = {
      { "alarm.value", 0, 2, value[1], value[2] },
      { "alarm.delay", 2, 2, "hundredth", " s" },
      { "alarm.recovery", 4, 2, value[1], value[2] },
      { "alarm.recovery_delay", 6, 2, "hundredth", " s" },
    }
  else
    READS[id] = {} -- temperatures: u8 pairs of unknown meaning
  end
end

--- What a reply with this ID holds: a list as above, or nil.
M.READS = READS

-- What a request that writes would set: write = read - 40; a clock that is all zero is none.
local WRITES = {
  [0x21] = { { "clock", 0, 6, "clock" }, { "setting.soc", 6, 2, "tenth", " %" } },
  [0xD9] = READS[0xD9],
  [0xDA] = READS[0xDA],
}
for id = 0x10, 0x2A do
  WRITES[id] = WRITES[id] or READS[id + 0x40] or {}
end

--- What a request with this ID would set: a list as above, or nil.
M.WRITES = WRITES

--- What a request does that sets nothing: `daly.command`.
M.COMMANDS = { [0x00] = "restart" }

return M
