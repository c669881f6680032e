-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Packets in, records out: which records end in which packet, however the stream was cut (docs/records.md 1 to 4, 10).
-- Pure Lua, no Wireshark: a packet is a number, a time (s) and a string.
--
-- The capture is read once in order (`first`); what was found is kept, and packets can then be looked up in any order
-- (`plan`). An ordinary packet - one whole frame, nothing held before or behind it - keeps nothing here at all.
--
-- A plan is what a packet shows. Its items, in order:
--
--   { kind =, at =, length =, dialect =, name =, slot =, bytes =, since = }
--       a record that ends here; at: offset in the packet (0: its first byte); one that began in an earlier packet has
--       its whole `bytes`, and `since`, the number of that packet
--   { part = number, at =, length = }   bytes of a record that ends in packet `number`

local records = require("daly_records")
local windows = require("daly_windows")
local bus_module = require("daly_bus")
local results_module = require("daly_results")

local M = {}

local byte, find, sub = string.byte, string.find, string.sub
local feed_bus = bus_module.feed

-- Bytes that make a good A5 frame less than clear, where they stand inside it: the start of another; a Modbus function,
-- with an address before it.
local INNER_A5 = 0xA5
local MODBUS_FUNCTIONS = { [0x03] = true, [0x06] = true, [0x10] = true, [0x83] = true, [0x86] = true, [0x90] = true }
local INNER_MODBUS = "[\xD2\x51-\x60\x81-\x90][\x03\x06\x10\x83\x86\x90]"

-- Whether a good A5 frame of these bytes holds no beginning of another frame. Comparisons, since searching all frames
-- with patterns took a sixth of the time of a packet list; the pattern decides in the few that have a function's byte.
local function is_clear(raw, b, c, e, f, g, h, i, j, k, l, sum)
  if
    e == INNER_A5
    or f == INNER_A5
    or g == INNER_A5
    or h == INNER_A5
    or i == INNER_A5
    or j == INNER_A5
    or k == INNER_A5
    or l == INNER_A5
    or sum == INNER_A5
    or b == INNER_A5
    or c == INNER_A5
  then
    return false
  end
  local functions = MODBUS_FUNCTIONS
  if
    functions[f]
    or functions[g]
    or functions[h]
    or functions[i]
    or functions[j]
    or functions[k]
    or functions[l]
    or functions[sum]
    or functions[c] and b > 0x50
  then
    return not find(raw, INNER_MODBUS, 2)
  end
  return true
end

-- Packets that were found to be one frame, good and clear: most come again, byte for byte. Not more than so many.
local MOST_CLEAR = 4096
local clear, clear_count = {}, 0

local function keep_clear(raw)
  if clear_count >= MOST_CLEAR then
    clear, clear_count = {}, 0
  end
  clear[raw], clear_count = true, clear_count + 1
end

-- Whether 13 bytes are a good A5 frame that holds no beginning of another.
local function is_clear_frame(raw)
  local a, b, c, d, e, f, g, h, i, j, k, l, sum = byte(raw, 1, 13)
  if
    a ~= 0xA5
    or d ~= 8
    or (a + b + c + d + e + f + g + h + i + j + k + l) % 256 ~= sum
    or not is_clear(raw, b, c, e, f, g, h, i, j, k, l, sum)
  then
    return false
  end
  keep_clear(raw)
  return true
end

-- The same of a Modbus frame of a board.
local function is_one_modbus(raw, length)
  local first, fn = byte(raw, 1, 2)
  if first == INNER_A5 or not MODBUS_FUNCTIONS[fn] or windows.window(raw, 1, length) ~= length then
    return false
  end
  if find(raw, "\xA5..\8", 2) or find(raw, INNER_MODBUS, 2) or records.is_modules(raw, 1) then
    return false
  end
  keep_clear(raw)
  return true
end

--- Everything known of one capture. `options`: baud; quiet, echo, reply, late, slow, burst, age in seconds; tolerances:
-- cell_tolerance (mV), temperature_tolerance (C), sum_tolerance, soc_tolerance (%).
function M.capture(options)
  clear, clear_count = {}, 0 -- what is a frame depends on the preferences
  return {
    options = options,
    byte_time = 10 / options.baud,
    streams = {}, -- by key
    buses = {}, -- by name
    plans = {}, -- by packet number
    results = results_module.new(),
    slots = 0, -- slots given to frames that are not a packet's only content, counted down from -1
  }
end

local function bus_of(capture, name)
  local bus = capture.buses[name]
  if not bus then
    bus = bus_module.new(capture.options, capture.results)
    capture.buses[name] = bus
  end
  return bus
end

--- The stream of one interface and direction. `side`: tells the sides of a two-port tap apart, or nil.
function M.stream(capture, key, bus_name, side)
  local stream = capture.streams[key]
  if not stream then
    stream = {
      cutter = records.new(),
      bus = bus_of(capture, bus_name),
      side = side,
      packets = {}, -- those with bytes in the cutter, oldest first: { number, time, first, last, plan }
      ended = nil, -- when the last packet's last byte ended
      total = 0, -- bytes so far
      tentative = nil, -- items, by position, of frames that are fed but not certain
      damaged_to = nil, -- position behind the newest damaged record, and of the newest record beside the stream
      aside_at = nil,
    }
    capture.streams[key] = stream
  end
  return stream
end

-- The packet in which a position lies, and its index.
local function packet_at(packets, position, from)
  for i = from or 1, #packets do
    if position <= packets[i].last then
      return packets[i], i
    end
  end
end

-- Longest junk record (docs/records.md 4).
local LONGEST_RUN = 4096

-- Append an item. A long gap may be given out in the middle of a packet: its two pieces of junk are shown as one.
local function append(items, item)
  local before = items[#items]
  if
    before
    and before.kind == "junk"
    and item.kind == "junk"
    and before.at + before.length == item.at
    and before.length + item.length <= LONGEST_RUN
  then
    items[#items] = { kind = "junk", at = before.at, length = before.length + item.length }
  else
    items[#items + 1] = item
  end
end

local function put(plan, list, item)
  plan[list] = plan[list] or {}
  append(plan[list], item)
end

-- Lay one record out over the packets it lies in; returns the item of the packet in which it ends.
local function lay_out(stream, record, list, held, held_base)
  local packets = stream.packets
  local packet, index = packet_at(packets, record.first)
  if record.last <= packet.last then
    local item = {
      kind = record.kind,
      dialect = record.dialect,
      name = record.name,
      at = record.first - packet.first,
      length = record.last - record.first + 1,
    }
    put(packet.plan, list, item)
    return item, packet, packet
  end
  local divided = record.kind == "junk" or record.kind == "short"
  local final, final_index = packet_at(packets, record.last, index)
  local item
  for i = index, final_index do
    local here = packets[i]
    local first, last = math.max(record.first, here.first), math.min(record.last, here.last)
    if first <= last then
      local piece = { at = first - here.first, length = last - first + 1 }
      if divided then
        piece.kind = record.kind
      elseif here ~= final then
        piece.part = final.number
      else
        piece.kind, piece.dialect, piece.name = record.kind, record.dialect, record.name
        piece.since = packet.number
        piece.bytes = sub(held, record.first - held_base + 1, record.last - held_base + 1)
      end
      put(here.plan, list, piece)
      item = piece
    end
  end
  return item, packet, final
end

local function new_slot(capture)
  capture.slots = capture.slots - 1
  return capture.slots
end

local function feed(stream, frame)
  local raw, starts, ends = frame.raw, frame.starts, frame.ends
  feed_bus(stream.bus, frame.slot, frame.number, raw, starts, ends, stream.side, stream, frame.damaged)
end

-- Lay out records; returns the frames among them, to be fed, and the position behind the last damaged one.
local function settle(capture, stream, found, list, held, held_base)
  local frames, byte_time = {}, capture.byte_time
  local damaged_to = stream.damaged_to
  for i = 1, #found do
    local record = found[i]
    local item, from, to = lay_out(stream, record, list, held, held_base)
    if record.kind == "frame" then
      local known = stream.tentative and stream.tentative[record.first]
      item.slot = known and known.slot or new_slot(capture)
      frames[#frames + 1] = {
        first = record.first,
        slot = item.slot,
        number = to.number,
        raw = sub(held, record.first - held_base + 1, record.last - held_base + 1),
        starts = from.time + (record.first - from.first) * byte_time,
        ends = to.time + (record.last - to.first + 1) * byte_time,
        known = known ~= nil,
        damaged = damaged_to == record.first and stream.aside_at ~= record.first,
      }
    elseif records.is_damage(record) then
      damaged_to = record.last + 1
    end
  end
  return frames, damaged_to
end

-- Packets whose bytes are all settled are done.
local function drop_settled(stream)
  local packets, base = stream.packets, stream.cutter.base
  local done = 0
  while packets[done + 1] and packets[done + 1].last < base do
    local plan = packets[done + 1].plan
    plan.open, plan.held, plan.guess = nil, nil, nil
    done = done + 1
  end
  if done > 0 then
    local left = {}
    for i = done + 1, #packets do
      left[#left + 1] = packets[i]
    end
    stream.packets = left
  end
end

-- Tell the bus again what others told it, from others[from] to packet `until_packet`. Returns the next one's place.
local function feed_again(bus, others, from, until_packet)
  while others and others[from] and others[from].number < until_packet do
    local o = others[from]
    feed_bus(bus, o.slot, o.number, o.raw, o.starts, o.ends, o.side, o.owner, o.damaged)
    from = from + 1
  end
  return from
end

-- Take what is certain after `data`, lay it out, and tell the bus. What is held shows provisionally.
local function advance(capture, stream, data, final)
  local cutter = stream.cutter
  local held, held_base = cutter.buf .. data, cutter.base
  local found = records.take(cutter, data, final)
  local frames
  frames, stream.damaged_to = settle(capture, stream, found, "items", held, held_base)
  local certain = #frames
  local uncertain = cutter.waiting and records.peek(cutter) or nil
  -- What was shown provisionally of bytes that are still held is shown anew.
  for i = 1, #stream.packets do
    local packet = stream.packets[i]
    if packet.last >= cutter.base and (uncertain or packet.first < cutter.base or packet.plan.guess) then
      packet.plan.held = nil
    end
  end
  if uncertain then
    local more = settle(capture, stream, uncertain, "held", held, held_base)
    for i = 1, #more do
      frames[#frames + 1] = more[i]
    end
  end
  for i = 1, #stream.packets do
    local packet = stream.packets[i]
    packet.plan.guess = uncertain ~= nil or nil
    if not uncertain and packet.last >= cutter.base and not packet.plan.held then
      local first = math.max(packet.first, cutter.base)
      local bytes = sub(cutter.buf, first - cutter.base + 1, packet.last - cutter.base + 1)
      local shown = records.as_gap(bytes, first)
      for k = 1, #shown do
        put(packet.plan, "held", {
          kind = shown[k].kind,
          name = shown[k].name,
          at = shown[k].first - packet.first,
          length = shown[k].last - shown[k].first + 1,
        })
      end
    end
  end
  -- The bus: what was fed before as uncertain stands if it comes again, first and in the same order.
  local fed, others = 0, nil
  local tentative = stream.tentative
  if tentative then
    local same = #frames >= tentative.count
    for i = 1, tentative.count do
      same = same and frames[i] and frames[i].known and frames[i].first == tentative.order[i]
    end
    if same then
      fed = tentative.count
      if certain >= fed then
        bus_module.confirm(stream.bus, stream)
      end
    else
      others = bus_module.rewind(stream.bus, stream)
      if others then
        for i = 1, #frames do
          frames[i].known = false
        end
      end
    end
    stream.tentative = nil
  end
  local next_other = 1
  for i = fed + 1, #frames do
    next_other = feed_again(stream.bus, others, next_other, frames[i].number)
    if i == certain + 1 then
      bus_module.mark(stream.bus, stream)
    end
    if not frames[i].known then
      feed(stream, frames[i])
    end
  end
  feed_again(stream.bus, others, next_other, math.huge)
  if #frames > certain then
    local kept = { count = #frames - certain, order = {} }
    for i = certain + 1, #frames do
      kept.order[i - certain] = frames[i].first
      kept[frames[i].first] = frames[i]
    end
    stream.tentative = kept
  end
  drop_settled(stream)
end

local function close(capture, stream)
  if stream.cutter.buf ~= "" then
    for i = 1, #stream.packets do
      stream.packets[i].plan.held = nil
    end
    advance(capture, stream, "", true)
  end
end

--- What comes next does not follow what came before: as after silence.
function M.divide(capture, stream)
  close(capture, stream)
end

--- Whether the stream ends in what may still become a frame.
function M.is_open(stream)
  return stream.cutter.scan <= #stream.cutter.buf
end

--- Bytes that are a foreign record by themselves, and no part of the stream; they divide it as an event does.
function M.aside(capture, stream, number, time, raw, name)
  capture.results.latest = math.max(capture.results.latest, time)
  local cutter = stream.cutter
  records.event(cutter)
  stream.aside_at = cutter.base + #cutter.buf
  capture.plans[number] = { items = { { kind = "foreign", name = name, at = 0, length = #raw } } }
end

--- One packet, in the order of the capture, once. `raw`: its bytes ("": an event). Returns true when it is one whole
-- frame and nothing else, whose slot is then `number`; else look at M.plan.
function M.first(capture, stream, number, time, raw)
  local length = #raw
  local cutter, results = stream.cutter, capture.results
  if time > results.latest then
    results.latest = time
  end
  if length == 0 then
    records.event(cutter)
    capture.plans[number] = { items = { { kind = "event", at = 0, length = 0 } } }
    return false
  end
  local byte_time = capture.byte_time
  local ended = stream.ended
  if ended and time - ended > capture.options.quiet + 1e-6 then
    close(capture, stream)
  end
  local ends = time + length * byte_time
  stream.ended = ends
  if cutter.buf == "" and (clear[raw] or length == 13 and is_clear_frame(raw) or is_one_modbus(raw, length)) then
    local base, damaged = cutter.base, stream.damaged_to
    damaged = damaged and damaged == base and stream.aside_at ~= base
    feed_bus(stream.bus, number, number, raw, time, ends, stream.side, stream, damaged)
    cutter.base = base + length
    return true
  end
  local first = cutter.base + #cutter.buf
  local plan = { open = stream }
  capture.plans[number] = plan
  stream.packets[#stream.packets + 1] = {
    number = number,
    time = time,
    first = first,
    last = first + length - 1,
    plan = plan,
  }
  advance(capture, stream, raw, false)
  return false
end

--- What a packet shows: its items, those of bytes whose fate is not certain last. nil: one whole frame.
-- `again`: the capture was read to its end; what is still held is shown as if the stream ended with it.
function M.plan(capture, number, again)
  local plan = capture.plans[number]
  if not plan then
    return nil
  end
  local stream = plan.open
  if again and stream and not stream.cutter.waiting and stream.peeked ~= stream.cutter.base + #stream.cutter.buf then
    stream.peeked = stream.cutter.base + #stream.cutter.buf
    for i = 1, #stream.packets do
      stream.packets[i].plan.held = nil
    end
    settle(capture, stream, records.peek(stream.cutter), "held", stream.cutter.buf, stream.cutter.base)
  end
  local items, held = plan.items, plan.held
  if not held then
    return items or {}
  elseif not items then
    return held
  end
  local all = {}
  for i = 1, #items do
    all[i] = items[i]
  end
  for i = 1, #held do
    append(all, held[i])
  end
  return all
end

return M
