-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- From bytes to records: which good windows are frames, and what the bytes between them are (docs/records.md 3, 4).
-- Pure Lua, no Wireshark.
--
-- A cutter holds the bytes that are not yet a record:
--
--   cutter.buf     |......gap......|bytes a window may still begin in|
--                  ^ cutter.base    ^ cutter.scan
--
-- Positions given out are absolute, from 1 at the stream's first byte.

local windows = require("daly_windows")
local foreign = require("daly_foreign")

local M = {}

local byte, find, sub = string.byte, string.find, string.sub

-- A junk record, and a gap that can be somebody else's traffic, are at most so long.
local LONGEST_RUN = 4096
-- No window is longer (257), so what lies further back than this is decided.
local REACH = 260

-- Whether W, a good A5 window buf[s..e], is a frame: true, false, or nil when the bytes to tell are not there.
-- A window that holds the start of another good one is a frame only if a good frame, or the end, follows (rule 3).
local function stands(buf, s, e, n, final)
  local inner_good, inner_open = false, false
  local q = find(buf, "\xA5", s + 1, true)
  while q and q <= e do
    local good, _, open = windows.window(buf, q, n)
    inner_good = inner_good or good ~= nil
    inner_open = inner_open or (open and not final)
    q = find(buf, "\xA5", q + 1, true)
  end
  if not inner_good and not inner_open then
    return true
  end
  if e == n then
    if final then
      return true
    end
    return nil
  end
  local follows, _, open = windows.window(buf, e + 1, n)
  if follows then
    return true
  elseif (open or inner_open) and not final then
    -- An inner window that is good and nothing that follows yet; or one that is open: both may turn.
    if inner_good and not open then
      return false
    end
    return nil
  end
  return false
end

-- The next frame in buf[from..n]: first position, last position, dialect. Or nil, the position before which no window
-- can begin any more, and whether a good window waits for its neighbour's bytes.
local function next_frame(buf, from, n, final)
  local refused
  while true do
    local s, e, dialect, hold
    local p = find(buf, windows.STARTS, from)
    while p and (not e or p + 4 < e) do
      local stop, kind, open = windows.window(buf, p, n)
      if stop then
        if not (refused and refused[p]) and (not e or stop < e) then
          s, e, dialect = p, stop, kind
        end
      elseif open and not hold then
        hold = p
      end
      p = find(buf, windows.STARTS, p + 1)
    end
    if not e then
      return nil, hold or n + 1, false
    end
    if dialect ~= "a5" then
      return s, e, dialect
    end
    local verdict = stands(buf, s, e, n, final)
    if verdict then
      return s, e, dialect
    elseif verdict == nil then
      return nil, (hold and hold < s) and hold or s, true
    end
    refused = refused or {}
    refused[s] = true
  end
end

-- One junk run buf[first..last], divided at events and at 4096 bytes.
local function junk(out, base, first, last, cuts)
  while first <= last do
    local stop = math.min(last, first + LONGEST_RUN - 1)
    for i = 1, #cuts do
      local cut = cuts[i] - base + 1 -- the byte before which the event lies
      if cut > first and cut <= stop then
        stop = cut - 1
        break
      end
    end
    out[#out + 1] = { kind = "junk", first = base + first - 1, last = base + stop - 1 }
    first = stop + 1
  end
end

-- Cut buf[first..last], no part of which is a frame, from the left. `stop` is where to leave off (last, or further left
-- when the end of the gap is not known); returns the position reached.
local function carve(out, buf, base, first, last, cuts, stop)
  local run, p = first, first
  while p <= stop do
    local q = find(buf, windows.STARTS, p)
    if not q or q > stop then
      break
    end
    p = q + 1
    if byte(buf, q) == 0xA5 then
      if q + 3 <= last and byte(buf, q + 3) == 8 then
        junk(out, base, run, q - 1, cuts)
        if q + 12 <= last then
          out[#out + 1] = { kind = "bad_checksum", first = base + q - 1, last = base + q + 11 }
          run, p = q + 13, q + 13
        else
          out[#out + 1] = { kind = "short", first = base + q - 1, last = base + last - 1 }
          run, p = last + 1, last + 1
        end
      end
    elseif q < last then
      local good, _, open = windows.window(buf, q, last)
      if open and not good then
        junk(out, base, run, q - 1, cuts)
        out[#out + 1] = { kind = "short", first = base + q - 1, last = base + last - 1 }
        run, p = last + 1, last + 1
      end
    end
  end
  if run <= stop then
    junk(out, base, run, stop, cuts)
    run = stop + 1
  end
  return run
end

-- The gap buf[first..last] as records. `known` is false for the rest of a gap whose beginning was given out already.
local function gap(out, buf, base, first, last, cuts, known)
  local open, at, piece = first, first, known
  local borders = {}
  for i = 1, #cuts do
    local cut = cuts[i] - base + 1
    if cut > first and cut <= last and cut ~= borders[#borders] then
      borders[#borders + 1] = cut
    end
  end
  borders[#borders + 1] = last + 1
  for i = 1, #borders do
    local stop = borders[i] - 1
    local name = piece and stop - at + 1 <= LONGEST_RUN and foreign.name(buf, at, stop)
    if name then
      if open < at then
        carve(out, buf, base, open, at - 1, cuts, at - 1)
      end
      out[#out + 1] = { kind = "foreign", first = base + at - 1, last = base + stop - 1, name = name }
      open = stop + 1
    end
    at, piece = stop + 1, true
  end
  if open <= last then
    carve(out, buf, base, open, last, cuts, last)
  end
end

local function gap_of(out, buf, base, first, last, cuts, known)
  -- window() must not look behind the gap: what follows is a frame's.
  if last < #buf then
    buf = sub(buf, 1, last)
  end
  gap(out, buf, base, first, last, cuts, known)
end

--- Whether a good Modbus window that begins at p is the Bluetooth module's own: function 10, register 0F05.
function M.is_modules(buf, p)
  local fn, high, low = byte(buf, p + 1, p + 3)
  return fn == 0x10 and high == 0x0F and low == 0x05
end

--- Whether a record is damaged bytes, in which a frame may have been lost.
function M.is_damage(record)
  local kind = record.kind
  return kind == "junk" or kind == "short" or kind == "bad_checksum"
end

--- A cutter for one stream.
function M.new()
  return { buf = "", base = 1, scan = 1, cuts = {}, known = true, waiting = false }
end

--- An event lies at the present end of the stream.
function M.event(cutter)
  if cutter.buf ~= "" then
    cutter.cuts[#cutter.cuts + 1] = cutter.base + #cutter.buf
  end
end

--- Take what has become certain. `data`: new bytes; `final`: the segment ends behind them (silence, or the end);
-- `decide`: a good window waits for no neighbour (docs/wires.md 4).
-- Returns a list of { kind, first, last, dialect, name }; cutter.waiting tells whether a good window is held back.
function M.take(cutter, data, final, decide)
  local buf = cutter.buf .. data
  local base, n, start, scan = cutter.base, #buf, 1, cutter.scan
  local cuts, known, out = cutter.cuts, cutter.known, {}
  cutter.waiting = false
  while start <= n do
    local s, e, dialect = next_frame(buf, scan, n, final or decide)
    if not s then
      scan, cutter.waiting = e, dialect
      break
    end
    if s > start then
      gap_of(out, buf, base, start, s - 1, cuts, known)
    end
    known = true
    if dialect ~= "a5" and M.is_modules(buf, s) then
      out[#out + 1] = { kind = "foreign", first = base + s - 1, last = base + e - 1, name = "Bluetooth module" }
    else
      out[#out + 1] = { kind = "frame", first = base + s - 1, last = base + e - 1, dialect = dialect }
    end
    start, scan = e + 1, e + 1
  end
  if final and start <= n then
    gap_of(out, buf, base, start, n, cuts, known)
    start, known = n + 1, true
  elseif scan - start > LONGEST_RUN + REACH then
    -- A long gap is given out while it lasts: all but what its end may still turn into something else.
    local reached = carve(out, buf, base, start, n, cuts, scan - REACH)
    start, known = reached, false
  end
  cutter.buf = sub(buf, start)
  cutter.base = base + start - 1
  cutter.scan = math.max(1, scan - start + 1)
  cutter.known = known
  if #cuts > 0 and cuts[1] < cutter.base then
    local left = {}
    for i = 1, #cuts do
      if cuts[i] > cutter.base then
        left[#left + 1] = cuts[i]
      end
    end
    cutter.cuts = left
  end
  return out
end

--- What the bytes that are held would be if the stream ended here; nothing is taken.
function M.peek(cutter)
  local copy = {
    buf = cutter.buf,
    base = cutter.base,
    scan = cutter.scan,
    cuts = cutter.cuts,
    known = cutter.known,
  }
  return M.take(copy, "", true)
end

--- The records of some bytes that nothing came before or after.
function M.alone(bytes)
  local items = M.take(M.new(), bytes, true)
  for i = 1, #items do
    local item = items[i]
    item.at, item.length, item.slot = item.first - 1, item.last - item.first + 1, i
  end
  return items
end

--- Some bytes by themselves, as a gap of their own: what is shown of held bytes before it is certain.
function M.as_gap(bytes, base)
  local out = {}
  gap(out, bytes, base, 1, #bytes, {}, true)
  return out
end

return M
