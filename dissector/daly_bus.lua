-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- One bus: what its frames mean to each other (docs/records.md 5 to 11). Pure Lua, no Wireshark. Times are seconds.
--
--   feed --request--> daly_exchange                             echo, retry, who waits for what
--        --reply----> daly_bursts (several frames), daly_board  table, text; what changed, what contradicts
--                     and daly_exchange                         the request it belongs to
--
--        --Modbus---> daly_modbus_board                      registers, what changed; daly_modbus_exchange the request
--
-- feed() is called once per frame, in the order of the capture. What it finds out is kept in daly_results, where an
-- ordinary frame costs no table.
--
-- A frame of CAN comes in the form of an A5 frame, on a bus that says so (bus.can): its length may be other than 8, its
-- bytes are filled up to eight, and the destination stands where the checksum would (docs/wires.md 2):
--
--   A5 | source | data ID | length | d0 d1 d2 d3 d4 d5 d6 d7 | destination

local exchange = require("daly_exchange")
local results_module = require("daly_results")
local bursts = require("daly_bursts")
local boards = require("daly_board")
local modbus_board = require("daly_modbus_board")
local soc = require("daly_soc")

local M = {}

local byte = string.byte
local note_reply, answer = results_module.note_reply, exchange.answer
local readers, board_of = boards.readers, boards.board_of
local BURST_IDS, lane_of = bursts.IDS, bursts.lane
local A5 = 0xA5

-- So many frames of others are remembered while one stream's last frame is uncertain; then it counts as certain.
local MOST_UNCERTAIN = 500

--- A bus with nothing remembered. `times` = { echo =, reply =, late =, burst =, age = } in seconds, and tolerances:
-- cell_tolerance (mV), temperature_tolerance (C), sum_tolerance, soc_tolerance (%).
function M.new(times, results)
  local state = exchange.state()
  state.boards = {} -- by address byte of replies
  state.lanes = {} -- what bursts run in, on CAN (daly_bursts.lane)
  state.from_zero = {} -- by data ID x 256 + address byte: a reply had number 0
  local bus = { times = times, results = results, state = state, mark = nil }
  results.buses[#results.buses + 1] = bus
  return bus
end

-- An A5 frame of a host.
local function feed_request(bus, slot, number, raw, address, id, starts, ends, side)
  local results = bus.results
  results.entries[slot] = 0
  local flag, request = exchange.ask(bus, slot, number, raw, address, id, starts, ends, side)
  if flag then
    results.flag[slot] = flag
    if flag == "echo" then
      return
    end
  end
  if request.data then
    boards.note_before(bus, slot, request.board, id)
  end
  results.ended[slot] = ends
  if BURST_IDS[id] then
    bursts.asked(bus, id, request.board)
  end
end

-- An A5 frame of a board. `length`: of its data.
local function feed_reply(bus, slot, number, raw, address, id, length, starts, ends, damaged)
  local state = bus.state
  if state.only ~= address then
    soc.note_address(state, address)
  end
  if length ~= 8 then -- on CAN: it answers, and says nothing
    local request, waited = answer(bus, slot, number, raw, address, id, starts)
    note_reply(bus.results, slot, request, waited)
  elseif BURST_IDS[id] then
    local request, waited, shown, values, table_in =
      bursts.feed(bus, lane_of(bus, raw, address), slot, number, raw, address, id, starts, ends, damaged)
    note_reply(bus.results, slot, request, waited, shown, table_in)
    if values then
      boards.feed_table(bus, slot, number, values, address, id, starts, ends)
    end
  else
    local lane = lane_of(bus, raw, address)
    if lane.burst then
      bursts.finish(bus, lane)
    end
    local request, waited = answer(bus, slot, number, raw, address, id, starts)
    local read = readers[id]
    local shown = read and read(bus, board_of(state, address), slot, number, raw, starts, ends)
    note_reply(bus.results, slot, request, waited, shown)
  end
end

--- One frame, A5 or Modbus. `slot`: the frame's own number for the results; `number`: of its packet; `raw`: its bytes;
-- `starts`, `ends`: s; `side`: tells the two sides of a two-port tap apart, or nil; `owner`: the stream it came from;
-- `damaged`: the record right before it in that stream is bad_checksum, short or junk.
function M.feed(bus, slot, number, raw, starts, ends, side, owner, damaged)
  local mark = bus.mark
  if mark then
    local log = mark.log
    log[#log + 1] = {
      slot = slot,
      number = number,
      raw = raw,
      starts = starts,
      ends = ends,
      side = side,
      owner = owner,
      damaged = damaged,
    }
    if #log > MOST_UNCERTAIN then
      bus.mark = nil
    end
  end
  -- A clock that steps back does not revive a request.
  local state = bus.state
  if starts > state.latest then
    state.latest = starts
  end
  local first, address, id, length = byte(raw, 1, 4)
  if first ~= A5 then
    modbus_board.feed(bus, slot, number, raw, starts, ends, side)
  elseif address >= 0x20 then
    feed_request(bus, slot, number, raw, address, id, starts, ends, side)
  else
    feed_reply(bus, slot, number, raw, address, id, length, starts, ends, damaged)
  end
end

--- One frame of CAN, in the form of an A5 frame. `slot` and `number`: as above; `shape`: of its identifier
-- (daly_can_ids); `length`: of its data. Nothing of it is ever taken back.
function M.feed_can(bus, slot, number, raw, shape, length, time)
  local results, state = bus.results, bus.state
  if time > results.latest then
    results.latest = time
  end
  if time > state.latest then
    state.latest = time
  end
  if shape.asks then
    feed_request(bus, slot, number, raw, shape.source, shape.classic, time, time)
  else
    feed_reply(bus, slot, number, raw, shape.source, shape.classic, length, time, time)
  end
end

-- Taking back ------------------------------------------------------------------------------------

-- The contents of every table that can be reached from this one.
local function save(object, saved)
  if type(object) == "table" and not saved[object] then
    local contents = {}
    saved[object] = contents
    for k, v in pairs(object) do
      contents[k] = v
      save(v, saved)
    end
  end
  return saved
end

--- From here on, what is fed for `owner` may have to be taken back. One owner at a time: an older mark counts as
-- confirmed.
function M.mark(bus, owner)
  bus.mark = { owner = owner, saved = save(bus.state, {}), log = {}, later = {} }
end

--- What was fed for `owner` since its mark is certain.
function M.confirm(bus, owner)
  if bus.mark and bus.mark.owner == owner then
    bus.mark = nil
  end
end

--- Take back all that was fed since the owner's mark. Returns what others fed since, to be fed again after the owner's
-- right frames; nil where there is no mark.
function M.rewind(bus, owner)
  local mark = bus.mark
  if not mark or mark.owner ~= owner then
    return nil
  end
  local results, others = bus.results, {}
  for i = #mark.later, 1, -1 do
    local entries, slot, before = table.unpack(mark.later[i], 1, 3)
    entries[slot] = before
  end
  for i = 1, #mark.log do
    local fed = mark.log[i]
    results_module.forget(results, fed.slot)
    if fed.owner ~= owner then
      others[#others + 1] = fed
    end
  end
  -- In place: records shown before refer to these very tables.
  for object, contents in pairs(mark.saved) do
    for k in pairs(object) do
      object[k] = nil
    end
    for k, v in pairs(contents) do
      object[k] = v
    end
  end
  bus.mark = nil
  return others
end

return M
