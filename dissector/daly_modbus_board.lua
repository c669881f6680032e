-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- What the registers of a Modbus reply are, and what is remembered of each board that answers over Modbus
-- (docs/wires.md 1): where a reply begins, by its request or by its own proof; how many cells and sensors there are;
-- what changed. Pure Lua, no Wireshark. Times are seconds.
--
-- What a reply is shown with is one number (daly_results' memory), so that an ordinary one costs no table:
--
--   start + 2^16 x cells (0: not known) + 2^22 x sensors (0: not known) + 2^27 x assumed

local modbus_exchange = require("daly_modbus_exchange")
local registers = require("daly_registers")
local results_module = require("daly_results")
local boards = require("daly_board")
local faults = require("daly_faults")
local soc = require("daly_soc")

local M = {}

local byte, floor = string.byte, math.floor
local odd_of, change = results_module.odd, results_module.change
local register_of = registers.register

-- Where the registers stand in a read reply: address, function, byte count, registers.
local DATA = 4

-- Packing -----------------------------------------------------------------------------------------

local CELLS, SENSORS, ASSUMED = 2 ^ 16, 2 ^ 22, 2 ^ 27

local function pack(start, cells, sensors, assumed)
  return start + CELLS * (cells or 0) + SENSORS * (sensors or 0) + (assumed and ASSUMED or 0)
end

--- What a reply is shown with: first register, cells and sensors (nil: not known), whether the register is assumed.
function M.unpack(memory)
  local start, cells = memory % CELLS, floor(memory / CELLS) % 64
  local sensors = floor(memory / SENSORS) % 32
  return floor(start), cells > 0 and cells or nil, sensors > 0 and sensors or nil, memory >= ASSUMED
end

-- Proof -------------------------------------------------------------------------------------------

-- Whether the pack voltage (0.1 V) is within 1 % of the sum of these cells (mV).
local function adds_up(raw, voltage, cells)
  local sum = 0
  for i = 0, cells - 1 do
    local high, low = byte(raw, DATA + 2 * i, DATA + 2 * i + 1)
    sum = sum + high * 256 + low
  end
  return math.abs(voltage * 100 - sum) * 100 <= sum
end

-- Values of a whole pack, read from register 0.
local function is_pack(raw, count, known, most_cells)
  local function value(register)
    return register_of(raw, DATA, 0, count, register)
  end
  local cells, sensors, voltage = value(known.cell_count), value(known.sensor_count), value(known.voltage)
  return cells >= 1
    and cells <= most_cells
    and sensors <= 8
    and voltage ~= 0
    and value(known.soc) <= 1000
    and (known ~= registers.MAPS.d2 or value(known.state) <= 2)
    and adds_up(raw, voltage, cells)
end

-- Settings of D2, read from register 80.
local function is_settings(raw, count)
  local function value(register)
    return register_of(raw, DATA, 0x80, count, register)
  end
  local measuring_boards = value(0x82)
  return measuring_boards >= 1
    and measuring_boards <= 3
    and value(0x89) <= 2
    and value(0x8B) > value(0x8D)
    and value(0x8C) > value(0x8E)
    and value(0x8F) > value(0x91)
    and value(0x90) > value(0x92)
    and value(0xA5) <= 1
    and value(0xA6) <= 1
    and value(0xA7) <= 1000
end

-- Texts of D2, read from register A9.
local function is_texts(raw)
  local text = raw:sub(DATA, -3)
  local _, shown = text:gsub("[\x21-\x7E]", "")
  return not text:find("[^%z\x20-\x7E\xFF]") and shown >= 4
end

-- The register that a reply begins with, where its values prove it.
local function proven(raw, address, count)
  if address ~= 0xD2 then
    return count >= 62 and is_pack(raw, count, registers.MAPS["81"], 48) and 0x0000 or nil
  elseif count >= 62 then
    return is_pack(raw, count, registers.MAPS.d2, 32) and 0x0000 or nil
  elseif count == 41 then
    return is_settings(raw, count) and 0x80 or nil
  elseif count == 32 then
    return is_texts(raw) and 0xA9 or nil
  end
  return nil
end

-- Memory ------------------------------------------------------------------------------------------

local function board_of(state, address)
  state.modbus_boards = state.modbus_boards or {}
  local board = state.modbus_boards[address]
  if not board then
    board = { blocks = {}, block_count = 0 }
    state.modbus_boards[address] = board
  end
  return board
end

-- Where a board's memory has the packet that told something.
local TOLD_IN = {
  cell_count = "cell_count_in",
  sensor_count = "sensor_count_in",
  charge_mos = "charge_mos_in",
  discharge_mos = "discharge_mos_in",
}

-- A count of cells or sensors, in this reply or the newest before.
local function count_of(bus, slot, board, name, value, most, number)
  local before = board[name]
  if value and value >= 1 and value <= most then
    if before and before ~= value then
      change(bus.results, slot, name, board[TOLD_IN[name]])
    end
    board[name], board[TOLD_IN[name]] = value, number
    return value
  end
  return before
end

-- A switch that changed.
local function take_switch(bus, slot, board, name, value, number)
  if not value or value == 0xFFFF then
    return
  end
  local on = value ~= 0
  if board[name] ~= nil and board[name] ~= on then
    change(bus.results, slot, name, board[TOLD_IN[name]])
  end
  board[name], board[TOLD_IN[name]] = on, number
end

local function take_faults(bus, slot, board, data, number)
  local before = board.faults
  if before and before ~= data then
    local raised, cleared = faults.changes(before, 1, data, 1)
    if #raised + #cleared > 0 then
      local odd = odd_of(bus.results, slot)
      odd.raised, odd.cleared = raised, cleared
      odd.from = math.max(odd.from or 0, board.faults_in)
    end
  end
  board.faults, board.faults_in = data, number
end

-- So many blocks of settings are remembered of a board, for the writes that may change them.
local MOST_BLOCKS = 16

local function take_settings(board, raw, start, count, number)
  if not board.blocks[start] then
    board.block_count = board.block_count + 1
    if board.block_count > MOST_BLOCKS then
      board.blocks, board.block_count = {}, 1
    end
  end
  board.blocks[start] = { start = start, count = count, raw = raw, packet = number }
end

-- The newest block that holds a register.
local function newest_block(board, register)
  local newest
  for _, block in pairs(board.blocks) do
    local place = register - block.start
    if place >= 0 and place < block.count and (not newest or block.packet > newest.packet) then
      newest = block
    end
  end
  return newest
end

-- A read reply whose first register is known. Returns what it is shown with.
local function take(bus, slot, number, raw, address, start, assumed, starts, ends)
  local known = registers.MAPS[modbus_exchange.dialect(address)]
  local board = board_of(bus.state, address)
  local count = byte(raw, 3) / 2
  local state = register_of(raw, DATA, start, count, known.state)
  if state and state < 256 then
    if board.state and board.state ~= state then
      change(bus.results, slot, "state", board.state_in)
    end
    board.state, board.state_in = state, number
  end
  local charges, discharges =
    register_of(raw, DATA, start, count, known.charge), register_of(raw, DATA, start, count, known.discharge)
  take_switch(bus, slot, board, "charge_mos", charges, number)
  take_switch(bus, slot, board, "discharge_mos", discharges, number)
  local cells, sensors =
    register_of(raw, DATA, start, count, known.cell_count), register_of(raw, DATA, start, count, known.sensor_count)
  cells = count_of(bus, slot, board, "cell_count", cells, boards.MOST_CELLS, number)
  sensors = count_of(bus, slot, board, "sensor_count", sensors, boards.MOST_SENSORS, number)
  local data = registers.faults(known, raw, DATA, start, count)
  if data then
    take_faults(bus, slot, board, data, number)
  end
  if start + count > known.settings then
    take_settings(board, raw, start, count, number)
  end
  local charge = register_of(raw, DATA, start, count, known.soc)
  if charge and charge ~= 0xFFFF then
    soc.of_modbus(bus, slot, address, charge, number, starts, ends)
  end
  return pack(start, cells, sensors, assumed)
end

-- A write: what the board had before, of each register that is written.
local function note_before(bus, slot, raw, address, fn)
  local all = bus.state.modbus_boards
  local board = all and all[modbus_exchange.answers_from(address)]
  if not board then
    return
  end
  local _, _, a, b, c, d = byte(raw, 1, 6)
  local first, was, was_in = a * 256 + b, nil, nil
  for register = first, first + (fn == 0x06 and 1 or c * 256 + d) - 1 do
    local block = newest_block(board, register)
    if block then
      local at = DATA + 2 * (register - block.start)
      was = was or {}
      was[register], was_in = block.raw:sub(at, at + 1), math.max(was_in or 0, block.packet)
    end
  end
  if was then
    local odd = odd_of(bus.results, slot)
    odd.was, odd.was_in = was, was_in
  end
end

--- One Modbus frame, see daly_bus.
function M.feed(bus, slot, number, raw, starts, ends, side)
  local address, fn = byte(raw, 1, 2)
  local reply, request, ambiguous = modbus_exchange.feed(bus, slot, number, raw, address, fn, starts, ends, side)
  if not reply then
    if fn ~= 0x03 then
      note_before(bus, slot, raw, address, fn)
    end
  elseif fn == 0x03 and not ambiguous then
    local start = request and request.register or not request and proven(raw, address, byte(raw, 3) / 2)
    if start then
      local memory = take(bus, slot, number, raw, address, start, not request, starts, ends)
      if memory then
        results_module.note_memory(bus.results, slot, memory)
      end
    end
  end
end

return M
