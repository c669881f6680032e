-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Modbus: which frame asks, which answers, and which request a reply belongs to (docs/wires.md 1). Pure Lua, no
-- Wireshark. Times are seconds.
--
--   D2 asks, D2 answers     80+N asks, 50+N answers     03 reads, 06 and 10 write, 83, 86, 90 refuse
--
-- No echoes and no retries; a reply that several requests for different registers wait for is ambiguous.

local exchange = require("daly_exchange")
local results_module = require("daly_results")

local M = {}

local byte = string.byte
local GRACE = exchange.GRACE
local odd_of, answered = results_module.odd, results_module.answered

local D2, ASKS, ANSWERS = 0xD2, 0x80, 0x50
local READ, WRITE_ONE, WRITE_MANY, REFUSES = 0x03, 0x06, 0x10, 0x80

--- The link of a request that is answered, and nobody knows by which reply.
M.SOMEHOW = 0

--- "d2" or "81", of a Modbus address of Daly's.
function M.dialect(address)
  return address == D2 and "d2" or "81"
end

--- The board that an address names, or nil.
function M.board(address)
  if address == D2 then
    return nil
  end
  return address > ASKS and address - ASKS or address - ANSWERS
end

--- Whether a frame is a reply, by its shape; nil where the shape does not tell (D2, write of one).
function M.is_reply(raw)
  local address, fn = byte(raw, 1, 2)
  if address ~= D2 then
    return address < ASKS
  elseif fn == READ then
    return #raw ~= 8
  elseif fn == WRITE_MANY then
    return #raw == 8
  elseif fn == WRITE_ONE then
    return nil
  end
  return true
end

--- The address that a board answers from which is asked, or answers, by this one.
function M.answers_from(address)
  return address > ASKS and address ~= D2 and address - ASKS + ANSWERS or address
end

-- Requests that a reply of this address to this function may belong to: key of the lists in the bus's `asked`, where
-- those of A5 have keys below 100 hex.
local function key_of(address, fn)
  return M.answers_from(address) * 256 + fn
end

local function waits(state, times, request)
  return not request.answered and state.latest - request.ended <= times.reply + GRACE
end

-- Whether a D2 write of one is a reply.
local function answers_write(bus, raw, side)
  local state, times = bus.state, bus.times
  local list = state.asked[key_of(D2, WRITE_ONE)]
  local _, _, a, b, c, d = byte(raw, 1, 6)
  local register, value = a * 256 + b, c * 256 + d
  local same = false
  for i = list and list.last or 0, list and list.first or 1, -1 do
    local request = list[i]
    if request.register == register and waits(state, times, request) then
      if side and request.side then
        return request.side ~= side
      end
      same = same or request.value == value
    end
  end
  return same
end

-- A request begins to wait.
local function ask(bus, slot, number, raw, address, fn, ends, side)
  local state = bus.state
  local _, _, a, b, c, d = byte(raw, 1, 6)
  local request = {
    slot = slot,
    number = number,
    ended = ends,
    side = side,
    register = a * 256 + b,
    count = fn ~= WRITE_ONE and c * 256 + d or nil,
    value = fn == WRITE_ONE and c * 256 + d or nil,
  }
  exchange.remember(state, key_of(address, fn), request, bus.times.late)
  state.modbus_asked = true
end

-- What the reply to a write says of it; nil of a read.
local function write_result(raw, fn, request)
  if fn ~= WRITE_ONE and fn ~= WRITE_MANY then
    return fn > REFUSES + READ and "denied" or nil
  elseif fn == WRITE_ONE then
    local high, low = byte(raw, 5, 6)
    return high * 256 + low == request.value and "confirmed" or "denied"
  end
  return "confirmed"
end

-- The request that a reply belongs to stops waiting. Returns it and the response time, each nil where there is none;
-- and whether several could be it.
local function answer(bus, slot, number, raw, address, fn, starts)
  local state, times = bus.state, bus.times
  local list = state.asked[key_of(address, fn % REFUSES)]
  local _, _, a, b, c, d = byte(raw, 1, 6)
  local register, count = a * 256 + b, c and d and c * 256 + d
  local newest, newest_at, oldest, missed, ambiguous
  for i = list and list.last or 0, list and list.first or 1, -1 do
    local request = list[i]
    local fits = not request.answered
      and (
        fn > REFUSES
        or (fn == READ and request.count * 2 == a)
        or (fn == WRITE_ONE and request.register == register)
        or (fn == WRITE_MANY and request.register == register and request.count == count)
      )
    if fits then
      if waits(state, times, request) then
        if not newest then
          newest, newest_at = request, i
        elseif request.register ~= newest.register then
          ambiguous = true
        end
        oldest = request
      elseif not missed and not request.late and starts - request.ended <= times.late + GRACE then
        missed = request
      end
    end
  end
  if ambiguous then
    oldest.answered = true
    answered(bus, oldest.slot, M.SOMEHOW)
    odd_of(bus.results, slot).ambiguous = true
    return nil, nil, true
  elseif newest then
    newest.answered = true
    if newest_at == list.last then
      list[newest_at] = nil
      list.last = newest_at - 1
    end
    answered(bus, newest.slot, number)
    local result = write_result(raw, fn, newest)
    if result then
      odd_of(bus.results, slot).result = result
    end
    local wait = starts - newest.ended
    if wait < 0 then
      wait = wait > -GRACE and 0.0 or nil
    end
    return newest, wait
  end
  if state.modbus_asked then
    local odd = odd_of(bus.results, slot)
    odd.unasked = true
    if missed then
      missed.late = true
      odd.late_to = missed.number
    end
  end
  return nil
end

--- One frame. Of a request returns nil; of a reply true, the request it belongs to (or nil), and whether it is
-- ambiguous. Writes the frame's links and times.
function M.feed(bus, slot, number, raw, address, fn, starts, ends, side)
  local results = bus.results
  local reply = M.is_reply(raw)
  if reply == nil then
    reply = answers_write(bus, raw, side)
    if reply then
      results.flag[slot] = "reply"
    end
  end
  if not reply then
    results.entries[slot], results.ended[slot] = 0, ends
    ask(bus, slot, number, raw, address, fn, ends, side)
    return nil
  end
  local request, wait, ambiguous = answer(bus, slot, number, raw, address, fn, starts)
  results_module.note_reply(results, slot, request and request.number, wait)
  return true, request, ambiguous
end

return M
