-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Answers in several frames, numbered in data byte 0, put together (docs/records.md 8). Pure Lua, no Wireshark.
--
--   request 95    reply 1   reply 2   reply 3   reply 4   reply 5    request 96 ...
--                |<------------------ burst ------------------>|
--                 link: the request                     table of 14 cells, when 0x94 said that there are 14

local exchange = require("daly_exchange")
local results_module = require("daly_results")

local M = {}

local byte, char, sub, concat = string.byte, string.char, string.sub, table.concat
local GRACE = exchange.GRACE
local later, note_table = results_module.later, results_module.note_table

-- IDs that answer in several numbered frames, and the highest number with base 1 (texts: none is known).
local IDS = {
  [0x95] = 16,
  [0x96] = 3,
  [0x55] = 254,
  [0x56] = 254,
  [0x57] = 254,
  [0x62] = 254,
  [0x63] = 254,
  [0x6A] = 254,
}

M.IDS = IDS

-- Characters of a text, where field notes a.2 tell: what stands behind them in its last frame is stale.
local LETTERS = { [0x55] = 16, [0x56] = 32, [0x57] = 35, [0x6A] = 32 }

-- Values in one frame.
local PER_FRAME = { [0x95] = 3, [0x96] = 7 }

-- What a frame is shown by whose burst has a known count, { base =, count =, shared = true }: one for all such bursts.
local shapes = { [0] = {}, [1] = {} }

local function shape_of(base, count)
  local shape = shapes[base][count]
  if not shape then
    shape = { base = base, count = count, shared = true }
    shapes[base][count] = shape
  end
  return shape
end

-- Slots of a 0x95 (mV) or 0x96 (raw) frame into a burst whose count is not known.
local function note_values(burst, raw, number)
  local values = burst.values
  if burst.id == 0x95 then
    local _, _, _, _, _, a, b, c, d, e, f = byte(raw, 1, 11)
    local first = 3 * (number - burst.base) + 1
    values[first], values[first + 1], values[first + 2] = a * 256 + b, c * 256 + d, e * 256 + f
  else
    local first = 7 * (number - burst.base) + 1
    for i = 0, 6 do
      values[first + i] = byte(raw, 6 + i)
    end
  end
end

-- A table of all cells or sensors is kept as a string, which takes a twentieth of what its burst takes:
--
--   base | count | bytes of a value, 1 or 2 | values, big-endian, and what else was in the last frame
local packed_last, list_last, shape_last -- what was read last

local function read_table(packed)
  if packed ~= packed_last then
    local base, count, width = byte(packed, 1, 3)
    local list = { byte(packed, 4, 3 + count * width) }
    if width == 2 then
      for i = 1, count do
        list[i] = list[2 * i - 1] * 256 + list[2 * i]
      end
      for i = 2 * count, count + 1, -1 do
        list[i] = nil
      end
    end
    packed_last, list_last, shape_last = packed, list, shape_of(base, count)
  end
  return list_last, shape_last
end

-- The same of a burst with a known count; the table of all as a string, when this frame holds the last one and none is
-- missing.
local function note_piece(burst, raw, number)
  local pieces, per_frame, count = burst.pieces, burst.per_frame, burst.count
  local place = number - burst.base
  local wide = burst.id == 0x95
  pieces[place + 1] = sub(raw, 6, wide and 11 or 12)
  local before = per_frame * place
  if count > before and count <= before + per_frame and burst.whole then
    return char(burst.base, count, wide and 2 or 1) .. concat(pieces, "", 1, place + 1)
  end
  return nil
end

--- What a frame of a burst is shown with (daly_results' memory): base and count, or the burst; what is odd, or nil; the
-- table of all cells or sensors, a list that nobody may change, or nil.
function M.open(memory)
  if type(memory) == "string" then
    local list, shape = read_table(memory)
    return shape, nil, list
  elseif memory and memory.burst then
    return memory.burst, memory, memory.table
  end
  return memory, nil, nil
end

--- Whether a burst with a known count has not reached its last cell or sensor.
function M.falls_short(burst)
  return burst.count and burst.per_frame * (burst.number - burst.base + 1) < burst.count
end

--- The running burst of a lane is over.
function M.finish(bus, lane)
  local burst = lane.burst
  if burst then
    lane.burst = nil
    if burst.count then
      lane.old_burst = burst
    end
    if M.falls_short(burst) then
      local odd = bus.results.odd[burst.last]
      local with = { cut_off = true }
      for k, v in pairs(odd or {}) do
        with[k] = v
      end
      later(bus, "odd", burst.last, with)
    end
  end
end

-- The table stands in packet `number`: tell the frames before.
local function link_parts(bus, burst, number)
  burst.table_in = number
  for i = 1, burst.part_count do
    note_table(bus, burst.parts[i], number)
  end
  burst.part_count = 0
end

-- A burst begins. One whose count is known uses the tables of such a one before, which nobody else has.
local function begin(state, lane, id, address, base, request)
  local board = state.boards[address]
  local count = board and (id == 0x95 and board.cells or id == 0x96 and board.sensors) or nil
  local per_frame = PER_FRAME[id]
  local burst = count and lane.old_burst
  if burst then
    lane.old_burst = nil
  else
    burst = {
      pieces = count and {} or nil, -- where the count is known: data bytes of its frames
      values = per_frame and not count and {} or nil, -- where it is not: by cell or sensor
      texts = not per_frame and {} or nil, -- by frame number
      parts = {}, -- slots of its frames, until the table is there
    }
  end
  burst.id = id
  burst.address = address
  burst.base = base
  burst.request = request
  burst.count = count
  burst.shape = count and shape_of(base, count) -- what its frames are shown with
  burst.per_frame = per_frame
  burst.whole = true -- every frame from the base on was seen
  burst.part_count = 0
  burst.table_in = nil
  return burst
end

--- What the bursts of a reply run in, { burst = the running one, old_burst = one that is over, whose table serves
-- again }: of a serial line its bus's state; on CAN, where boards and hosts are told apart, one for each two of them.
function M.lane(bus, raw, address)
  local state = bus.state
  if not bus.can then
    return state
  end
  local key = address * 256 + exchange.host(byte(raw, 13))
  local lane = state.lanes[key]
  if not lane then
    lane = { address = address }
    state.lanes[key] = lane
  end
  return lane
end

--- A request that one board (of a serial line any) may answer: the same number again begins a new burst.
function M.asked(bus, id, board)
  local state = bus.state
  local burst = state.burst
  if burst and burst.id == id then
    burst.asked = true
  end
  for _, lane in pairs(state.lanes) do
    burst = lane.burst
    if burst and burst.id == id and lane.address == board then
      burst.asked = true
    end
  end
end

--- A reply that is one of several frames, in its lane. `damaged`: what stands right before it in its stream is.
-- Returns, each nil where there is none: packet of its request; response time; what it is shown with; the table; packet
-- of the burst's table, where that came before.
function M.feed(bus, lane, slot, packet, raw, address, id, starts, ends, damaged)
  local state = bus.state
  local number = byte(raw, 5)
  local burst = lane.burst
  local highest = IDS[id]
  if number > highest then
    return nil -- FF, or more than the paper's 48 cells, 21 sensors: skipped
  end
  local running = burst
    and burst.id == id
    and burst.address == address
    and starts - burst.ended <= bus.times.burst + GRACE
  if running and burst.base == 0 and number == highest and id >= 0x95 then
    return nil -- with base 0 the highest number is one less
  end
  running = running and number >= burst.number and not (number == burst.number and burst.asked)
  local missing, again, wait, from
  if running then
    again = number == burst.number or nil
    from = burst.number + 1
  else
    local base, kind = 1, id * 256 + address
    if number == 0 then
      base, state.from_zero[kind] = 0, true
    elseif damaged and state.from_zero[kind] then
      if number == highest and id >= 0x95 then
        return nil
      end
      base = 0 -- number 0 may be what was damaged
    end
    M.finish(bus, lane)
    local request
    request, wait = exchange.answer(bus, slot, packet, raw, address, id, starts)
    burst = begin(state, lane, id, address, base, request)
    lane.burst = burst
    from = base
  end
  if number > from then
    missing = {}
    for i = from, number - 1 do
      missing[#missing + 1] = i
    end
    burst.whole = false
  end
  burst.number = number
  burst.ended = ends
  burst.asked = nil
  burst.last = slot
  burst.last_in = packet
  local packed, list
  if burst.pieces then
    packed = note_piece(burst, raw, number)
    list = packed and read_table(packed)
  elseif burst.values then
    note_values(burst, raw, number)
  else
    burst.texts[number] = sub(raw, 6, 12)
  end
  local memory = packed or burst.shape or burst
  if missing or again then
    memory = { burst = M.open(memory), missing = missing, again = again, table = list }
  end
  local table_in = burst.table_in
  if table_in then
    wait = nil
  elseif list then
    link_parts(bus, burst, packet)
  elseif burst.count then
    local count = burst.part_count + 1
    burst.parts[count] = slot
    burst.part_count = count
  end
  return burst.request, wait, memory, list, table_in
end

--- The characters of a text burst, without the padding at its end and what stands behind it.
function M.text(burst)
  local parts = {}
  for number = burst.base, burst.number do
    parts[#parts + 1] = burst.texts[number]
  end
  return (sub(concat(parts), 1, LETTERS[burst.id] or -1):match("^(.-)[%z\xFF\x20]*$"))
end

--- The packet in which the whole of a frame's burst stands, or nil; `again`: the capture was read to its end.
function M.whole_in(results, slot, again)
  local table_in = results_module.table_in(results, slot)
  if table_in and (again or not results_module.wait(results, slot)) then
    return table_in
  end
  local burst = M.open(results_module.memory(results, slot))
  if not again or not burst then
    return nil
  end
  if burst.last and not burst.count and burst.whole then
    return burst.last ~= slot and (burst.values or M.text(burst) ~= "") and burst.last_in or nil
  end
  return nil
end

-- Whether a frame is the last of a running burst, which has ended by time, before its last cell or sensor.
local function ran_out(results, bus, lane, slot)
  local burst = lane.burst
  return burst
    and burst.last == slot
    and M.falls_short(burst)
    and results.latest - burst.ended > bus.times.burst + GRACE
end

--- Whether a frame is the last of a burst that was cut off: it ended and its last cell or sensor was not reached.
function M.is_cut_off(results, slot)
  local odd = results.odd[slot]
  if odd and odd.cut_off then
    return true
  end
  for i = 1, #results.buses do
    local bus = results.buses[i]
    if ran_out(results, bus, bus.state, slot) then
      return true
    end
    for _, lane in pairs(bus.state.lanes) do
      if ran_out(results, bus, lane, slot) then
        return true
      end
    end
  end
  return false
end

return M
