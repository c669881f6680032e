-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Bytes of a bus in a TCP connection, as serial servers carry them (raw mode of ser2net, ESP-Link, EW11).
--
-- Wireshark's TCP puts segments in order and leaves out what came twice; we take whole records and ask for one more
-- segment when a frame may still be incomplete. Time decides nothing here: what arrives when is the network's doing. A
-- connection is one bus; its two directions are two sides of it.

local records = require("daly_records")
local bus_module = require("daly_bus")
local streams = require("daly_streams")
local view = require("daly_view")
local windows = require("daly_windows")

local M = {}

local ONE_MORE_SEGMENT = 0x0FFFFFFF -- DESEGMENT_ONE_MORE_SEGMENT, which not every version gives Lua

local stream_number, segment_length, sequence = Field.new("tcp.stream"), Field.new("tcp.len"), Field.new("tcp.seq")
local SEQUENCES = 2 ^ 32

local capture -- options, buses by connection, results by slot (see daly_streams)
local slots -- of frames, see feed()
local held -- by bus and side: bytes that were undecided, and when they came; see begins()
local fronts -- by packet: { raw = what we were handed, bytes = what we had kept in front of it }; see before_of()
local damaged -- by bus and side: whether the newest record is damaged

--- Begin a capture. `with`: see daly_streams.capture.
function M.init(with)
  capture = streams.capture(with)
  slots, held, fronts, damaged = {}, {}, {}, {}
end

-- The bus of the connection, the same for both directions, and which end sent this packet. Wireshark numbers them,
-- and begins a new one where the same ends connect again; it says so only where it makes a tree in the first pass.
local function bus_of(pinfo)
  local from = tostring(pinfo.src) .. " " .. pinfo.src_port
  local to = tostring(pinfo.dst) .. " " .. pinfo.dst_port
  local name, side = from .. " " .. to, 0
  if to < from then
    name, side = to .. " " .. from, 1
  end
  local stream = stream_number()
  if stream then
    name = stream.value
  end
  local bus = capture.buses[name]
  if not bus then
    bus = bus_module.new(capture.options, capture.results)
    capture.buses[name] = bus
  end
  return bus, side
end

-- The records that are decided, and how many bytes at the end are not: those of a gap whose end may still become a
-- frame. A good frame does not wait for its neighbour (docs/wires.md 4).
local function cut(raw)
  local cutter = records.new()
  local found = records.take(cutter, raw, false, true)
  if cutter.scan > #cutter.buf then
    local rest = records.take(cutter, "", true)
    for i = 1, #rest do
      found[#found + 1] = rest[i]
    end
  end
  for i = 1, #found do
    found[i].at, found[i].length = found[i].first - 1, found[i].last - found[i].first + 1
  end
  return found, #cutter.buf
end

-- Wireshark 4.6 (4.4 does not) forgets a byte with which we began to wait for more when a keep-alive, a segment of the
-- last byte alone, tells it again, and then no longer puts segments in order. So such a byte we keep ourselves.
local major, minor = get_version():match("^(%d+)%.(%d+)")
local forgets = tonumber(major) * 100 + tonumber(minor) >= 405

-- What was undecided in this direction and stands in front of `raw` or at its beginning, if anything; and the sequence
-- number behind `raw`. Wireshark hands such bytes to us again, as if they came with the next segment, but not those
-- that we kept, nor where bytes between were lost. A segment that tells them again, and more, is no longer than what
-- we are handed then: so where it begins decides.
local function before_of(bus, side, raw)
  local before = held[bus] and held[bus][side]
  local length, at = segment_length(), sequence()
  local begin = length and at and at.value + math.max(0, length.value - #raw)
  if before then
    local known = before.bytes:sub(before.kept + 1)
    local first = before.next and (before.next - #known) % SEQUENCES
    if known == "" then
      if not begin or begin ~= before.next then
        before = nil
      end
    elseif raw:sub(1, #known) ~= known or length and length.value == #raw and begin ~= first then
      before = nil
    else
      begin = first
    end
  end
  return before, begin and (begin + #raw) % SEQUENCES
end

-- When each byte of `raw` came: a list of { at = position, time }. `before`: what was undecided and stands in it first;
-- `left`: how many bytes at its end are undecided now; `keep`: how many of `raw`, from its first, we keep ourselves;
-- `next`: the sequence number behind it.
local function begins(bus, side, raw, before, left, keep, next, time)
  local sides, times = held[bus] or {}, before and before.times or {}
  held[bus], sides[side] = sides, nil
  times[#times + 1] = { at = before and #before.bytes or 0, time = time }
  if left > 0 then
    local first, still = #raw - left, {}
    for i = 1, #times do
      local until_at = times[i + 1] and times[i + 1].at or #raw
      if until_at > first then
        still[#still + 1] = { at = math.max(0, times[i].at - first), time = times[i].time }
      end
    end
    sides[side] = { bytes = raw:sub(first + 1), times = still, kept = math.max(0, keep - first), next = next }
  end
  return times
end

-- Tell the bus, where it is given, about the frames among these records; they get their slots. What Wireshark hands us
-- at once may be cut otherwise when a packet is looked at again, so a frame is known by its packet, its bytes and its
-- place among equals.
local function feed(items, raw, pinfo, bus, side, times)
  local number, results = pinfo.number, capture.results
  results.latest = math.max(results.latest, pinfo.rel_ts)
  local behind
  if bus then
    damaged[bus] = damaged[bus] or {}
    behind = damaged[bus][side]
  end
  local seen = {}
  for i = 1, #items do
    local item = items[i]
    if item.kind == "frame" then
      local bytes = raw:sub(item.at + 1, item.at + item.length)
      seen[bytes] = (seen[bytes] or 0) + 1
      local key = number .. " " .. seen[bytes] .. " " .. bytes
      if not slots[key] and bus then
        capture.slots = capture.slots - 1
        slots[key] = capture.slots
        local began = 1
        while times[began + 1] and times[began + 1].at <= item.at do
          began = began + 1
        end
        bus_module.feed(bus, slots[key], number, bytes, times[began].time, pinfo.rel_ts, side, capture, behind)
      end
      item.slot = slots[key] or 0
    end
    behind = records.is_damage(item)
  end
  if bus then
    damaged[bus][side] = behind
  end
end

--- Dissect bytes of a connection. `handle`: our protocol's dissector. Returns how many bytes were taken.
function M.dissect(buffer, pinfo, parent, handle)
  local raw = buffer:raw()
  local length = #raw
  if length == 0 then
    return 0
  end
  local bus, side, before, behind, front
  local keep = 0
  if pinfo.visited then
    local known = next(fronts) and fronts[pinfo.number]
    local both = known and math.min(length, #known.raw) -- of what waits for more, a second look has nothing
    front = known and raw:sub(1, both) == known.raw:sub(1, both) and known.bytes
  else
    bus, side = bus_of(pinfo)
    before, behind = before_of(bus, side, raw)
    keep = before and before.kept or 0
    if keep > 0 then
      front = before.bytes:sub(1, keep)
      fronts[pinfo.number] = { raw = raw, bytes = front }
    end
  end
  if front then
    raw = front .. raw
    buffer = ByteArray.new(raw, true):tvb("With the bytes before")
  end
  local items, left = cut(raw)
  if left > 0 then
    if forgets and math.min(left, length) == 1 and (sequence() or pinfo.visited) then
      keep = #raw
    elseif pinfo.can_desegment > 0 then
      pinfo.desegment_offset = math.max(0, length - left)
      pinfo.desegment_len = ONE_MORE_SEGMENT
    else
      items, left = records.alone(raw), 0
    end
  end
  feed(items, raw, pinfo, bus, side, bus and begins(bus, side, raw, before, left, keep, behind, pinfo.rel_ts))
  if #items == 0 then
    return length
  end
  view.look(parent, handle, capture.results, pinfo.visited, "tcp")
  view.several(parent, buffer, raw, items, pinfo)
  return length
end

--- Whether these bytes look like a bus: they begin with a good A5 frame, and go on with another or end.
function M.looks_like(buffer)
  local raw = buffer:raw()
  local length = #raw
  if length < 13 or raw:byte() ~= 0xA5 then
    return false
  end
  local stop = windows.window(raw, 1, length)
  if stop ~= 13 then
    return false
  end
  return length == 13 or raw:byte(14) == 0xA5
end

return M
