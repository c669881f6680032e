-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- The eight data bytes of a reply, by data ID (paper, section 3; others: daly_settings): as fields of the tree, and as
-- words for the Info column. All numbers of several bytes are big-endian.
--
--   M.show[id](frame, out, from)   adds the fields; from: packet of the record before, of a changed 0x98
--   M.words[id](frame)             returns the words
--   M.show_write, M.write_words    the same of a request that writes
--
-- `frame` = { raw = its 13 bytes, memory = what the bus remembered for it, table = list of all cells or sensors of its
-- burst, text = all of its burst, or nil }; data byte 0 is the fifth byte of raw. `out` adds:
--
--   out.bytes(field, byte, length, unit)            the bytes as they are
--   out.value(field, byte, length, value, unit)     a value computed from them
--   out.made(field, value, unit)                    a generated one
--   out.cell, out.made_cell                         the same for a cell's voltage, mV

local fields = require("daly_fields").fields
local STATE = require("daly_fields").STATE
local faults = require("daly_faults")
local bursts = require("daly_bursts")
local quantities = require("daly_quantities")
local settings = require("daly_settings")

local M = { show = {}, words = {} }
local show, words = M.show, M.words

local byte, format, floor, concat = string.byte, string.format, math.floor, table.concat
local printable = quantities.printable

local function state_name(state)
  return STATE[state] or format("state %d", state)
end

-- Numbers as text, made once: formatting all of a packet's took a fifth of the time of a packet list. At most 65536.
local whole_text, tenth_text = {}, {}

local function whole(value)
  local text = whole_text[value]
  if not text then
    text = format("%d", value)
    whole_text[value] = text
  end
  return text
end

-- A raw number of two bytes, in tenths.
local function tenths(raw)
  local text = tenth_text[raw]
  if not text then
    text = format("%.1f", raw / 10)
    tenth_text[raw] = text
  end
  return text
end

local function on(value)
  return value ~= 0 and "on" or "off"
end

-- The burst that a 0x95, 0x96 or text frame belongs to, and what was odd about the frame.
local function burst_of(frame)
  local memory = frame.memory
  if type(memory) == "table" and memory.shared then -- most of them
    return memory, nil
  end
  return bursts.open(memory)
end

-- 0x90: voltage.2 gather.2 current.2 soc.2
show[0x90] = function(frame, out)
  local _, _, _, _, a, b, c, d, e, f, g, h = byte(frame.raw, 1, 12)
  out.value(fields.pack_voltage, 0, 2, (a * 256 + b) / 10, " V")
  out.value(fields.gather_voltage, 2, 2, (c * 256 + d) / 10, " V")
  out.value(fields.current, 4, 2, (e * 256 + f - 30000) / 10, " A")
  out.bytes(fields.current_raw, 4, 2)
  out.value(fields.soc, 6, 2, (g * 256 + h) / 10, " %")
  if frame.memory then
    out.made(fields.pack_state, frame.memory)
  end
end

words[0x90] = function(frame)
  local _, _, _, _, a, b, _, _, e, f, g, h = byte(frame.raw, 1, 12)
  local state = frame.memory and " (" .. state_name(frame.memory) .. ")" or ""
  return tenths(a * 256 + b)
    .. " V  "
    .. tenths(e * 256 + f - 30000)
    .. " A"
    .. state
    .. "  SOC "
    .. tenths(g * 256 + h)
    .. " %"
end

-- 0x91: max.2 number.1 min.2 number.1 reserved.2
show[0x91] = function(_, out)
  out.bytes(fields.cell_max, 0, 2, " mV")
  out.bytes(fields.cell_max_number, 2, 1)
  out.bytes(fields.cell_min, 3, 2, " mV")
  out.bytes(fields.cell_min_number, 5, 1)
  out.bytes(fields.reserved, 6, 2)
end

words[0x91] = function(frame)
  local _, _, _, _, a, b, c, d, e, f = byte(frame.raw, 1, 10)
  return "max "
    .. whole(a * 256 + b)
    .. " mV (cell "
    .. whole(c)
    .. ")  min "
    .. whole(d * 256 + e)
    .. " mV (cell "
    .. whole(f)
    .. ")"
end

-- 0x92: max.1 number.1 min.1 number.1 reserved.4
show[0x92] = function(frame, out)
  local _, _, _, _, a, _, c = byte(frame.raw, 1, 7)
  out.value(fields.temp_max, 0, 1, a - 40, " C")
  out.bytes(fields.temp_max_number, 1, 1)
  out.value(fields.temp_min, 2, 1, c - 40, " C")
  out.bytes(fields.temp_min_number, 3, 1)
  out.bytes(fields.reserved, 4, 4)
end

words[0x92] = function(frame)
  local _, _, _, _, a, b, c, d = byte(frame.raw, 1, 8)
  return format("max %d C (sensor %d)  min %d C (sensor %d)", a - 40, b, c - 40, d)
end

-- 0x93: state.1 charge_mos.1 discharge_mos.1 life.1 remaining.4
show[0x93] = function(frame, out)
  local _, _, _, _, _, b, c = byte(frame.raw, 1, 7)
  out.bytes(fields.state, 0, 1)
  out.value(fields.mos_charge, 1, 1, b ~= 0)
  out.value(fields.mos_discharge, 2, 1, c ~= 0)
  out.bytes(fields.life, 3, 1)
  out.bytes(fields.remaining, 4, 4, " mAh")
end

words[0x93] = function(frame)
  local _, _, _, _, a, b, c, _, e, f, g, h = byte(frame.raw, 1, 12)
  return format(
    "%s  charge MOS %s  discharge MOS %s  remaining %.0f mAh",
    state_name(a),
    on(b),
    on(c),
    ((e * 256 + f) * 256 + g) * 256 + h
  )
end

-- 0x94: cells.1 sensors.1 charger.1 load.1 dio.1 cycles.2 reserved.1
show[0x94] = function(frame, out)
  local dio = byte(frame.raw, 9)
  out.bytes(fields.cell_count, 0, 1)
  out.bytes(fields.sensor_count, 1, 1)
  out.bytes(fields.charger, 2, 1)
  out.bytes(fields.load, 3, 1)
  for i = 0, 3 do
    out.value(fields["di" .. (i + 1)], 4, 1, floor(dio / 2 ^ i) % 2 == 1)
  end
  for i = 0, 3 do
    out.value(fields["do" .. (i + 1)], 4, 1, floor(dio / 2 ^ (i + 4)) % 2 == 1)
  end
  out.bytes(fields.cycles, 5, 2)
  out.bytes(fields.reserved, 7, 1)
end

words[0x94] = function(frame)
  local _, _, _, _, a, b, c, d, _, f, g = byte(frame.raw, 1, 11)
  return format(
    "%d cells  %d sensors  charger %s  load %s  %d cycles",
    a,
    b,
    c ~= 0 and "connected" or "disconnected",
    d ~= 0 and "connected" or "disconnected",
    f * 256 + g
  )
end

local function show_burst(odd, out)
  if not odd then
    return
  end
  if odd.missing then
    for i = 1, #odd.missing do
      out.made(fields.missing, odd.missing[i])
    end
  end
  if odd.again then
    out.made(fields.again, true)
  end
end

-- How many of the slots of a frame hold something real: all when the count is not known.
local function real_slots(burst, frame, per_frame)
  local first = per_frame * (byte(frame.raw, 5) - burst.base)
  if not burst.count then
    return per_frame, first
  end
  return math.max(0, math.min(per_frame, burst.count - first)), first
end

--- What this frame carries of its whole burst: the list of all cells (mV) or sensors (raw), the text; nil, nil where
-- another carries it, or none. `again`: the capture was read to its end.
function M.whole(slot, memory, again)
  local burst, _, list = bursts.open(memory)
  if list then
    return list, nil
  end
  if again and burst and burst.last == slot and burst.whole and not burst.count then
    if burst.values then
      return burst.values, nil
    end
    local text = bursts.text(burst)
    return nil, text ~= "" and printable(text) or nil
  end
  return nil, nil
end

-- Lowest, its number, highest, its number, average of a list, without values that mean "not there"; nil where none is.
local function statistics(values, one_absent, other_absent)
  local lowest, low_at, highest, high_at, sum, count = nil, nil, nil, nil, 0, 0
  for i = 1, #values do
    local v = values[i]
    if v ~= one_absent and v ~= other_absent then
      sum, count = sum + v, count + 1
      if not lowest or v < lowest then
        lowest, low_at = v, i
      end
      if not highest or v > highest then
        highest, high_at = v, i
      end
    end
  end
  return lowest, low_at, highest, high_at, count > 0 and sum / count
end

local cell_fields = {}
for i = 1, 48 do
  cell_fields[i] = fields["cell." .. i]
end

--- The table of all cells (mV).
function M.show_cells(cells, out)
  local lowest, low_at, highest, high_at, average = statistics(cells)
  for i = 1, #cells do
    out.made_cell(fields.cells_voltage, cell_fields[i], cells[i], i == low_at, i == high_at)
  end
  out.made(fields.cells_count, #cells)
  out.made(fields.cells_min, lowest, " mV")
  out.made(fields.cells_min_number, low_at)
  out.made(fields.cells_max, highest, " mV")
  out.made(fields.cells_max_number, high_at)
  out.made(fields.cells_average, average, " mV")
  out.made(fields.cells_spread, highest - lowest, " mV")
end

--- The table of all sensors (raw, offset 40).
function M.show_sensors(sensors, out)
  for i = 1, #sensors do
    out.made(fields.sensors_temperature, sensors[i] - 40, " C")
  end
  out.made(fields.sensors_count, #sensors)
  local lowest, low_at, highest, high_at, average = statistics(sensors, 0, 0xFF)
  if lowest then
    out.made(fields.sensors_min, lowest - 40, " C")
    out.made(fields.sensors_min_number, low_at)
    out.made(fields.sensors_max, highest - 40, " C")
    out.made(fields.sensors_max_number, high_at)
    out.made(fields.sensors_average, average - 40, " C")
    out.made(fields.sensors_spread, highest - lowest, " C")
  end
end

-- 0x95: frame_number.1 cell.2 cell.2 cell.2 reserved.1
show[0x95] = function(frame, out)
  local burst, odd = burst_of(frame)
  out.bytes(fields.frame_number, 0, 1)
  show_burst(odd, out)
  if not burst then
    out.bytes(fields.reserved, 1, 7)
    return
  end
  local real, before = real_slots(burst, frame, 3)
  for i = 0, real - 1 do
    local high, low = byte(frame.raw, 6 + 2 * i, 7 + 2 * i)
    out.cell(fields.cell_voltage, 1 + 2 * i, 2, before + i + 1, high * 256 + low)
  end
  out.bytes(fields.reserved, 1 + 2 * real, 7 - 2 * real)
  if frame.table then
    M.show_cells(frame.table, out)
  end
end

-- "frame 2  cells 4-6: ", by number * 64 + cells before: at most 17 x 51.
local spans = {}

local function span_of(n, before)
  local key = n * 64 + before
  local span = spans[key]
  if not span then
    span = format("frame %d  cells %d-%d: ", n, before + 1, before + 3)
    spans[key] = span
  end
  return span
end

words[0x95] = function(frame)
  local burst = burst_of(frame)
  local _, _, _, _, n, a, b, c, d, e, f = byte(frame.raw, 1, 11)
  if not burst then
    return format("frame %d", n)
  end
  local first, count = 3 * (n - burst.base), burst.count
  if not frame.table and (not count or first + 3 <= count) then -- most of them: in one go
    return span_of(n, first) .. whole(a * 256 + b) .. " " .. whole(c * 256 + d) .. " " .. whole(e * 256 + f) .. " mV"
  end
  local real, before = real_slots(burst, frame, 3)
  local text = "frame " .. whole(n)
  if real == 3 then
    text = text .. "  cells " .. whole(before + 1) .. "-" .. whole(before + 3) .. ": " .. whole(a * 256 + b)
    text = text .. " " .. whole(c * 256 + d) .. " " .. whole(e * 256 + f) .. " mV"
  elseif real == 2 then
    text = text .. "  cells " .. whole(before + 1) .. "-" .. whole(before + 2) .. ": " .. whole(a * 256 + b)
    text = text .. " " .. whole(c * 256 + d) .. " mV"
  elseif real == 1 then
    text = text .. "  cell " .. whole(before + 1) .. ": " .. whole(a * 256 + b) .. " mV"
  end
  local cells = frame.table
  if cells then
    local lowest, low_at, highest, high_at, average = statistics(cells)
    text = text
      .. format(
        "  all %d: min %d (cell %d)  max %d (cell %d)  average %.0f  spread %d mV",
        #cells,
        lowest,
        low_at,
        highest,
        high_at,
        average,
        highest - lowest
      )
  end
  return text
end

-- 0x96: frame_number.1 temperature.1 x 7
show[0x96] = function(frame, out)
  local burst, odd = burst_of(frame)
  out.bytes(fields.frame_number, 0, 1)
  show_burst(odd, out)
  if not burst then
    out.bytes(fields.reserved, 1, 7)
    return
  end
  local real = real_slots(burst, frame, 7)
  for i = 1, real do
    out.value(fields.temperature, i, 1, byte(frame.raw, 5 + i) - 40, " C")
  end
  if real < 7 then
    out.bytes(fields.reserved, 1 + real, 7 - real)
  end
  if frame.table then
    M.show_sensors(frame.table, out)
  end
end

words[0x96] = function(frame)
  local burst = burst_of(frame)
  local list = { format("frame %d", byte(frame.raw, 5)) }
  local real = burst and real_slots(burst, frame, 7) or 0
  if real > 0 then
    list[2] = ""
    for i = 1, real do
      list[#list + 1] = format("%d", byte(frame.raw, 5 + i) - 40)
    end
    list[#list + 1] = "C"
  end
  return concat(list, " ")
end

-- 0x97: mask.6 (byte 0 bit 0 = cell 1) reserved.2
show[0x97] = function(frame, out)
  out.little(fields.balance_mask, 0, 6)
  for i = 0, 5 do
    local bits = byte(frame.raw, 5 + i)
    for k = 0, bits > 0 and 7 or -1 do
      if floor(bits / 2 ^ k) % 2 == 1 then
        out.value(fields.balance_cell, i, 1, 8 * i + k + 1)
      end
    end
  end
  out.bytes(fields.balance_active, 1, 1)
  out.bytes(fields.reserved, 6, 2)
end

local NO_BALANCE = ("\0"):rep(6)

words[0x97] = function(frame)
  if frame.raw:sub(5, 10) == NO_BALANCE then
    return "none"
  end
  local list = {}
  for i = 0, 5 do
    local bits = byte(frame.raw, 5 + i)
    for k = 0, 7 do
      if floor(bits / 2 ^ k) % 2 == 1 then
        list[#list + 1] = format("%d", 8 * i + k + 1)
      end
    end
  end
  local active = byte(frame.raw, 6)
  return "cells " .. concat(list, " ") .. (active ~= 0 and format("  (active balancer: cell %d)", active) or "")
end

local fault_fields = {}
for i = 1, #faults.BITS do
  fault_fields[i] = fields["fault." .. faults.BITS[i][3]]
end

-- 0x98: bits.7 code.1
show[0x98] = function(frame, out, from)
  local raw = frame.raw
  for i = 1, #faults.BITS do
    local bit = faults.BITS[i]
    out.value(fault_fields[i], bit[1], 1, byte(raw, 5 + bit[1]) ~= 0 and faults.is_set(raw, 5, bit))
  end
  out.bytes(fields.fault_code, 7, 1)
  local _, count = faults.read(raw, 5)
  out.made(fields.fault_count, count)
  if frame.memory then
    local raised, cleared = faults.changes(frame.memory, 1, raw, 5)
    for i = 1, #raised do
      out.made(fields.fault_raised, raised[i])
    end
    for i = 1, #cleared do
      out.made(fields.fault_cleared, cleared[i])
    end
    if #raised + #cleared > 0 then
      out.made(fields.changed_from, from)
    end
  end
end

local NO_FAULTS = ("\0"):rep(8)

words[0x98] = function(frame)
  local data = frame.raw:sub(5, 12)
  if data == NO_FAULTS and (not frame.memory or frame.memory == NO_FAULTS) then
    return "none"
  end
  local names = faults.read(frame.raw, 5)
  local list = { #names > 0 and concat(names, ", ") or "none" }
  local code = byte(frame.raw, 12)
  if code ~= 0 then
    list[#list + 1] = format("fault code %d", code)
  end
  if frame.memory then
    local raised, cleared = faults.changes(frame.memory, 1, frame.raw, 5)
    if #raised > 0 then
      list[#list + 1] = "raised: " .. concat(raised, ", ")
    end
    if #cleared > 0 then
      list[#list + 1] = "cleared: " .. concat(cleared, ", ")
    end
  end
  return concat(list, "  ")
end

-- Texts: frame_number.1 characters.7
local function show_text(frame, out)
  local _, odd = burst_of(frame)
  out.bytes(fields.frame_number, 0, 1)
  out.value(fields.text_part, 1, 7, printable(frame.raw:sub(6, 12)))
  show_burst(odd, out)
  if frame.text then
    out.made(fields[format("text.%02X", byte(frame.raw, 3))], frame.text)
  end
end

local function text_words(frame)
  local list = { format('frame %d  "%s"', byte(frame.raw, 5), printable(frame.raw:sub(6, 12))) }
  if frame.text then
    list[2] = format('all: "%s"', frame.text)
  end
  return concat(list, "  ")
end

for id in pairs(bursts.IDS) do
  show[id] = show[id] or show_text
  words[id] = words[id] or text_words
end

-- Other IDs: settings and the like (daly_settings).

-- Each value of a list in data, as { label, words }; values that are none are left out.
local function values_of(list, raw, at)
  local told = {}
  for i = 1, #list do
    local name, first, length, kind, unit, names = table.unpack(list[i], 1, 6)
    local value = nil
    if at + first + length - 1 <= #raw then
      value = quantities.read[kind](raw, at + first, length)
    end
    if value ~= nil then
      told[#told + 1] = { quantities.label(name), quantities.words(kind, value, unit, names) }
    end
  end
  return told
end

local function show_values(list, raw, out)
  for i = 1, #list do
    local name, first, length, kind, unit = table.unpack(list[i], 1, 5)
    local value = quantities.read[kind](raw, 5 + first, length)
    if value ~= nil then
      out.value(fields[name], first, length, value, unit)
    end
  end
end

local function hex_of(raw)
  return (
    raw
      :sub(5, 12)
      :gsub(".", function(one)
        return format("%02x ", byte(one))
      end)
      :sub(1, -2)
  )
end

for id, list in pairs(settings.READS) do
  local level, class = settings.alarm(id)
  show[id] = function(frame, out)
    if level then
      out.made(fields["alarm.level"], level)
      out.made(fields["alarm.class"], class)
    end
    show_values(list, frame.raw, out)
  end
  words[id] = function(frame)
    local told = values_of(list, frame.raw, 5)
    if #told == 0 then
      return hex_of(frame.raw)
    end
    for i = 1, #told do
      told[i] = told[i][1] .. " " .. told[i][2]
    end
    return concat(told, "  ")
  end
end

local NOTHING = ("\0"):rep(8)

words[0xD8] = function(frame)
  local list = {}
  for _, one in ipairs(values_of(settings.READS[0xD8], frame.raw, 5)) do
    if one[2] == "on" then
      list[#list + 1] = one[1]
    end
  end
  return #list > 0 and "woken by " .. concat(list, ", ")
    or frame.raw:sub(5, 12) == NOTHING and "none"
    or hex_of(frame.raw)
end

-- Requests that write (docs/protocol.md a.3).

--- The fields of what a request would set.
function M.show_write(id, raw, out)
  local command = settings.COMMANDS[id]
  if command then
    out.made(fields.command, command)
  elseif settings.WRITES[id] then
    show_values(settings.WRITES[id], raw, out)
  end
end

local RESTART = 0x00

-- Every device seen has 01 for on; the vendor's article of 2024 has it the other way round.
local REVERSE = " (01 is on, as every device seen has it; the vendor's article of 2024 says 00)"

--- What a request that writes would change, in words, short and in full. `was`: what the board had before, the same
-- bytes (fewer, where no more is known), and `was_in`: the packet that told; nil where nothing is known.
function M.write_words(id, raw, was, was_in)
  if id == RESTART then
    return "restarts the board", "restarts the board"
  end
  local list = settings.WRITES[id] or {}
  local told, before = values_of(list, raw, 5), {}
  if #told == 0 then
    local text = format("sets what 0x%02X reads, to %s", id + 0x40, hex_of(raw))
    return text, text
  end
  for _, one in ipairs(was and values_of(list, was, 1) or {}) do
    before[one[1]] = one[2]
  end
  local sets, differs, all_known = {}, {}, true
  for i = 1, #told do
    local label, value = told[i][1], told[i][2]
    sets[i] = format("%s to %s", label, value)
    all_known = all_known and before[label] ~= nil
    if before[label] and before[label] ~= value then
      differs[#differs + 1] = format("%s was %s", label, before[label])
    end
  end
  local text
  if id == 0xD9 or id == 0xDA then
    text = format("switches the %s %s", told[1][1], told[1][2])
  else
    text = "sets " .. concat(sets, ", ")
  end
  local full = text
  if id == 0xD9 or id == 0xDA then
    full = full .. REVERSE
  end
  if #differs > 0 then
    full = format("%s; by packet %d, %s", full, was_in, concat(differs, ", "))
  elseif was and all_known then -- half of it may be known only: 0x90 tells the SOC, and no clock
    full = format("%s; the same as in packet %d", full, was_in)
  end
  return text, full
end

--- What is to be said of the level 2 faults in the eight bytes of 0x98, or nil.
function M.severe(data)
  if data == NO_FAULTS then
    return nil
  end
  local names, _, severe = faults.read(data, 1)
  if not severe then
    return nil
  end
  local level_2 = {}
  for i = 1, #names do
    if names[i]:sub(-8) == "_level_2" then
      level_2[#level_2 + 1] = names[i]
    end
  end
  return "Level 2 fault: " .. concat(level_2, ", ")
end

--- IDs whose bytes by themselves bring notes (M.complaints): each such frame is to be looked at closer.
M.COMPLAINS = { [0x98] = true }

--- What is to be said of a reply's content: a list of { expert's name, words }.
function M.complaints(id, frame)
  local list = {}
  if id == 0x98 then
    if frame.memory and frame.memory ~= frame.raw:sub(5, 12) then
      local raised, cleared = faults.changes(frame.memory, 1, frame.raw, 5)
      if #raised > 0 then
        list[1] = { "raised", "Raised: " .. concat(raised, ", ") }
      end
      if #cleared > 0 then
        list[#list + 1] = { "cleared", "Cleared: " .. concat(cleared, ", ") }
      end
    end
    local severe = M.severe(frame.raw:sub(5, 12))
    if severe then
      list[#list + 1] = { "severe", severe }
    end
  elseif bursts.IDS[id] then
    local _, odd = burst_of(frame)
    if odd and odd.missing then
      list[#list + 1] = { "missing", format("%d missing before this frame of the burst", #odd.missing) }
    end
    if odd and odd.again then
      list[#list + 1] = { "again", "The burst had this frame number before" }
    end
  end
  return list
end

return M
