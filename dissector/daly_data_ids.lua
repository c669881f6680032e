-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Data IDs by short names of ours, beside the paper's (V1.2, section 3; others: docs/protocol.md a.2, a.3). An ID that
-- is not here is not known. Pure Lua, no Wireshark.

-- stylua: ignore
local M = {
  [0x90] = "Pack",              -- SOC of total voltage & current
  [0x91] = "Cell extremes",     -- Maximum & Minimum voltage
  [0x92] = "Temp. extremes",    -- Maximum & Minimum temperature
  [0x93] = "MOS status",        -- Charge & discharge MOS status
  [0x94] = "Status",            -- Status information 1
  [0x95] = "Cell voltages",     -- Cell voltage 1~48
  [0x96] = "Temperatures",      -- Cell temperature 1~16
  [0x97] = "Balance",           -- Cell balance State 1~48
  [0x98] = "Faults",            -- Battery failure status
  [0x99] = "Balance state",
  [0x9A] = "SOH or balance",
  [0x00] = "Restart",
  [0x02] = "Probe",
  [0x50] = "Ratings",
  [0x51] = "Boards",
  [0x52] = "Totals",
  [0x53] = "Battery",
  [0x54] = "Firmware index",
  [0x55] = "Manufacturer",
  [0x56] = "Battery name",
  [0x57] = "Battery code",
  [0x58] = "Production",
  [0x59] = "Cell limits",
  [0x5A] = "Pack limits",
  [0x5B] = "Current limits",
  [0x5C] = "Temp. limits",
  [0x5D] = "SOC limits",
  [0x5E] = "Differences",
  [0x5F] = "Balancing",
  [0x60] = "Short circuit",
  [0x61] = "Clock",
  [0x62] = "Software",
  [0x63] = "Hardware",
  [0x64] = "Fault log",
  [0x65] = "Board number",
  [0x66] = "Heater, fan",
  [0x67] = "Balancer",
  [0x68] = "Balance set-up",
  [0x69] = "Inverter",
  [0x6A] = "Serial number",
  [0xD8] = "Wake-up",
  [0xD9] = "Discharge MOS",
  [0xDA] = "Charge MOS",
}

-- Writes: write = read - 40.
for id = 0x10, 0x2A do
  M[id] = "Set " .. M[id + 0x40]
end
M[0x21] = "Set Clock, SOC"

-- The alarm grid: three levels of nine classes.
local CLASSES = {
  [0] = "cell high",
  "cell low",
  "current",
  "temp. high",
  "temp. low",
  "pack high",
  "pack low",
  "cell diff.",
  "temp. diff.",
}
for id = 0x70, 0x8A do
  local class = (id - 0x70) % 9
  M[id] = string.format("Alarm %d %s", (id - 0x70 - class) / 9 + 1, CLASSES[class])
end

return M
