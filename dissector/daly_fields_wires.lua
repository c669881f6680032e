-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Fields of the wires other than A5 frames on a serial line: Modbus RTU, CAN. The values they carry have the names of the A5
-- frames' (daly_fields.lua) and of the settings (daly_fields_settings.lua): one quantity, one name.

local types = require("daly_field_types")

local plain, hex, number, named, boolean = types.plain, types.hex, types.number, types.named, types.boolean

local M = {}

local CHECKSUM = { [0] = "Bad", [1] = "Good", [2] = "Unverified" }
local FUNCTION = {
  [0x03] = "Read registers",
  [0x06] = "Write one register",
  [0x10] = "Write registers",
  [0x83] = "Exception to a read",
  [0x86] = "Exception to a write of one",
  [0x90] = "Exception to a write",
}

-- stylua: ignore start

--- Declare them. `add`: see daly_field_types.new.
function M.declare(add)
  -- Modbus RTU, vendor's article of 2024, section 3; docs/wires.md 1.
  add("modbus_address", "modbus.address", hex(ProtoField.uint8, "Modbus address", "D2 both ways; 80+N request, 50+N reply of board N; field notes fact 8 [seen by several]"))
  add("modbus_function", "modbus.function", hex(ProtoField.uint8, "Function", "03, 06, 10; exceptions 83, 86, 90; vendor's article of 2024, section 3", FUNCTION))
  add("modbus.register", "modbus.register", hex(ProtoField.uint16, "Register", "First register, of a reply as its request says; vendor's article of 2024, section 3"))
  add("modbus.count", "modbus.count", plain(ProtoField.uint16, "Registers", "How many registers; vendor's article of 2024, section 3"))
  add("modbus.byte_count", "modbus.byte_count", number("Byte count", "Byte count of a write, as the Modbus standard has it; Daly's own programs leave it out [seen by several]"))
  add("modbus.value", "modbus.value", plain(ProtoField.uint16, "Value", "Value of one register, once per register in order; vendor's article of 2024, section 3"))
  add("modbus.exception", "modbus.exception", hex(ProtoField.uint8, "Exception code", "Why the board refuses; the Modbus standard [seen once]"))
  add("modbus.absent", "modbus.absent", hex(ProtoField.uint16, "Register not there", "Number of a register that reads FFFF: the board does not have it; generated"))
  add("modbus.ambiguous", "modbus.ambiguous", boolean("Which request is not known", "Requests for different registers wait that this reply fits: its registers are not named; generated (docs/wires.md 1)"))
  add("modbus.assumed", "modbus.assumed", boolean("Register assumed", "No request was seen; the values prove where the registers begin; generated (docs/wires.md 1)"))
  add("modbus_crc", "modbus.crc", hex(ProtoField.uint16, "CRC", "CRC-16, low byte first; vendor's article of 2024, section 3"))
  add("modbus_crc_status", "modbus.crc.status", named("CRC status", CHECKSUM, "0 Bad, 1 Good, 2 Unverified; generated"))

  -- CAN, docs/wires.md 2.
  add("can.priority", "can.priority", hex(ProtoField.uint8, "Priority", "Bits 24 to 28 of the identifier, 18 of the classic dialect; vendor's article of 2024, section 1"))
  add("can.destination", "can.destination", hex(ProtoField.uint8, "Destination", "Who shall receive: board or host; vendor's article of 2024, section 1"))
  add("can.source", "can.source", hex(ProtoField.uint8, "Source", "Who sends: board or host; vendor's article of 2024, section 1"))
  add("can.register", "can.register", hex(ProtoField.uint16, "Register", "Bits 16 to 28 of the identifier, HKMS dialect; field notes c.2 [seen by several]"))
  add("can.remote", "can.remote", boolean("Remote frame", "A frame that asks without bytes of its own; generated"))

  -- Fault block of HKMS, register 040E, field notes c.2: levels of three bits, 0 none; and single bits that 0x98 does not have.
  for _, name in ipairs({
    "cell_high",
    "cell_low",
    "cell_difference",
    "charge_temp_high",
    "charge_temp_low",
    "discharge_temp_high",
    "discharge_temp_low",
    "temp_difference",
    "pack_high",
    "pack_low",
    "charge_current",
    "discharge_current",
    "soc_low",
    "soh_low",
    "mos_temp_high",
    "thermal_runaway",
  }) do
    local label = name:gsub("_", " ")
    add("level." .. name, "level." .. name, number("Level, " .. label, "0 none, to 7; HKMS 040E; field notes c.2 [seen once]"))
  end
  for _, name in ipairs({
    "smart_charger",
    "smart_discharger",
    "charge_undervoltage",
    "discharge_overvoltage",
    "parallel_communication",
    "afe_communication",
    "afe_sampling",
    "voltage_detect",
    "cell_temp_disconnected",
    "flash",
    "chg_mos",
    "dischg_mos",
    "precharge_mos",
    "heating",
  }) do
    local label = name:gsub("_", " ")
    add("fault." .. name, "fault." .. name, boolean("Fault, " .. label, "1 error, 0 none; HKMS 040E; field notes c.2 [seen once]"))
  end
  for _, name in ipairs({
    "mos_temp_high_level_1",
    "mos_temp_high_level_2",
    "board_temp_high_level_1",
    "board_temp_high_level_2",
    "thermal_runaway",
    "balance_communication",
    "balance_condition",
  }) do
    local label = name:gsub("_", " ")
    add("fault." .. name, "fault." .. name, boolean("Fault, " .. label, "1 error, 0 none; HKMS 0409; field notes c.2 [seen by several]"))
  end
end

-- stylua: ignore end

return M
