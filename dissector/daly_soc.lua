-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- The state of charge of one board, told over A5 (0x90) and over Modbus: whether the two agree (docs/wires.md 1). Pure
-- Lua, no Wireshark. Times are seconds.
--
--   50+N   against   0x90 of address N
--   D2     against   0x90 of the only board that answers over A5 on this bus

local results_module = require("daly_results")
local GRACE = require("daly_exchange").GRACE

local M = {}

local format = string.format

local D2, REPLIES = 0xD2, 0x50

--- A good A5 reply of this address came: whether it is the bus's only board.
function M.note_address(state, address)
  if address >= 0x01 and address <= 0x10 then
    state.only = state.only == nil and address or state.only == address and address
  end
end

-- Two SOCs in 0.1 %: `mine` of this record, `theirs` = { soc =, packet =, ended = }.
local function compare(bus, slot, mine, theirs, starts, what)
  if not theirs or starts - theirs.ended > bus.times.age + GRACE then
    return
  end
  if math.abs(mine - theirs.soc) > 10 * bus.times.soc_tolerance then
    local words = format("SOC is %.1f %% here, %.1f %% in the newest %s", mine / 10, theirs.soc / 10, what)
    results_module.contradict(bus.results, slot, "soc", theirs.packet, words)
  end
end

--- A 0x90 of an address: `pack` = { soc = (0.1 %) ... }.
function M.of_a5(bus, slot, address, pack, starts)
  local told = bus.state.modbus_soc -- by Modbus address: { soc =, packet =, ended =, turn = }
  if not told or address < 0x01 or address > 0x10 then
    return
  end
  local own, shared = told[REPLIES + address], bus.state.only == address and told[D2] or nil
  if own and shared then
    own = own.turn > shared.turn and own or shared
  end
  compare(bus, slot, pack.soc, own or shared, starts, "Modbus reply")
end

--- A Modbus reply with an SOC (0.1 %).
function M.of_modbus(bus, slot, address, value, packet, starts, ends)
  local state = bus.state
  state.modbus_soc = state.modbus_soc or {}
  local told = state.modbus_soc
  state.soc_turn = (state.soc_turn or 0) + 1
  local mine = told[address] or {}
  told[address] = mine
  mine.soc, mine.packet, mine.ended, mine.turn = value, packet, ends, state.soc_turn
  local board
  if address == D2 then
    board = state.only and state.boards[state.only]
  else
    board = state.boards[address - REPLIES]
  end
  compare(bus, slot, value, board and board.pack, starts, "0x90")
end

return M
