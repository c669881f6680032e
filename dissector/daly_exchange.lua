-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Who asked whom, and who answered: echo, retry, the request of a reply, and what did not go so well (docs/records.md
-- 6, 7, 10). Pure Lua, no Wireshark. Times are seconds.
--
--   request ----- waits 1 s -----|---- late until 10 s ----|
--           reply: response time        late reply           nobody's

local results_module = require("daly_results")

local M = {}

local byte, sub = string.byte, string.sub
local odd_of, answered = results_module.odd, results_module.answered

--- Differences this small are the arithmetic's (docs/records.md 1).
M.GRACE = 1e-6
local GRACE = M.GRACE

--- Whether a request with this ID writes: restart, the MOS switches, and write = read - 40 of the reads 50..6A.
function M.is_write(id)
  return id == 0x00 or id == 0xD9 or id == 0xDA or (id >= 0x10 and id <= 0x2A)
end
local is_write = M.is_write

-- IDs that answer in several frames which nothing numbers: the fault log, and a written clock.
local UNNUMBERED = { [0x64] = true, [0x21] = true }

-- So many unanswered requests for one ID are remembered, whatever a capture holds.
local MOST_ASKED = 1024

--- A bus's memory of requests.
function M.state()
  return {
    last = {}, -- newest request by its bytes
    remembered = 0,
    asked = {}, -- by ID: requests in order, unanswered ones and some answered: [first .. last]
    any = false, -- a request was seen
    host = nil, -- who asked last, and when that ended
    host_ended = nil,
    latest = -math.huge, -- latest beginning of a frame
    going_on = {}, -- of UNNUMBERED, by ID, address and host: { request = its packet, began = the newest reply, s }
  }
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

-- Of several requests in a list, let go of those that can't be answered any more.
local function let_go(state, list, late)
  local first, last = list.first, list.last
  while first < last do
    local oldest = list[first]
    if not oldest.answered and state.latest - oldest.ended <= late + GRACE and last - first < MOST_ASKED then
      break
    end
    list[first] = nil
    first = first + 1
  end
  list.first = first
end

--- Put a request to those that can be answered (`id`: what they are listed by), and let go of those that can't.
function M.remember(state, id, request, late)
  local list = state.asked[id]
  if not list then
    list = { first = 1, last = 0 }
    state.asked[id] = list
  end
  local last = list.last + 1
  list[last] = request
  list.last = last
  if list.first < last then
    let_go(state, list, late)
  end
end

local remember = M.remember

--- Who asks, by its address: 40..4F are one host, a PC; second whether it is that.
function M.host(address)
  if address >= 0x40 and address <= 0x4F then
    return 0x40, true
  end
  return address, false
end
local host_of = M.host

--- A request. Returns "echo", "retry" or nil; and what is remembered of it, if it is no echo: { board = the one it
-- names, or nil, data = the eight bytes that it writes, or nil, ... }.
function M.ask(bus, slot, number, raw, address, id, starts, ends, side)
  local state, times = bus.state, bus.times
  local flag, request
  local before = state.last[raw]
  if before and before.over then
    -- The same bytes again, and nothing else knows the request before: its table serves again, which is half the work.
    request = before
    request.over = false
    request.echoed = false
    request.slot = slot
    request.number = number
    request.ended = ends
    request.side = side
  elseif before and not before.answered and state.latest - before.ended <= times.reply + GRACE then
    local echo
    if bus.can then
      echo = false -- nothing on CAN hears itself
    elseif side and before.side then
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
  if not request then
    local host, names = host_of(address)
    request = {
      slot = slot,
      number = number,
      ended = ends,
      side = side,
      host = host,
      board = bus.can and byte(raw, 13) or names and address - 0x3F or nil, -- the board it names
      others = not bus.can and (address <= 0x40 or address > 0x4F), -- any board's reply will do
      data = is_write(id) and byte(raw, 4) == 8 and sub(raw, 5, 12) or nil,
      answered = false,
      over = false, -- it is answered (which `answered` does not say) and in no list
      echoed = false,
    }
    if not before then
      state.remembered = state.remembered + 1
      if state.remembered > 512 then
        forget_old(state, state.latest, times.reply + 1)
      end
    end
    state.last[raw] = request
  end
  local list = state.asked[id]
  if list and list.first > list.last then -- what M.remember does, where nobody else waits
    local last = list.last + 1
    list[last] = request
    list.last = last
  else
    remember(state, id, request, times.late)
  end
  local host, other = request.host, state.host
  if host ~= other then
    if other and starts - state.host_ended <= times.reply + GRACE then
      odd_of(bus.results, slot).second_host = true
    end
    state.host = host
    state.any = true
  end
  state.host_ended = ends
  return flag, request
end

-- What the reply to a write says of it.
local function write_result(id, raw, written)
  if id == 0xD9 or id == 0xDA then
    -- The board tells a state, on or off; whoever asked may have sent any byte for on.
    return (byte(raw, 5) ~= 0) == (byte(written) ~= 0) and "confirmed" or "denied"
  elseif id == 0x21 then
    -- A repeat says nothing by its byte 0, which is the year's.
    local first = byte(raw, 5)
    if first > 1 or sub(raw, 5, 12) == written then
      return "answered"
    end
    return first == 1 and "confirmed" or "denied"
  end
  return id ~= 0x00 and sub(raw, 5, 12) == written and "confirmed" or "answered"
end

-- Nobody waits for this reply: say so, where somebody asks on this bus at all. `newest`: the newest request for its ID
-- that still waits, `missed`: the newest that it comes too late for.
local function unasked(bus, slot, number, address, newest, missed)
  if not bus.state.any then
    return
  end
  local odd = odd_of(bus.results, slot)
  odd.unasked = true
  if missed then
    missed.late = number
    odd.late_to = missed.number
  end
  if newest and newest.board and newest.board ~= address and address >= 0x01 and address <= 0x10 then
    odd.other_board = newest.board
  end
end

--- The request that a reply (the first of its burst) belongs to stops waiting. Returns its packet and the response
-- time, each nil where there is none.
function M.answer(bus, slot, number, raw, address, id, starts)
  local state, times = bus.state, bus.times
  local list = state.asked[id]
  local host = bus.can and host_of(byte(raw, 13)) -- the one it is sent to
  local chosen, newest, missed
  for i = list and list.last or 0, list and list.first or 1, -1 do
    local request = list[i]
    if not request.answered then
      local board = request.board
      local fits = board == address or request.others
      if state.latest - request.ended > times.reply + GRACE then
        if fits and not missed and not request.late and starts - request.ended <= times.late + GRACE then
          missed = request
        end
      elseif fits then
        chosen = chosen or i
        if not host or request.host == host then
          chosen = i
          break
        end
      else
        newest = newest or request
      end
    end
  end
  local kind = UNNUMBERED[id] and (id * 256 + address) * 256 + (host or 0)
  if not chosen then
    local before = kind and state.going_on[kind]
    if before and starts - before.began <= times.burst + GRACE then
      before.began = starts
      return before.request, nil
    end
    unasked(bus, slot, number, address, newest, missed)
    return nil, nil
  end
  local request = list[chosen]
  if kind then
    state.going_on[kind] = { request = request.number, began = starts }
  end
  if chosen == list.last then
    list[chosen] = nil
    list.last = chosen - 1
    request.over = true
  else
    request.answered = true
  end
  answered(bus, request.slot, number)
  local board = request.board
  if board ~= address and board and address >= 0x01 and address <= 0x10 then
    odd_of(bus.results, slot).other_board = board
  end
  if request.data and byte(raw, 4) == 8 then
    odd_of(bus.results, slot).result = write_result(id, raw, request.data)
  end
  local wait = starts - request.ended
  if wait < 0 then
    wait = wait > -GRACE and 0.0 or nil
  end
  return request.number, wait
end

--- Whether a request got no reply while it waited, as far as is known by now.
function M.is_unanswered(results, slot)
  local ended = results.ended[slot]
  return ended and results.latest - ended > results.buses[1].times.reply + GRACE
end

return M
