-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- How records look: an item of the tree each, with its fields and expert notes, and the words of the columns.

local field_module = require("daly_fields")
local modbus_view = require("daly_modbus_view")
local payload = require("daly_payload")
local bursts = require("daly_bursts")
local exchange = require("daly_exchange")
local addresses = require("daly_addresses")
local brief = require("daly_brief")
local getters = require("daly_getters")
local data_ids = require("daly_data_ids")
local foreign = require("daly_foreign")
local mbrtu = require("daly_mbrtu")
local results_module = require("daly_results")

local M = {}

local fields, experts = field_module.fields, field_module.experts
local board_of = addresses.board
local memory_of, wait_of = results_module.memory, results_module.wait

local A5 = 0xA5

local byte, format, concat = string.byte, string.format, table.concat

-- Called by its name, a method of Wireshark's objects is looked up in C every time: a fifth of a packet's cost.
local add, add_le, referenced = TreeItem.add, TreeItem.add_le, TreeItem.referenced
local append_text, set_text, set_generated = TreeItem.append_text, TreeItem.set_text, TreeItem.set_generated
local range = Tvb.range
local is_visible = getters.attribute("TreeItem", "visible")
local set_columns = brief.set_columns

local packet_comment = Field.new("frame.comment")

-- The first comment as words. From 4.4 on its lines come one by one, and then all of it. It is anybody's: neither a
-- second line nor a terminal's control characters come of it.
local function comment_words(first, ...)
  local text = first and tostring(first.value) or ""
  for i = 1, select("#", ...) do
    local other = tostring((select(i, ...)).value)
    if other:sub(1, #text) == text then
      text = other
    end
  end
  return (text:gsub("%c", " "):gsub("\xC2[\x80-\x9F]", " "))
end

-- The packet at hand: our protocol; what is known of its frames (daly_bus); whether anybody asked for a field of ours,
-- and whether somebody looks at the tree; whether the capture was read to its end; the medium.
local daly, results, wanted, visible, again, transport

-- Where somebody counts (M.count), or nil.
local tap

-- Replies that took longer get a note, s.
local slow = 0.5

--- Once: the protocol, which the items of the tree belong to.
function M.setup(proto)
  daly = proto
  brief.setup(proto)
end

--- What a slow reply is, s.
function M.init(options)
  slow = options.slow
  brief.init()
end

--- Somebody counts from now on (daly_stat): `collect` is called for each record that is shown with the packet's number,
-- the record's kind, bytes and slot, the list of all cells or sensors that it carries (or false), and the results that
-- its slot is of.
function M.count(collect)
  tap = collect
  brief.stop()
end

--- Whether somebody counts.
function M.counts()
  return tap ~= nil
end

--- Before a packet is shown. `handle`: the protocol's dissector; `known`: results of daly_bus; `read`: whether the
-- capture was read to its end; `medium`: uart, can, ble, tcp.
local function look(parent, handle, known, read, medium)
  wanted = referenced(parent, handle)
  visible = wanted and is_visible(parent)
  results, again, transport = known, read, medium
end

M.look = look

-- Tree --------------------------------------------------------------------------------------------

-- The record at hand: its item of the tree, and where its bytes stand.
local tree, tvb, at

-- The range of bytes that was made last for a value, and where it lies: bits of one byte share it, for each object of
-- Wireshark's costs as much again when Lua collects it.
local range_at, range_length, last_range

local out = {}

function out.bytes(field, first, length, unit)
  if visible or referenced(tree, field) then
    local item = add(tree, field, range(tvb, at + 4 + first, length))
    if visible and unit then
      append_text(item, unit)
    end
  end
end

function out.value(field, first, length, value, unit)
  if visible or referenced(tree, field) then
    local place = at + 4 + first
    if place ~= range_at or length ~= range_length then
      last_range = range(tvb, place, length)
      range_at, range_length = place, length
    end
    local item = add(tree, field, last_range, value)
    if visible and unit then
      append_text(item, unit)
    end
  end
end

function out.little(field, first, length)
  if visible or referenced(tree, field) then
    add_le(tree, field, range(tvb, at + 4 + first, length))
  end
end

-- A cell's voltage, with the cell's number in its label.
function out.cell(field, first, length, number, value)
  if visible or referenced(tree, field) then
    local item = add(tree, field, range(tvb, at + 4 + first, length))
    if visible then
      set_text(item, format("Cell %d: %d mV", number, value))
    end
  end
end

-- Registers as they are, numbered from `start` where that is known; in a branch that nobody needs to open.
-- `value(place)`: one of them.
function out.registers(field, first, count, start, value)
  if not visible then
    if referenced(tree, field) then
      for place = 0, count - 1 do
        add(tree, field, range(tvb, at + 4 + first + 2 * place, 2))
      end
    end
    return
  end
  local branch = tree
  if count > 1 then
    branch = add(tree, range(tvb, at + 4 + first, 2 * count), format("%d registers", count))
  end
  for place = 0, count - 1 do
    local item = add(branch, field, range(tvb, at + 4 + first + 2 * place, 2))
    local raw = value(place)
    if start and start + place <= 0xFFFF then -- behind it there are none
      set_text(item, format("Register %04X: %d (0x%04X)", start + place, raw, raw))
    end
  end
end

-- One cell of the table: a line by the cell's own field, and inside it the same as one of all.
function out.made_cell(field, own, value, lowest, highest)
  local line = tree
  if visible or referenced(tree, own) then
    line = set_generated(add(tree, own, value))
    if visible then
      append_text(line, lowest and highest and " mV" or lowest and " mV, lowest" or highest and " mV, highest" or " mV")
    end
  end
  if visible or referenced(tree, field) then
    set_generated(add(line, field, value))
  end
end

function out.made(field, value, unit)
  if visible or referenced(tree, field) then
    local item = set_generated(add(tree, field, value))
    if visible and unit then
      append_text(item, unit)
    end
  end
end

local function header(field, offset, length)
  if visible or referenced(tree, field) then
    add(tree, field, range(tvb, at + offset, length))
  end
end

local made = out.made

local dialect, start, source_address, data_id = fields.dialect, fields.start, fields.address, fields.data_id
local data_length, data, checksum, checksum_status = fields.length, fields.data, fields.checksum, fields.checksum_status

-- Head and tail of 13 bytes A5 . . 08: what a damaged frame shows too.
local function show_frame(status)
  made(dialect, "a5")
  if visible then -- all of them, and no question asked of each
    add(tree, start, range(tvb, at, 1))
    add(tree, source_address, range(tvb, at + 1, 1))
    add(tree, data_id, range(tvb, at + 2, 1))
    add(tree, data_length, range(tvb, at + 3, 1))
    add(tree, data, range(tvb, at + 4, 8))
    add(tree, checksum, range(tvb, at + 12, 1))
  else
    header(start, 0, 1)
    header(source_address, 1, 1)
    header(data_id, 2, 1)
    header(data_length, 3, 1)
    header(data, 4, 8)
    header(checksum, 12, 1)
  end
  made(checksum_status, status)
end

-- An expert note. `noted`: whether the frame at hand got one by its bytes and what was remembered for it.
local noted

local function note(item, expert, words)
  noted = true
  if words then
    item:add_proto_expert_info(expert, words)
  else
    item:add_proto_expert_info(expert)
  end
end

out.note = note

-- Columns -----------------------------------------------------------------------------------------

local HOSTS = { [0x40] = "PC", [0x80] = "App", [0x20] = "GPRS" }

local function host_name(address)
  return format("%s 0x%02X", HOSTS[address] or (address > 0x40 and address <= 0x4F and "PC" or "Host"), address)
end

local function id_words(id)
  return format("0x%02X %s", id, data_ids[id] or "unknown ID")
end

-- The beginning of a reply's words.
local function reply_words(board, id)
  local who = board and format("board %d", board) or "unknown board"
  return format("Reply %s  %s%s", who, id_words(id), payload.words[id] and ": " or "  ")
end

-- The constant part of a frame's words, by address * 256 + ID.
local beginnings, sources, destinations = {}, {}, {}

local function names_of(address, id)
  local key = address * 256 + id
  if not beginnings[key] then
    local board = board_of(address)
    if address >= 0x20 then
      beginnings[key] = format("Request %s  %s", board and format("board %d", board) or "any board", id_words(id))
    else
      beginnings[key] = reply_words(board, id)
    end
    local host = address >= 0x20 and host_name(address) or "Host"
    local other = board and format("Board %d", board)
      or (address >= 0x20 and "Board" or format("Board 0x%02X", address))
    sources[key] = address >= 0x20 and host or other
    destinations[key] = address >= 0x20 and other or host
  end
  return beginnings[key], sources[key], destinations[key]
end

local function hex_words(raw, first, last)
  local list = {}
  for i = first, last do
    list[#list + 1] = format("%02x", byte(raw, i))
  end
  return concat(list, " ")
end

-- Records -----------------------------------------------------------------------------------------

local frame = {} -- the one at hand, for daly_payload

-- How another carrier of the eight bytes than an A5 frame looks: { names = function(raw): words, source and
-- destination, board = function(raw), show = function(raw): fields of its head }. nil: an A5 frame.
local carrier

-- What a frame's rare things say (daly_results' odd): expert notes.
local function note_odd(item, odd, id)
  if odd.late_to then
    note(item, experts.late, format("Too late for the request in packet %d", odd.late_to))
  elseif odd.unasked then
    note(item, experts.unasked)
  end
  if odd.other_board then
    note(item, experts.other_board, format("Board %d was asked", odd.other_board))
  end
  if odd.second_host then
    note(item, experts.second_host)
  end
  if odd.result and odd.result ~= "answered" then
    note(
      item,
      experts[odd.result],
      format("Write 0x%02X: the board %s it", id, odd.result == "denied" and "denies" or "confirms")
    )
  end
  if odd.changed then
    note(
      item,
      experts.changed,
      format("Changed since packet %d: %s", odd.from, concat(odd.changed, ", "):gsub("_", " "))
    )
  end
  local contradictions = odd.contradictions
  for i = 1, contradictions and #contradictions or 0, 3 do
    note(item, experts.contradiction, format("%s (packet %d)", contradictions[i + 2], contradictions[i + 1]))
  end
end

-- The same as fields.
local function show_odd(odd)
  if odd.unasked then
    made(fields.unasked, true)
  end
  if odd.late_to then
    made(fields.late_to, odd.late_to)
  end
  if odd.other_board then
    made(fields.other_board, true)
  end
  if odd.second_host then
    made(fields.second_host, true)
  end
  if odd.result then
    made(fields.write_result, odd.result)
  end
  for i = 1, odd.changed and #odd.changed or 0 do
    made(fields.changed, odd.changed[i])
  end
  if odd.changed then
    made(fields.changed_from, odd.from)
  end
  local contradictions = odd.contradictions
  for i = 1, contradictions and #contradictions or 0, 3 do
    made(fields.contradiction, contradictions[i])
    made(fields.contradicts, contradictions[i + 1])
  end
end

-- What A5 frames of a serial line and of Bluetooth said, by key_of, and what Modbus frames said, by their bytes.
local a5_memory, modbus_memory = brief.memory(), brief.memory()

-- What is remembered of the kind of the frame at hand (daly_brief), or nil; how a reply's words begin, and what makes
-- the rest of them.
local entry
local beginning, say

-- Remember what the frame at hand said, where bytes and memory make it say the same again. Returns its entry, or nil.
local function keep(memory, key, raw, slot, text, source, destination)
  if again or results.odd[slot] or results.flag[slot] then
    return nil
  end
  local shown_with = memory_of(results, slot) or false
  if type(shown_with) == "table" and not shown_with.shared then
    return nil
  end
  local kept = brief.entry(memory, key)
  kept.raw = raw
  kept.memory = shown_with
  kept.words = text
  kept.source = source
  kept.destination = destination
  kept.longest = noted and -math.huge or slow
  kept.beginning = beginning
  kept.say = say
  kept.numbered = say and bursts.IDS[byte(raw, 3)] ~= nil
  return kept
end

-- A request (echo, retry): expert notes and fields of its own; returns its words.
local function request(item, raw, slot, id, flag, text)
  local unanswered
  if flag == "echo" then
    text = text:gsub("^Request", "Echo")
    note(item, experts.echo)
  else
    if exchange.is_write(id) then
      local odd = results.odd[slot]
      local words, full = "not of eight bytes", "not of eight bytes"
      if byte(raw, 4) == 8 then
        words, full = payload.write_words(id, raw, odd and odd.was, odd and odd.was_in)
      end
      note(item, experts.write, "WRITE: " .. full)
      text = format("WRITE%s: %s", text:gsub("^Request", ""), words)
    end
    if flag == "retry" then
      text = text .. "  [retry]"
      note(item, experts.retry)
    end
    if again and exchange.is_unanswered(results, slot) then
      unanswered = true
      text = text .. "  [unanswered]"
      note(item, experts.unanswered)
    end
  end
  if wanted then
    if flag ~= "echo" and exchange.is_write(id) then
      made(fields.write, true)
      if byte(raw, 4) == 8 then
        payload.show_write(id, raw, out)
      end
    end
    if flag == "retry" then
      made(fields.retry, true)
    end
    if unanswered then
      made(fields.unanswered, true)
    end
  end
  return text
end

-- A reply of several frames: how it lies in its burst.
local function show_place(slot)
  local whole_in = bursts.whole_in(results, slot, again)
  if whole_in then
    made(fields.reassembled_in, whole_in)
  end
end

-- A reply: expert notes and fields; returns its words, which begin with `text`.
local function reply(item, raw, slot, id, length, odd, text)
  local memory = memory_of(results, slot)
  frame.raw, frame.memory, frame.table, frame.text = raw, memory, nil, nil
  local whole = length == 8 -- else it says nothing
  local numbered = whole and bursts.IDS[id]
  if numbered then
    frame.table, frame.text = payload.whole(slot, memory, again)
  end
  local words = whole and payload.words[id]
  if words and not payload.COMPLAINS[id] then
    beginning, say = text, words
  end
  if entry and entry.raw == raw and entry.memory == (memory or false) then
    text = entry.words
  else
    text = text .. (words and words(frame) or hex_words(raw, 5, 4 + length))
  end
  if whole and payload.COMPLAINS[id] or (type(memory) == "table" and memory.burst) then
    local complaints = payload.complaints(id, frame)
    for i = 1, #complaints do
      note(item, experts[complaints[i][1]], complaints[i][2])
    end
  end
  local wait = wait_of(results, slot)
  if wait then
    if wait > slow then
      item:add_proto_expert_info(experts.slow, format("The reply came %.3f s after the request", wait))
    end
    if wanted then
      made(fields.response_time, wait, " s")
    end
  end
  local cut_off = numbered and again and bursts.is_cut_off(results, slot)
  if cut_off then
    note(item, experts.cut_off)
  end
  if wanted then
    if numbered then
      show_place(slot)
      if cut_off then
        made(fields.cut_off, true)
      end
    end
    if whole and payload.show[id] then
      payload.show[id](frame, out, odd and odd.from)
    end
  end
  return text
end

-- An A5 frame: fields, expert notes; returns words, source, destination. What it means does not depend on its carrier.
local function a5(item, raw, slot)
  local _, address, id, length = byte(raw, 1, 4)
  local flag, odd = results.flag[slot], results.odd[slot]
  local text, source, destination
  if carrier then
    text, source, destination = carrier.names(raw)
  else
    text, source, destination = names_of(address, id)
  end
  local answers = address < 0x20
  if wanted then
    local board
    if carrier then
      carrier.show(raw)
      board = carrier.board(raw)
    else
      show_frame(1)
      board = board_of(address)
    end
    made(fields.direction, answers and 2 or flag == "echo" and 3 or 1)
    if board then
      made(fields.board, board)
    end
    if not data_ids[id] then
      made(fields.unknown_id, true)
    end
    local link = results_module.link(results, slot)
    if link then
      made(answers and fields.request_in or fields.reply_in, link)
    end
  end
  if answers then
    text = reply(item, raw, slot, id, length, odd, text)
  else
    frame.table = nil
    if flag or again or exchange.is_write(id) then
      text = request(item, raw, slot, id, flag, text)
    end
    if flag == "echo" then
      source, destination = "Echo", source
    end
  end
  if odd then
    note_odd(item, odd, id)
    if wanted then
      show_odd(odd)
    end
  end
  return text, source, destination
end

-- What was odd about a Modbus frame, as notes and fields.
function out.odd(item, odd, fn)
  note_odd(item, odd, fn)
  if wanted then
    show_odd(odd)
  end
end

-- A Modbus frame, which may begin anywhere in the buffer.
local function modbus(item, raw, slot)
  at = at - 4 -- daly_view's data byte 0 is the frame's first byte
  return modbus_view.show(item, raw, slot, results, wanted, again, out, slow)
end

local WORDS = {
  bad_checksum = "Bad checksum",
  short = "Cut-off frame",
  junk = "Junk",
}

local function damaged(item, kind, raw, name)
  local length = #raw
  if kind == "bad_checksum" then
    if wanted then
      show_frame(0)
    end
    local address, id = byte(raw, 2, 3)
    local sum = 0
    for i = 1, 12 do
      sum = (sum + byte(raw, i)) % 256
    end
    note(item, experts.bad_checksum, format("Checksum is 0x%02X, the bytes sum up to 0x%02X", byte(raw, 13), sum))
    return format("Bad checksum  address 0x%02X  %s", address, id_words(id))
  end
  if wanted then
    header(fields.undecoded, 0, length)
  end
  if kind == "foreign" then
    if wanted then
      made(fields.foreign, name)
    end
    return format("Not Daly: %s  %d bytes", name, length)
  elseif kind == "short" then
    note(item, experts.short, format("Frame is cut off after %d bytes", length))
  else
    note(item, experts.junk, format("%d bytes that are no frame", length))
  end
  local shown = hex_words(raw, 1, math.min(length, 16))
  return format("%s  %d bytes  %s%s", WORDS[kind], length, shown, length > 16 and " ..." or "")
end

local function event_words(item, text)
  if visible and text ~= "" then
    item:append_text(": " .. text)
  end
  return text ~= "" and "Event: " .. text or "Event"
end

-- Make an item of the tree for a record. `raw`: its bytes; they stand in buffer at offset.
local function begin(parent, buffer, offset, length, kind)
  tvb, at, range_at = buffer, offset, nil
  -- Where nobody asks for our fields, nobody sees which bytes the item stands for.
  tree = wanted and length > 0 and add(parent, daly, range(buffer, offset, length)) or add(parent, daly)
  if wanted then
    made(fields.kind, kind)
    made(fields.transport, transport)
  end
  return tree
end

local function one_record(parent, buffer, raw, item, pinfo)
  entry = nil
  local kind = item.kind
  local offset, length = item.at, item.length
  if item.bytes then
    buffer = ByteArray.new(item.bytes, true):tvb("Daly record")
    raw, offset, length = item.bytes, 0, #item.bytes
  else
    raw = raw:sub(offset + 1, offset + length)
  end
  local node = begin(parent, buffer, offset, length, kind)
  if item.since and wanted then
    made(fields.began_in, item.since)
  end
  local text, source, destination
  if kind == "frame" and item.dialect == "a5" then
    text, source, destination = a5(node, raw, item.slot)
  elseif kind == "frame" then
    text, source, destination = modbus(node, raw, item.slot)
  elseif kind == "event" then
    text = event_words(node, comment_words(packet_comment()))
  else
    text = damaged(node, kind, raw, item.name)
  end
  if visible and kind ~= "event" then
    node:append_text(", " .. text)
  end
  if item.name == foreign.MODBUS and transport == "uart" then
    mbrtu.show(parent, buffer, offset, raw, pinfo)
  end
  if tap then
    tap(pinfo.number, kind, raw, item.slot, kind == "frame" and item.dialect == "a5" and frame.table, results)
  end
  return text, source, destination
end

-- Bytes that begin a record of a later packet.
local function one_part(parent, buffer, item)
  local node = parent:add(daly, buffer(item.at, item.length))
  tree, tvb, at, range_at = node, buffer, item.at, nil
  if wanted then
    made(fields.continued_in, item.part)
  end
  if visible then
    node:append_text(format(", %d bytes of a record that ends in packet %d", item.length, item.part))
  end
  return format("%d bytes, continued in #%d", item.length, item.part)
end

-- Info column: all records of a packet, within reason.
local MOST_WORDS = 4

--- A packet of any records and parts of records: items as daly_streams gives them.
function M.several(parent, buffer, raw, items, pinfo)
  local texts, source, destination = {}, nil, nil
  for i = 1, #items do
    local text, from, to
    if items[i].part then
      text = one_part(parent, buffer, items[i])
    else
      text, from, to = one_record(parent, buffer, raw, items[i], pinfo)
    end
    if i <= MOST_WORDS then
      texts[i] = text
    end
    source, destination = source or from, destination or to
  end
  if #items > MOST_WORDS then
    texts[MOST_WORDS + 1] = format("and %d more", #items - MOST_WORDS)
  end
  local cols = pinfo.cols
  local words = concat(texts, " | ")
  if transport == "tcp" and tostring(cols.protocol) == "Daly" then -- more of the same segment
    words = tostring(cols.info) .. " | " .. words
  end
  cols.protocol = "Daly"
  cols.info = words
  if source then
    cols.src = source
    cols.dst = destination
  end
end

--- A packet that is one record of `kind`, whose `length` bytes stand at the buffer's beginning. `show(item, thing,
-- wanted)` adds its fields (M.out, whose data byte 0 is the buffer's first byte) and returns words, source,
-- destination; `raw` and `slot`: for daly_stat; `memory`: of daly_brief, for an A5 frame, or nil; `key`: its place
-- there. Returns its new entry, or nil.
function M.one(parent, buffer, length, kind, raw, slot, pinfo, show, thing, memory, key)
  local node = begin(parent, buffer, 0, length, kind)
  at, noted, entry, beginning, say = -4, false, memory and memory.entries[key], nil, nil
  frame.table = nil
  local text, source, destination = show(node, thing, wanted)
  local kept = memory and keep(memory, key, raw, slot, text, source, destination)
  set_columns(pinfo, text, source, destination)
  if visible then
    node:append_text(", " .. text)
  end
  if tap then
    tap(pinfo.number, kind, raw, slot, frame.table, results)
  end
  return kept
end

--- Show a frame with another carrier (above) by what it means: for M.one. `raw`: in the form of an A5 frame (daly_bus).
function M.a5_on(item, raw, slot, by)
  carrier = by
  local text, source, destination = a5(item, raw, slot)
  carrier = nil
  return text, source, destination
end

M.out, M.hex_words, M.id_words, M.host_name, M.reply_words = out, hex_words, id_words, host_name, reply_words

-- The place of an A5 frame's kind in a memory of daly_brief.
local function key_of(raw)
  local _, address, id, _, number = byte(raw, 1, 5)
  local key = (address * 256 + id) * 256
  return bursts.IDS[id] and address < 0x20 and key + number or key
end

--- A packet that is one whole frame, which is the usual one. `handle`, `known`, `read`, `medium`: as for M.look.
function M.whole(parent, handle, known, read, medium, buffer, raw, slot, pinfo)
  local is_a5 = byte(raw) == A5
  local memory, key = modbus_memory, raw
  if is_a5 then
    memory, key = a5_memory, key_of(raw)
  end
  entry = memory.entries[key]
  if entry and not read and brief.show(parent, handle, known, entry, slot, pinfo, raw) then
    return
  end
  look(parent, handle, known, read, medium)
  local node = begin(parent, buffer, 0, #raw, "frame")
  frame.table, noted, beginning, say = nil, false, nil, nil
  local text, source, destination
  if is_a5 then
    text, source, destination = a5(node, raw, slot)
  else
    text, source, destination = modbus(node, raw, slot)
  end
  keep(memory, key, raw, slot, text, source, destination)
  set_columns(pinfo, text, source, destination)
  if visible then
    node:append_text(", " .. text)
  end
  if tap then
    tap(pinfo.number, "frame", raw, slot, frame.table, results)
  end
end

return M
