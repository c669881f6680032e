-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Data ID 0x98, battery failure status: 0 no error, 1 error (paper, section 3). Pure Lua, no Wireshark.
--
-- Byte 6 bits 4 and 5 are reserved in the paper; field notes a.1 tell what they are. They are states, not failures.

local M = {}

-- stylua: ignore
M.BITS = {
  -- byte, bit, name,                          text                                      text of the paper
  { 0, 0, "cell_volt_high_level_1",       "Cell voltage high, level 1" },           -- Cell volt high level 1
  { 0, 1, "cell_volt_high_level_2",       "Cell voltage high, level 2" },           -- Cell volt high level 2
  { 0, 2, "cell_volt_low_level_1",        "Cell voltage low, level 1" },            -- Cell volt low level 1
  { 0, 3, "cell_volt_low_level_2",        "Cell voltage low, level 2" },            -- Cell volt low level 2
  { 0, 4, "sum_volt_high_level_1",        "Pack voltage high, level 1" },           -- Sum volt high level 1
  { 0, 5, "sum_volt_high_level_2",        "Pack voltage high, level 2" },           -- Sum volt high level 2
  { 0, 6, "sum_volt_low_level_1",         "Pack voltage low, level 1" },            -- Sum volt low level 1
  { 0, 7, "sum_volt_low_level_2",         "Pack voltage low, level 2" },            -- Sum volt low level 2
  { 1, 0, "chg_temp_high_level_1",        "Charge temperature high, level 1" },     -- Chg temp high level 1
  { 1, 1, "chg_temp_high_level_2",        "Charge temperature high, level 2" },     -- Chg temp high level 2
  { 1, 2, "chg_temp_low_level_1",         "Charge temperature low, level 1" },      -- Chg temp low level 1
  { 1, 3, "chg_temp_low_level_2",         "Charge temperature low, level 2" },      -- Chg temp low level 2
  { 1, 4, "dischg_temp_high_level_1",     "Discharge temperature high, level 1" },  -- Dischg temp high level 1
  { 1, 5, "dischg_temp_high_level_2",     "Discharge temperature high, level 2" },  -- Dischg temp high level 2
  { 1, 6, "dischg_temp_low_level_1",      "Discharge temperature low, level 1" },   -- Dischg temp low level 1
  { 1, 7, "dischg_temp_low_level_2",      "Discharge temperature low, level 2" },   -- Dischg temp low level 2
  { 2, 0, "chg_overcurrent_level_1",      "Charge overcurrent, level 1" },          -- Chg overcurrent level 1
  { 2, 1, "chg_overcurrent_level_2",      "Charge overcurrent, level 2" },          -- Chg overcurrent level 2
  { 2, 2, "dischg_overcurrent_level_1",   "Discharge overcurrent, level 1" },       -- Dischg overcurrent level 1
  { 2, 3, "dischg_overcurrent_level_2",   "Discharge overcurrent, level 2" },       -- Dischg overcurrent level 2
  { 2, 4, "soc_high_level_1",             "SOC high, level 1" },                    -- SOC high level 1
  { 2, 5, "soc_high_level_2",             "SOC high, level 2" },                    -- SOC high level 2
  { 2, 6, "soc_low_level_1",              "SOC low, level 1" },                     -- SOC low level 1
  { 2, 7, "soc_low_level_2",              "SOC low, level 2" },                     -- SOC low level 2
  { 3, 0, "diff_volt_level_1",            "Cell voltage difference, level 1" },     -- Diff volt level 1
  { 3, 1, "diff_volt_level_2",            "Cell voltage difference, level 2" },     -- Diff volt level 2
  { 3, 2, "diff_temp_level_1",            "Temperature difference, level 1" },      -- Diff temp level 1
  { 3, 3, "diff_temp_level_2",            "Temperature difference, level 2" },      -- Diff temp level 2
  { 4, 0, "chg_mos_temp_high",            "Charge MOS temperature high" },          -- Chg MOS temp high alarm
  { 4, 1, "dischg_mos_temp_high",         "Discharge MOS temperature high" },       -- Dischg MOS temp high alarm
  { 4, 2, "chg_mos_temp_sensor",          "Charge MOS temperature sensor" },        -- Chg MOS temp sensor err
  { 4, 3, "dischg_mos_temp_sensor",       "Discharge MOS temperature sensor" },     -- Dischg MOS temp sensor err
  { 4, 4, "chg_mos_adhesion",             "Charge MOS adhesion" },                  -- Chg MOS adhesion err
  { 4, 5, "dischg_mos_adhesion",          "Discharge MOS adhesion" },               -- Dischg MOS adhesion err
  { 4, 6, "chg_mos_open_circuit",         "Charge MOS open circuit" },              -- Chg MOS open circuit err
  { 4, 7, "dischg_mos_open_circuit",      "Discharge MOS open circuit" },           -- Dischg MOS open circuit err
  { 5, 0, "afe_collect_chip",             "AFE collect chip" },                     -- AFE collect chip err
  { 5, 1, "voltage_collect_dropped",      "Voltage collect dropped" },              -- Voltage collect dropped
  { 5, 2, "cell_temp_sensor",             "Cell temperature sensor" },              -- Cell temp sensor err
  { 5, 3, "eeprom",                       "EEPROM" },                               -- EEPROM err
  { 5, 4, "rtc",                          "RTC" },                                  -- RTC err
  { 5, 5, "precharge",                    "Precharge failure" },                    -- Precharge failure
  { 5, 6, "communication",                "Communication failure" },                -- Communication failure
  { 5, 7, "internal_communication",       "Internal communication failure" },       -- Internal communication failure
  { 6, 0, "current_module",               "Current module" },                       -- Current module fault
  { 6, 1, "sum_voltage_detect",           "Pack voltage detection" },               -- Sum voltage detect fault
  { 6, 2, "short_circuit_protect",        "Short circuit protection" },             -- Short circuit protect fault
  { 6, 3, "low_volt_forbidden_chg",       "Low voltage, charging forbidden" },      -- Low volt forbidden chg fault
  { 6, 4, "mos_off_by_command",           "MOS off by command (a state)", state = true },           -- reserved
  { 6, 5, "charging_cabinet_offline",     "Charging cabinet offline (a state)", state = true },     -- reserved
}

local byte, sub, floor = string.byte, string.sub, math.floor

local POWER = { [0] = 1, 2, 4, 8, 16, 32, 64, 128 }

--- Whether a bit of the table is set in data (string; its byte 0 stands at `at`).
function M.is_set(data, at, bit)
  return floor(byte(data, at + bit[1]) / POWER[bit[2]]) % 2 == 1
end

-- The bytes of the table, and what they are of a board in good health: most are, and need no look at each bit.
local BYTES = 7
local NONE = ("\0"):rep(BYTES)

local function bytes_of(data, at)
  return sub(data, at, at + BYTES - 1)
end

--- What is set in data: list of the bits' names, how many are failures, whether one is of level 2.
function M.read(data, at)
  local names, count, severe = {}, 0, false
  if bytes_of(data, at) == NONE then
    return names, count, severe
  end
  for i = 1, #M.BITS do
    local bit = M.BITS[i]
    if M.is_set(data, at, bit) then
      names[#names + 1] = bit[3]
      if not bit.state then
        count = count + 1
        severe = severe or bit[3]:sub(-8) == "_level_2"
      end
    end
  end
  return names, count, severe
end

--- Names of the bits that came and that went between two strings of data.
function M.changes(before, before_at, data, at)
  local raised, cleared = {}, {}
  if bytes_of(before, before_at) == bytes_of(data, at) then
    return raised, cleared
  end
  for i = 1, #M.BITS do
    local bit = M.BITS[i]
    local was, is = M.is_set(before, before_at, bit), M.is_set(data, at, bit)
    if is and not was then
      raised[#raised + 1] = bit[3]
    elseif was and not is then
      cleared[#cleared + 1] = bit[3]
    end
  end
  return raised, cleared
end

return M
