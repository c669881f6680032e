-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- What frames mean to each other on one bus: echo, retry, exchange, burst, and what is remembered per board
-- (docs/records.md 5 to 9). Pure Lua, no Wireshark. Times are seconds.
--
-- feed() is called once per A5 frame, in the order of the capture. What it finds out is kept in flat tables by the
-- frame's slot (a number of its own), so that an ordinary frame costs no table:
--
--   flag[slot]     nil, "echo" or "retry"
--   link[slot]     reply: packet number of its request; request: of its first reply (set when that comes); else false
--   wait[slot]     reply that answers a request: response time, s; else false
--   memory[slot]   0x90 reply: state of the newest 0x93; 0x98: data bytes of the one before;
--                  0x95, 0x96, texts: the burst (only base and count, where the count is known), or
--                  { burst =, missing =, again =, table = } where there is more to say; else false

local M = {}

local byte, sub = string.byte, string.sub

-- Differences this small are the arithmetic's (docs/records.md 1).
local GRACE = 1e-6

local MOST_CELLS, MOST_SENSORS = 48, 21

-- So many frames of others are remembered while one stream's last frame is uncertain; then it counts as certain.
local MOST_UNCERTAIN = 500

-- IDs that answer in several numbered frames, and the highest number with base 1 (texts: none is known).
local BURST_IDS = {
  [0x95] = 16,
  [0x96] = 3,
  [0x55] = 254,
  [0x56] = 254,
  [0x57] = 254,
  [0x62] = 254,
  [0x63] = 254,
  [0x6A] = 254,
}

M.BURST_IDS = BURST_IDS

--- Tables for what is found out about the frames of a capture.
function M.results()
  return { flag = {}, link = {}, wait = {}, memory = {} }
end

--- A bus with nothing remembered. `times` = { echo =, reply =, burst = } in seconds.
function M.new(times, results)
  return {
    times = times,
    results = results,
    state = { last = {}, remembered = 0, waiting = {}, boards = {}, burst = nil, latest = -math.huge },
    mark = nil, -- see M.mark
  }
end

local function board_of(state, address)
  local board = state.boards[address]
  if not board then
    board = {}
    state.boards[address] = board
  end
  return board
end

-- Forget requests that nobody can answer or repeat any more; only when there are many.
local function forget_old(state, now, limit)
  local kept, count = {}, 0
  for key, request in pairs(state.last) do
    if now - request.ended <= limit then
      kept[key] = request
      count = count + 1
    end
  end
  state.last, state.remembered = kept, count
end

local function feed_request(bus, slot, number, raw, address, id, starts, ends, side)
  local state, times = bus.state, bus.times
  local flag
  local before = state.last[raw]
  if before and not before.answered and state.latest - before.ended <= times.reply + GRACE then
    local echo
    if side and before.side then
      echo = side ~= before.side
    else
      echo = not before.echoed and starts - before.ended <= times.echo + GRACE
    end
    if echo then
      before.echoed = true
      return "echo"
    end
    flag = "retry"
  end
  local request = {
    slot = slot,
    number = number,
    ended = ends,
    side = side,
    board = address > 0x40 and address <= 0x4F and address - 0x3F or nil,
  }
  if not before then
    state.remembered = state.remembered + 1
    if state.remembered > 512 then
      forget_old(state, state.latest, times.reply + 1)
    end
  end
  state.last[raw] = request
  local list = state.waiting[id]
  if not list then
    list = {}
    state.waiting[id] = list
  end
  while list[1] and state.latest - list[1].ended > times.reply + GRACE do
    table.remove(list, 1)
  end
  list[#list + 1] = request
  local burst = state.burst
  if burst and burst.id == id then
    burst.asked = true
  end
  return flag
end

-- The newest request for the ID that still waits for this board's reply: it stops waiting. Returns it and the
-- response time.
local function answer(bus, number, address, id, starts)
  local list = bus.state.waiting[id]
  if not list then
    return nil
  end
  local latest = bus.state.latest
  for i = #list, 1, -1 do
    local request = list[i]
    if latest - request.ended <= bus.times.reply + GRACE and (not request.board or request.board == address) then
      table.remove(list, i)
      request.answered = true
      bus.results.link[request.slot] = number
      bus.linked = request.slot
      local wait = starts - request.ended
      if wait < 0 then
        wait = wait > -GRACE and 0.0 or nil
      end
      return request, wait
    end
  end
  return nil
end

-- Cells of a 0x95 frame into the burst; the table when this frame holds the last cell and none is missing.
local function note_cells(burst, raw, number)
  local cells = burst.cells
  local _, _, _, _, _, a, b, c, d, e, f = byte(raw, 1, 11)
  local first = 3 * (number - burst.base) + 1
  cells[first], cells[first + 1], cells[first + 2] = a * 256 + b, c * 256 + d, e * 256 + f
  local count = burst.count
  if count and count >= first and count <= first + 2 and burst.whole then
    local list = {}
    for i = 1, count do
      list[i] = cells[i]
    end
    return list
  end
  return nil
end

-- What a frame is shown by whose burst has a known count, { base =, count = }: one for all such bursts.
local shapes = { [0] = {}, [1] = {} }

local function shape_of(base, count)
  local shape = shapes[base][count]
  if not shape then
    shape = { base = base, count = count }
    shapes[base][count] = shape
  end
  return shape
end

local function feed_burst(bus, slot, number_in_file, raw, address, id, starts, ends)
  local state = bus.state
  local number = byte(raw, 5)
  local burst = state.burst
  local highest = BURST_IDS[id]
  if number > highest then
    return nil -- FF, or more than the paper's 48 cells, 21 sensors: skipped
  end
  local running = burst
    and burst.id == id
    and burst.address == address
    and starts - burst.ended <= bus.times.burst + GRACE
    and number >= burst.number
    and not (number == burst.number and burst.asked)
  if running and burst.base == 0 and number == highest and id >= 0x95 then
    return nil -- with base 0 the highest number is one less
  end
  local missing, again, request, wait, from
  if running then
    again = number == burst.number or nil
    from = burst.number + 1
  else
    request, wait = answer(bus, number_in_file, address, id, starts)
    local board = state.boards[address]
    burst = {
      id = id,
      address = address,
      base = number == 0 and 0 or 1,
      request = request and request.number,
      count = board and (id == 0x95 and board.cells or id == 0x96 and board.sensors) or nil,
      cells = id == 0x95 and {} or nil,
      whole = true, -- every frame from the base on was seen
    }
    state.burst = burst
    from = burst.base
  end
  if number > from then
    missing = {}
    for i = from, number - 1 do
      missing[#missing + 1] = i
    end
    burst.whole = false
  end
  burst.number, burst.ended, burst.asked, burst.last = number, ends, nil, slot
  local list = burst.cells and note_cells(burst, raw, number)
  local memory = burst.count and shape_of(burst.base, burst.count) or burst
  if missing or again or list then
    memory = { burst = memory, missing = missing, again = again, table = list }
  end
  return burst.request, wait, memory
end

local function feed_reply(bus, slot, number, raw, address, id, starts, ends)
  local state = bus.state
  if BURST_IDS[id] then
    return feed_burst(bus, slot, number, raw, address, id, starts, ends)
  end
  state.burst = nil
  local memory
  if id == 0x90 then
    memory = board_of(state, address).state
  elseif id == 0x93 then
    board_of(state, address).state = byte(raw, 5)
  elseif id == 0x94 then
    local board, cells, sensors = board_of(state, address), byte(raw, 5, 6)
    if cells >= 1 and cells <= MOST_CELLS then
      board.cells = cells
    end
    if sensors >= 1 and sensors <= MOST_SENSORS then
      board.sensors = sensors
    end
  elseif id == 0x98 then
    local board = board_of(state, address)
    memory = board.faults
    board.faults = sub(raw, 5, 12)
  end
  local request, wait = answer(bus, number, address, id, starts)
  return request and request.number, wait, memory
end

--- One A5 frame. `slot`: the frame's own number for the results; `number`: of its packet; `raw`: its 13 bytes;
-- `starts`, `ends`: s; `side`: tells the two sides of a two-port tap apart, or nil; `owner`: the stream it came from.
function M.feed(bus, slot, number, raw, starts, ends, side, owner)
  local address, id = byte(raw, 2, 3)
  local results, state = bus.results, bus.state
  bus.linked = nil
  -- A clock that steps back does not revive a request.
  if starts > state.latest then
    state.latest = starts
  end
  if address >= 0x20 then
    -- Something for every frame: columns without gaps are lists, which take less room and time.
    results.link[slot], results.wait[slot], results.memory[slot] = false, false, false
    local flag = feed_request(bus, slot, number, raw, address, id, starts, ends, side)
    if flag then
      results.flag[slot] = flag
    end
  else
    local request, wait, memory = feed_reply(bus, slot, number, raw, address, id, starts, ends)
    results.link[slot], results.wait[slot], results.memory[slot] = request or false, wait or false, memory or false
  end
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
      linked = bus.linked,
    }
    if #log > MOST_UNCERTAIN then
      bus.mark = nil
    end
  end
end

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
  bus.mark = { owner = owner, state = bus.state, saved = save(bus.state, {}), log = {} }
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
  for i = 1, #mark.log do
    local fed = mark.log[i]
    for _, column in pairs(results) do
      column[fed.slot] = nil
    end
    if fed.linked then
      results.link[fed.linked] = false
    end
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
  bus.state, bus.mark = mark.state, nil
  return others
end

return M
