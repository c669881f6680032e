-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- How a Modbus frame looks: its fields, expert notes, and the words of the columns (docs/wires.md 1, protocol.md d).
--
--   addr fn ...                     crc.2
--   read request        start.2 count.2
--   read reply          bytes.1 registers
--   write one           register.2 value.2
--   write many          start.2 count.2 [bytes.1] registers; its reply: start.2 count.2
--   exception           code.1

local field_module = require("daly_fields")
local modbus_board = require("daly_modbus_board")
local modbus_exchange = require("daly_modbus_exchange")
local exchange = require("daly_exchange")
local registers = require("daly_registers")
local quantities = require("daly_quantities")
local payload = require("daly_payload")
local faults = require("daly_faults")
local results_module = require("daly_results")

local M = {}

local fields, experts = field_module.fields, field_module.experts
local byte, format, concat, floor = string.byte, string.format, table.concat, math.floor

local READ, WRITE_ONE, WRITE_MANY, REFUSES = 0x03, 0x06, 0x10, 0x80

-- What the register of the vendor's article is in truth.
local CELL_13 = 0x000C

-- Where things stand in a frame, from 0: the registers of a read reply.
local REPLY_DATA = 3

local EXCEPTIONS = {
  [0x01] = "illegal function",
  [0x02] = "illegal data address",
  [0x03] = "illegal data value",
  [0x04] = "server device failure",
  [0x05] = "acknowledge",
  [0x06] = "server device busy",
  [0x08] = "memory parity error",
  [0x0A] = "gateway path unavailable",
  [0x0B] = "gateway target failed to respond",
}

-- Who asks and who answers, by address: words, names for the columns.
local names, boards = {}, {}

local function name_of(address)
  local name = names[address]
  if not name then
    local board = modbus_exchange.board(address)
    name = board and format("board %d", board) or "D2"
    names[address] = name
    boards[address] = board and format("Board %d", board) or "Board"
  end
  return name, boards[address]
end

-- Words that are the same for the same bytes, made once; not more than so many.
local MOST_KEPT = 4096
local kept, kept_count = {}, 0

local function keep(key, text)
  if kept_count >= MOST_KEPT then
    kept, kept_count = {}, 0
  end
  kept[key], kept_count = text, kept_count + 1
  return text
end

local function plural(count)
  return count == 1 and "1 register" or format("%d registers", count)
end

local tenths = {}

local function tenths_of(raw)
  local text = tenths[raw]
  if not text then
    text = format("%.1f", raw / 10)
    tenths[raw] = text
  end
  return text
end

-- Registers ---------------------------------------------------------------------------------------

-- Each known value among `count` registers from `start`, which stand in raw from offset: call(entry, value, offset).
-- `index`: all of a map, or what writes set. `written`: they stand in a write.
local function each_value(index, raw, offset, start, count, written, call)
  for place = 0, count - 1 do
    local entries = index[start + place]
    for i = 1, entries and #entries or 0 do
      local entry = entries[i]
      if place + entry.count <= count then
        local value = registers.value(entry, raw, offset + 2 * place + 1, written)
        if value ~= nil then
          call(entry, value, offset + 2 * place)
        end
      end
    end
  end
end

local function show_values(index, raw, offset, start, count, written, out)
  each_value(index, raw, offset, start, count, written, function(entry, value, at)
    out.value(fields[entry.name], at, 2 * entry.count, value, entry.unit)
  end)
end

-- The registers as they are, numbered where it is known from what.
local function show_raw(raw, offset, start, count, out)
  out.registers(fields["modbus.value"], offset, count, start, function(place)
    local high, low = byte(raw, offset + 2 * place + 1, offset + 2 * place + 2)
    return high * 256 + low
  end)
end

-- Cells and sensors of a read reply, and their tables. `most`: how many there are, or nil.
local function show_cells(known, raw, start, count, most, out)
  for place = 0, count - 1 do
    local number = registers.number_of(known.cells, start + place)
    if number and number <= (most or number) then
      local value = registers.register(raw, REPLY_DATA + 1, start, count, start + place)
      if value <= registers.HIGHEST_CELL then
        out.cell(fields.cell_voltage, REPLY_DATA + 2 * place, 2, number, value)
      end
    end
  end
  local cells = most and registers.all(known.cells, most, registers.HIGHEST_CELL, raw, REPLY_DATA + 1, start, count)
  if cells then
    payload.show_cells(cells, out)
  end
end

local function show_sensors(known, raw, start, count, most, out)
  for place = 0, count - 1 do
    local number = registers.number_of(known.sensors, start + place)
    if number and number <= (most or number) then
      local value = registers.register(raw, REPLY_DATA + 1, start, count, start + place)
      if value <= registers.HIGHEST_SENSOR then
        out.value(fields.temperature, REPLY_DATA + 2 * place, 2, value - 40, " C")
      end
    end
  end
  local sensors = most
    and registers.all(known.sensors, most, registers.HIGHEST_SENSOR, raw, REPLY_DATA + 1, start, count)
  if sensors then
    payload.show_sensors(sensors, out)
  end
end

local function show_faults(known, raw, start, count, odd, out)
  local data = registers.faults(known, raw, REPLY_DATA + 1, start, count)
  if not data then
    return
  end
  local offset = REPLY_DATA + 2 * (known.faults - start)
  for i = 1, #faults.BITS do
    local bit = faults.BITS[i]
    -- The low byte, which comes second, is the earlier one of 0x98.
    local place = offset + bit[1] - bit[1] % 2 + (1 - bit[1] % 2)
    out.value(fields["fault." .. bit[3]], place, 1, faults.is_set(data, 1, bit))
  end
  out.value(fields.fault_code, offset + 6, 1, byte(data, 8))
  local _, set = faults.read(data, 1)
  out.made(fields.fault_count, set)
  for i = 1, odd and odd.raised and #odd.raised or 0 do
    out.made(fields.fault_raised, odd.raised[i])
  end
  for i = 1, odd and odd.cleared and #odd.cleared or 0 do
    out.made(fields.fault_cleared, odd.cleared[i])
  end
  if odd and odd.raised and not odd.changed then
    out.made(fields.changed_from, odd.from)
  end
end

-- Words -------------------------------------------------------------------------------------------

-- So many values of a reply stand in the Info column.
local MOST_VALUES = 4

-- What a reply says, shortly. Pack values first: they are what most replies are read for.
local function value_words(known, raw, start, count)
  local voltage = known.voltage
  if start <= voltage and voltage + 3 <= start + count then
    local at = REPLY_DATA + 1 + 2 * (voltage - start)
    local a, b, c, d, e, f = byte(raw, at, at + 5)
    return tenths_of(a * 256 + b)
      .. " V  "
      .. tenths_of(c * 256 + d - 30000)
      .. " A  SOC "
      .. tenths_of(e * 256 + f)
      .. " %"
  end
  local list = {}
  each_value(known.at, raw, REPLY_DATA, start, count, false, function(entry, value)
    if #list < MOST_VALUES and entry.name:sub(-5) ~= "_sent" then
      list[#list + 1] = quantities.label(entry.name)
        .. " "
        .. quantities.words(entry.kind, value, entry.unit, entry.names)
    elseif #list == MOST_VALUES then
      list[#list + 1] = "..."
    end
  end)
  if #list == 0 then
    local first = registers.number_of(known.cells, start)
    for place = 0, first and math.min(count, 2 * MOST_VALUES) - 1 or -1 do
      list[#list + 1] = format("%d", registers.register(raw, REPLY_DATA + 1, start, count, start + place))
    end
    if #list > 0 then
      return format("cells from %d: %s%s mV", first, concat(list, " "), count > #list and " ..." or "")
    end
  end
  return concat(list, "  ")
end

local function with_values(raw, offset, count)
  local list = {}
  for place = 0, math.min(count, 2 * MOST_VALUES) - 1 do
    list[#list + 1] = format("%02X%02X", byte(raw, offset + 2 * place + 1, offset + 2 * place + 2))
  end
  return concat(list, " ") .. (count > #list and " ..." or "")
end

-- What is to be said of a write that sets nothing we can read: not of settings, of half a value, or to what is none.
local function unread_words(known, raw, offset, start, count)
  local named = false
  for register = start, start + count - 1 do
    named = named or registers.is_named(known, register)
  end
  local why = named and "no setting that we know" or "which no list names"
  return format("%s, %s, to %s", plural(count), why, with_values(raw, offset, count))
end

-- What a write would change: short words, and those of the expert note.
local function write_words(known, raw, offset, start, count, odd)
  local sets, before = {}, {}
  for place = 0, count - 1 do
    if known.commands[start + place] then
      sets[#sets + 1] = "command " .. known.commands[start + place]:gsub("_", " ")
    end
    local entries = known.sets[start + place]
    local value = registers.register(raw, offset + 1, start, count, start + place)
    if entries and entries[1].kind == "tens" and value == 0xFFFF then
      sets[#sets + 1] = format("sets %s to never", quantities.label(entries[1].name))
    end
  end
  each_value(known.sets, raw, offset, start, count, true, function(entry, value, at)
    local label = quantities.label(entry.name)
    local said = quantities.words(entry.kind, value, entry.unit, entry.names)
    sets[#sets + 1] = entry.kind == "switch" and format("switches %s %s", label, said)
      or format("sets %s to %s", label, said)
    local first, parts = start + floor((at - offset) / 2), {}
    for i = 0, entry.count - 1 do
      parts[#parts + 1] = odd and odd.was and odd.was[first + i] or nil
    end
    local was
    if #parts == entry.count then
      was = registers.value(entry, concat(parts), 1)
    end
    if was ~= nil then
      local words = quantities.words(entry.kind, was, entry.unit, entry.names)
      before[#before + 1] = words ~= said and format("%s was %s", label, words) or nil
    end
  end)
  if #sets == 0 then
    sets[1] = unread_words(known, raw, offset, start, count)
  end
  local text = concat(sets, ", ")
  if #before > 0 then
    return text, format("%s; by packet %d, %s", text, odd.was_in, concat(before, ", "))
  end
  return text, text
end

-- Frames ------------------------------------------------------------------------------------------

local function show_head(raw, out)
  local address = byte(raw)
  out.made(fields.dialect, modbus_exchange.dialect(address))
  out.bytes(fields.modbus_address, 0, 1)
  out.bytes(fields.modbus_function, 1, 1)
  out.little(fields.modbus_crc, #raw - 2, 2)
  out.made(fields.modbus_crc_status, 1)
end

local function words_of_read(raw)
  local address, _, a, b, c, d = byte(raw, 1, 6)
  local name = name_of(address)
  return keep(raw, format("Read %s from %04X, %s", plural(c * 256 + d), a * 256 + b, name))
end

-- A request: words.
local function request(item, raw, slot, results, wanted, again, out)
  local address, fn, a, b, c, d, e = byte(raw, 1, 7)
  local known = registers.MAPS[modbus_exchange.dialect(address)]
  local start, count, offset = a * 256 + b, fn == WRITE_ONE and 1 or c * 256 + d, 4
  local text, full
  if fn == READ then
    text = kept[raw] or words_of_read(raw)
    if count == 1 and start == CELL_13 and address == 0xD2 then
      out.note(item, experts.cell_13)
    end
  else
    local odd = results.odd[slot]
    if fn == WRITE_MANY then
      offset = #raw == 9 + 2 * count and 7 or 6
    end
    text, full = write_words(known, raw, offset, start, count, odd)
    local where = count == 1 and format("%04X", start) or format("%04X to %04X", start, start + count - 1)
    out.note(item, experts.write, format("WRITE %s: %s", where, full))
    text = format("WRITE %s, %s: %s", where, name_of(address), text)
    if start <= CELL_13 and CELL_13 < start + count and address == 0xD2 then
      out.note(item, experts.cell_13)
    end
  end
  if wanted then
    out.bytes(fields["modbus.register"], 2, 2)
    if fn ~= WRITE_ONE then
      out.bytes(fields["modbus.count"], 4, 2)
    end
    if fn ~= READ then
      out.made(fields.write, true)
      if offset == 7 then
        out.value(fields["modbus.byte_count"], 6, 1, e)
      end
      for register = start, start + count - 1 do
        if known.commands[register] then
          out.made(fields.command, known.commands[register])
        end
      end
      show_values(known.sets, raw, offset, start, count, true, out)
      show_raw(raw, offset, start, count, out)
    end
  end
  if again and exchange.is_unanswered(results, slot) then
    text = text .. "  [unanswered]"
    out.note(item, experts.unanswered)
    if wanted then
      out.made(fields.unanswered, true)
    end
  end
  return text
end

local function note_faults(item, raw, known, start, count, odd, out)
  local data = registers.faults(known, raw, REPLY_DATA + 1, start, count)
  if odd and odd.raised and #odd.raised > 0 then
    out.note(item, experts.raised, "Raised: " .. concat(odd.raised, ", "))
  end
  if odd and odd.cleared and #odd.cleared > 0 then
    out.note(item, experts.cleared, "Cleared: " .. concat(odd.cleared, ", "))
  end
  local severe = data and payload.severe(data)
  if severe then
    out.note(item, experts.severe, severe)
  end
end

-- The reply to a read: words.
local function read_reply(item, raw, slot, results, wanted, out)
  local address, _, length = byte(raw, 1, 3)
  local count = floor(length / 2)
  local memory, odd = results_module.memory(results, slot), results.odd[slot]
  local name = name_of(address)
  if not memory then
    if wanted then
      show_raw(raw, REPLY_DATA, nil, count, out)
    end
    local why = odd and odd.ambiguous and "two requests fit" or "from where is not known"
    return format("Reply %s  %s, %s: %s", name, plural(count), why, with_values(raw, REPLY_DATA, count))
  end
  local start, cells, sensors, assumed = modbus_board.unpack(memory)
  local known = registers.MAPS[modbus_exchange.dialect(address)]
  if known.faults and start <= known.faults and known.faults < start + count then
    note_faults(item, raw, known, start, count, odd, out)
  end
  if wanted then
    if assumed then
      out.made(fields["modbus.assumed"], true)
    end
    out.made(fields["modbus.register"], start)
    out.made(fields["modbus.count"], count)
    show_cells(known, raw, start, count, cells, out)
    show_sensors(known, raw, start, count, sensors, out)
    show_values(known.at, raw, REPLY_DATA, start, count, false, out)
    show_faults(known, raw, start, count, odd, out)
    show_raw(raw, REPLY_DATA, start, count, out)
    for place = 0, count - 1 do
      if registers.is_absent(known, raw, REPLY_DATA + 1, start, count, start + place) then
        out.value(fields["modbus.absent"], REPLY_DATA + 2 * place, 2, start + place)
      end
    end
  end
  local key = memory * 65536 + address * 256 + count
  local text = kept[key]
    or keep(key, format("Reply %s  %s from %04X%s: ", name, plural(count), start, assumed and " (assumed)" or ""))
  return text .. value_words(known, raw, start, count)
end

-- A reply: words.
local function reply(item, raw, slot, results, wanted, out)
  local address, fn, a, b, c, d = byte(raw, 1, 6)
  local odd = results.odd[slot]
  if odd and odd.ambiguous then
    out.note(item, experts.ambiguous)
    if wanted then
      out.made(fields["modbus.ambiguous"], true)
    end
  end
  if fn == READ then
    return read_reply(item, raw, slot, results, wanted, out)
  elseif fn > REFUSES then
    if wanted then
      out.bytes(fields["modbus.exception"], 2, 1)
    end
    local what = fn == REFUSES + READ and "read" or "write"
    local code = EXCEPTIONS[a] and format("0x%02X, %s", a, EXCEPTIONS[a]) or format("0x%02X", a)
    out.note(item, experts.exception, format("The board refuses the %s: %s", what, code))
    return format("Exception %s  to a %s: %s", name_of(address), what, code)
  end
  local start = a * 256 + b
  if wanted then
    out.bytes(fields["modbus.register"], 2, 2)
    if fn == WRITE_ONE then
      show_raw(raw, 4, start, 1, out)
    else
      out.bytes(fields["modbus.count"], 4, 2)
    end
  end
  local result = odd and odd.result and "  " .. odd.result or ""
  if fn == WRITE_ONE then
    return format("Reply %s  write of %04X: %02X%02X%s", name_of(address), start, c, d, result)
  end
  return format("Reply %s  write of %s from %04X%s", name_of(address), plural(c * 256 + d), start, result)
end

--- A frame: fields, expert notes; returns words, source, destination. `slot`: of `results`; `out`: as daly_view's, from
-- the frame's first byte; `slow`: s.
function M.show(item, raw, slot, results, wanted, again, out, slow)
  local address, fn = byte(raw, 1, 2)
  local _, board_name = name_of(address)
  local answers = modbus_exchange.is_reply(raw)
  if answers == nil then
    answers = results.flag[slot] == "reply"
  end
  local odd, link = results.odd[slot], results_module.link(results, slot)
  if wanted then
    show_head(raw, out)
    out.made(fields.direction, answers and 2 or 1)
    local board = modbus_exchange.board(address)
    if board then
      out.made(fields.board, board)
    end
    if link and link ~= modbus_exchange.SOMEHOW then
      out.made(answers and fields.request_in or fields.reply_in, link)
    end
  end
  local text
  if answers then
    local wait = results_module.wait(results, slot)
    if wait then
      if wait > slow then
        item:add_proto_expert_info(experts.slow, format("The reply came %.3f s after the request", wait))
      end
      if wanted then
        out.made(fields.response_time, wait, " s")
      end
    end
    text = reply(item, raw, slot, results, wanted, out)
  else
    text = request(item, raw, slot, results, wanted, again, out)
  end
  if odd then
    out.odd(item, odd, fn)
  end
  if answers then
    return text, board_name, "Host"
  end
  return text, "Host", board_name
end

return M
