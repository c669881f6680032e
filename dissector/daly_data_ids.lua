-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Data IDs by short names of ours, beside the paper's (V1.2, section 3; texts: field notes a.2).

-- stylua: ignore
return {
  [0x90] = "Pack",              -- SOC of total voltage & current
  [0x91] = "Cell extremes",     -- Maximum & Minimum voltage
  [0x92] = "Temp. extremes",    -- Maximum & Minimum temperature
  [0x93] = "MOS status",        -- Charge & discharge MOS status
  [0x94] = "Status",            -- Status information 1
  [0x95] = "Cell voltages",     -- Cell voltage 1~48
  [0x96] = "Temperatures",      -- Cell temperature 1~16
  [0x97] = "Balance",           -- Cell balance State 1~48
  [0x98] = "Faults",            -- Battery failure status
  [0x55] = "Manufacturer",
  [0x56] = "Battery name",
  [0x57] = "Battery code",
  [0x62] = "Software",
  [0x63] = "Hardware",
  [0x6A] = "Serial number",
}
