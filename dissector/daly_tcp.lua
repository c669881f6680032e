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

local capture -- options, buses by connection, results by slot (see daly_streams)
local slots -- of frames, see feed()

--- Begin a capture. `with`: see daly_streams.capture.
function M.init(with)
  capture = streams.capture(with)
  slots = {}
end

-- The bus of the connection, the same for both directions, and which end sent this packet.
local function bus_of(pinfo)
  local from = tostring(pinfo.src) .. " " .. pinfo.src_port
  local to = tostring(pinfo.dst) .. " " .. pinfo.dst_port
  local name, side = from .. " " .. to, 0
  if to < from then
    name, side = to .. " " .. from, 1
  end
  local bus = capture.buses[name]
  if not bus then
    bus = bus_module.new(capture.options, capture.results)
    capture.buses[name] = bus
  end
  return bus, side
end

-- The records that are whole, and how many bytes at the end may begin one that is not.
local function cut(raw)
  local cutter = records.new()
  local found = records.take(cutter, raw, false)
  local held = #raw - (cutter.base + cutter.scan - 1) + 1
  if cutter.waiting then
    -- A good frame that only waits to see its neighbour: it is one unless more comes.
    return records.alone(raw), 0
  end
  if cutter.base <= #raw - held then
    local before = records.as_gap(raw:sub(cutter.base, #raw - held), cutter.base)
    for i = 1, #before do
      found[#found + 1] = before[i]
    end
  end
  for i = 1, #found do
    found[i].at, found[i].length = found[i].first - 1, found[i].last - found[i].first + 1
  end
  return found, held
end

-- Tell the bus, once, about the frames among these records; they get their slots. What Wireshark hands us at once may
-- be cut otherwise when a packet is looked at again, so a frame is known by its packet, its bytes and its place among
-- equals.
local function feed(items, raw, pinfo)
  local number, bus, side = pinfo.number, nil, nil
  local results = capture.results
  results.latest = math.max(results.latest, pinfo.rel_ts)
  local seen = {}
  for i = 1, #items do
    local item = items[i]
    if item.kind == "frame" then
      local bytes = raw:sub(item.at + 1, item.at + item.length)
      seen[bytes] = (seen[bytes] or 0) + 1
      local key = number .. " " .. seen[bytes] .. " " .. bytes
      if not slots[key] and not pinfo.visited then
        capture.slots = capture.slots - 1
        slots[key] = capture.slots
        if not bus then
          bus, side = bus_of(pinfo)
        end
        bus_module.feed(bus, slots[key], number, bytes, pinfo.rel_ts, pinfo.rel_ts, side, capture)
      end
      item.slot = slots[key] or 0
    end
  end
end

--- Dissect bytes of a connection. `handle`: our protocol's dissector. Returns how many bytes were taken.
function M.dissect(buffer, pinfo, parent, handle)
  local raw = buffer:raw()
  local length = #raw
  if length == 0 then
    return 0
  end
  local items, held = cut(raw)
  if held > 0 then
    if pinfo.can_desegment > 0 then
      pinfo.desegment_offset = length - held
      pinfo.desegment_len = ONE_MORE_SEGMENT
    else
      items = records.alone(raw)
    end
  end
  if #items == 0 then
    return length
  end
  feed(items, raw, pinfo)
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
