-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Daly BMS in Wireshark and tshark:   tshark -X lua_script:dissector/daly.lua -r capture.pcapng
-- or: this folder's *.lua in Wireshark's personal Lua plugins folder (Help, About, Folders).
--
--   A5 frame    A5 | address | data ID | 08 | d0 d1 d2 d3 d4 d5 d6 d7 | sum          paper Daly UART/485 V1.2
--
--   packets --daly_streams--> records --daly_bus--> what they mean to each other --this file, daly_payload--> tree, columns
--
-- Runs in Lua 5.2 (Wireshark 4.0, 4.2) to 5.4 (4.4, 4.6).

-- Modules stand beside this file; from the global plugin folder of 4.0 and 4.2 Lua does not look there by itself.
local dir = debug.getinfo(1, "S").source:match("^@(.*[/\\])")
if dir and not package.path:find(dir, 1, true) then
  package.path = dir .. "?.lua;" .. package.path
end

local created, daly = pcall(Proto, "daly", "Daly BMS")
if not created then
  return -- loaded twice: the first one serves
end

if set_plugin_info then
  set_plugin_info({ version = "0.1.0", author = "dalyshark", description = "Daly battery management systems" })
end

local field_module = require("daly_fields")
local streams = require("daly_streams")
local records = require("daly_records")
local payload = require("daly_payload")

local fields, experts, data_ids = field_module.fields, field_module.experts, field_module.DATA_IDS
daly.fields = field_module.list
local expert_list = {}
for _, e in pairs(field_module.experts) do
  expert_list[#expert_list + 1] = e
end
daly.experts = expert_list

local byte, format, concat = string.byte, string.format, table.concat

-- Preferences: the constants of docs/records.md, and where our packets come from ------------------------------------------

local FIRST_DLT, LAST_DLT, PKTAP_DLT = 147, 162, 149

local prefs = daly.prefs
prefs.link_types = Pref.range(
  "Link types (DLT)",
  "147",
  "Link types, 147 (USER0) to 162 (USER15), whose packets hold bytes of a Daly bus. 149 is left out: Wireshark itself uses it.",
  LAST_DLT
)
prefs.baud = Pref.uint("Baud rate", 9600, "Baud rate of the bus, for the time that bytes take on the wire")
prefs.quiet = Pref.uint("Incomplete frame given up after (ms)", 250, "An incomplete frame is given up after so much quiet")
prefs.echo = Pref.uint("Echo within (ms)", 100, "A request that comes again within this time is an echo, later a retry")
prefs.reply = Pref.uint("Reply within (ms)", 1000, "A request waits so long for its reply")
prefs.burst = Pref.uint("Burst ends after quiet of (ms)", 500, "Frames of 0x95, 0x96 and texts further apart are not one burst")

local function seconds(milliseconds)
  return milliseconds / 1000
end

-- State of the capture that is open -------------------------------------------------------------------------------------

local capture -- as read in order, once
local interfaces -- by number: what is known of each
local handed -- packets that were given to the user's own DLT_USER setting, by number
local read_to -- number of the newest packet that was read

-- In the first of two passes (tshark -2, the GUI's loading, sharkd) Wireshark makes no tree unless a filter needs one, and
-- without a tree nobody can tell a packet's interface. All is then taken for one interface. A second look knows better:
-- if there are several, it reads the packets again, in order, as a single pass would. (tshark -2 -Y frame knows at once.)
local blind -- nil, or { capture =, interfaces =, after = number of the next packet by number, last =, only =, several = }

-- DLT_USER, which served our link types before, by wtap number; and those that the user has set nothing for.
local others, unset = {}, {}

local interface_id = Field.new("frame.interface_id")
local interface_description = Field.new("frame.interface_description")
local packet_comment = Field.new("frame.comment")
local has_not_handled, not_handled = pcall(Field.new, "user_dlt.not_handled")

local function new_capture()
  return streams.capture({
    baud = math.max(1, prefs.baud),
    quiet = seconds(prefs.quiet),
    echo = seconds(prefs.echo),
    reply = seconds(prefs.reply),
    burst = seconds(prefs.burst),
  })
end

function daly.init()
  capture = new_capture()
  interfaces, handed, read_to, blind = {}, {}, 0, nil
end

-- The interface of the packet at hand, in this list of those known; the number -1 stands for one that can't be told.
local function interface_of(known)
  local id = interface_id()
  local key = id and id.value or -1
  local interface = known[key]
  if not interface then
    local info = interface_description()
    local description = info and tostring(info.value) or ""
    interface = {
      key = key,
      ours = description:sub(1, 9) == "dalyshark",
      -- Interfaces are one bus when they name the same; else each is its own.
      bus = description:match("bus=([^%s,;]+)") or key,
      streams = {},
    }
    known[key] = interface
  end
  return interface
end

local function stream_of(from, interface, direction)
  local stream = interface.streams[direction]
  if not stream then
    local side = direction ~= -1 and direction or nil
    stream = streams.stream(from, interface.key * 4 + direction, interface.bus, side)
    interface.streams[direction] = stream
  end
  return stream
end

-- What to show a packet from that was read without its interface: the capture, and whether its end is known.
-- nil where packets of several interfaces were mixed up and this one was not read again: it is shown by itself.
local function second_look(number, direction, time, raw)
  if number == blind.after[blind.last] then
    local interface = interface_of(blind.interfaces)
    streams.first(blind.capture, stream_of(blind.capture, interface, direction), number, time, raw)
    blind.last = number
    blind.only = blind.only or interface.key
    blind.several = blind.several or interface.key ~= blind.only
  end
  if not blind.several then
    return capture, true
  elseif number <= blind.last then
    return blind.capture, false
  end
  return nil, true
end

-- Tree --------------------------------------------------------------------------------------------------------------------

-- Where the fields of the record at hand go. `wanted` is false when nobody asked for any of our fields.
local tree, tvb, at, visible, wanted

-- What was found out about the record at hand: `capture`, but for a second look.
local view

local out = {}

function out.bytes(field, first, length, unit)
  if tree:referenced(field) then
    local item = tree:add(field, tvb(at + 4 + first, length))
    if visible and unit then
      item:append_text(unit)
    end
  end
end

function out.value(field, first, length, value, unit)
  if tree:referenced(field) then
    local item = tree:add(field, tvb(at + 4 + first, length), value)
    if visible and unit then
      item:append_text(unit)
    end
  end
end

function out.little(field, first, length)
  if tree:referenced(field) then
    tree:add_le(field, tvb(at + 4 + first, length))
  end
end

function out.cell(field, first, length, number, unit)
  if tree:referenced(field) then
    local item = tree:add(field, tvb(at + 4 + first, length))
    if visible then
      item:prepend_text(format("Cell %d: ", number)):append_text(unit)
    end
  end
end

function out.made(field, value, unit)
  if tree:referenced(field) then
    local item = tree:add(field, value):set_generated()
    if visible and unit then
      item:append_text(unit)
    end
  end
end

local function header(field, offset, length)
  if tree:referenced(field) then
    tree:add(field, tvb(at + offset, length))
  end
end

local made = out.made

-- Head and tail of 13 bytes A5 . . 08: what a damaged frame shows too.
local function show_frame(status)
  made(fields.dialect, "a5")
  header(fields.start, 0, 1)
  header(fields.address, 1, 1)
  header(fields.data_id, 2, 1)
  header(fields.length, 3, 1)
  header(fields.data, 4, 8)
  header(fields.checksum, 12, 1)
  made(fields.checksum_status, status)
end

-- Columns -----------------------------------------------------------------------------------------------------------------

local HOSTS = { [0x40] = "PC", [0x80] = "App", [0x20] = "GPRS" }

local function host_name(address)
  return format("%s 0x%02X", HOSTS[address] or (address > 0x40 and address <= 0x4F and "PC" or "Host"), address)
end

-- Board that a request names, or that replies; nil where it is not known.
local function board_of(address)
  if address >= 0x40 and address <= 0x4F then
    return address - 0x3F
  elseif address >= 0x01 and address <= 0x10 then
    return address
  end
  return nil
end

local function id_words(id)
  local name = data_ids[id]
  return name and format("0x%02X %s", id, name) or format("0x%02X", id)
end

-- The constant part of a frame's words, by address * 256 + ID.
local beginnings, sources, destinations = {}, {}, {}

local function names_of(address, id)
  local key = address * 256 + id
  if not beginnings[key] then
    local board = board_of(address)
    local who = board and format("board %d", board) or (address >= 0x20 and "any board" or "unknown board")
    beginnings[key] = format("%s  %s", who, id_words(id))
    local host = address >= 0x20 and host_name(address) or "Host"
    local other = board and format("Board %d", board) or (address >= 0x20 and "Board" or format("Board 0x%02X", address))
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

-- Records -----------------------------------------------------------------------------------------------------------------

local frame = {} -- the one at hand, for daly_payload

-- An A5 frame: fields, expert notes; returns words, source, destination.
local function a5(item, raw, slot, again)
  local results = view.results
  local address, id = byte(raw, 2, 3)
  local flag = results.flag[slot]
  local beginning, source, destination = names_of(address, id)
  local reply = address < 0x20
  local text
  frame.raw = raw
  if reply then
    local memory = results.memory[slot]
    frame.memory = memory
    frame.cells = id == 0x95 and payload.cells(slot, memory, again) or nil
    local words = payload.words[id]
    if words then
      text = "Reply " .. beginning .. ": " .. words(frame)
    else
      text = "Reply " .. beginning .. "  " .. hex_words(raw, 5, 12)
    end
  elseif flag == "echo" then
    text = "Echo " .. beginning
    source, destination = "Echo", source
    item:add_proto_expert_info(experts.echo)
  elseif flag == "retry" then
    text = "Request " .. beginning .. "  [retry]"
  else
    text = "Request " .. beginning
  end
  if reply then
    if id == 0x98 or (frame.memory and frame.memory ~= true and type(frame.memory) == "table") then
      local complaints = payload.complaints(id, frame)
      for i = 1, #complaints do
        item:add_proto_expert_info(experts[complaints[i][1]], complaints[i][2])
      end
    end
  end
  if not wanted then
    return text, source, destination
  end
  show_frame(1)
  made(fields.direction, reply and 2 or flag == "echo" and 3 or 1)
  local board = board_of(address)
  if board then
    made(fields.board, board)
  end
  if flag == "retry" then
    made(fields.retry, true)
  end
  local link = results.link[slot]
  if link then
    made(reply and fields.request_in or fields.reply_in, link)
  end
  local wait = results.wait[slot]
  if wait then
    made(fields.response_time, wait, " s")
  end
  if reply and payload.show[id] then
    payload.show[id](frame, out)
  end
  return text, source, destination
end

local function modbus(item, raw)
  local address, fn = byte(raw, 1, 2)
  local dialect = address == 0xD2 and "d2" or "81"
  if wanted then
    local length = #raw
    made(fields.dialect, dialect)
    header(fields.modbus_address, 0, 1)
    header(fields.modbus_function, 1, 1)
    header(fields.undecoded, 2, length - 4)
    if tree:referenced(fields.modbus_crc) then
      tree:add_le(fields.modbus_crc, tvb(at + length - 2, 2))
    end
    made(fields.modbus_crc_status, 1)
  end
  if visible then
    item:append_text(", Modbus RTU")
  end
  return format("Modbus %s  address 0x%02X  function 0x%02X  %d bytes", dialect:upper(), address, fn, #raw)
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
    item:add_proto_expert_info(
      experts.bad_checksum,
      format("Checksum is 0x%02X, the bytes sum up to 0x%02X", byte(raw, 13), sum)
    )
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
    item:add_proto_expert_info(experts.short, format("Frame is cut off after %d bytes", length))
  else
    item:add_proto_expert_info(experts.junk, format("%d bytes that are no frame", length))
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
  tvb, at = buffer, offset
  tree = length > 0 and parent:add(daly, buffer(offset, length)) or parent:add(daly)
  if wanted then
    made(fields.kind, kind)
    made(fields.transport, "uart")
  end
  return tree
end

local function one_record(parent, buffer, raw, item, again)
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
    text, source, destination = a5(node, raw, item.slot, again)
  elseif kind == "frame" then
    text = modbus(node, raw)
  elseif kind == "event" then
    local comment = packet_comment()
    text = event_words(node, comment and tostring(comment.value) or "")
  else
    text = damaged(node, kind, raw, item.name)
  end
  if visible and kind ~= "event" then
    node:append_text(", " .. text)
  end
  return text, source, destination
end

-- Bytes that begin a record of a later packet.
local function one_part(parent, buffer, item)
  local node = parent:add(daly, buffer(item.at, item.length))
  tree, tvb, at = node, buffer, item.at
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

local function several(parent, buffer, raw, items, again, pinfo)
  local texts, source, destination = {}, nil, nil
  for i = 1, #items do
    local item, text, from, to = items[i], nil, nil, nil
    if item.part then
      text = one_part(parent, buffer, item)
    else
      text, from, to = one_record(parent, buffer, raw, item, again)
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
  cols.protocol = "Daly"
  cols.info = concat(texts, " | ")
  if source then
    cols.src = source
    cols.dst = destination
  end
end

-- Packets -----------------------------------------------------------------------------------------------------------------

local handle

-- Whether any of these items is a frame, or a part of one.
local function has_frame(items)
  for i = 1, #items do
    if items[i].kind == "frame" or items[i].part then
      return true
    end
  end
  return false
end

-- Packets on a user's link type without a Daly frame belong to the user's own setting, where there is one (DESIGN 4).
-- Returns how many bytes that setting's dissector took, or nil when there is none.
local function hand_over(buffer, pinfo, parent)
  local encapsulation = pinfo.match_uint
  local other = others[encapsulation]
  if not other or unset[encapsulation] then
    return nil
  end
  local taken = other:call(buffer, pinfo, parent)
  if has_not_handled and not_handled() then
    unset[encapsulation] = true
    return nil
  end
  return taken
end

function daly.dissector(buffer, pinfo, parent)
  local length = buffer:captured_len()
  local number = pinfo.number
  local raw = length > 0 and buffer:raw(0, length) or ""
  local again = pinfo.visited or number <= read_to
  local whole
  handle = handle or Dissector.get("daly")
  wanted = parent:referenced(handle)
  visible = parent.visible

  view = capture
  if not again then
    read_to = number
    local interface = interface_of(interfaces)
    local direction = pinfo.p2p_dir
    whole = streams.first(capture, stream_of(capture, interface, direction), number, pinfo.rel_ts, raw)
    if interface.key == -1 then
      blind = blind or { capture = new_capture(), interfaces = {}, after = {}, last = 0, newest = 0 }
      blind.after[blind.newest] = number
      blind.newest = number
    end
    if not interface.ours then
      if whole or has_frame(streams.plan(capture, number, false)) then
        interface.ours = true
      else
        handed[number] = true
      end
    end
  else
    if blind then
      view, again = second_look(number, pinfo.p2p_dir, pinfo.rel_ts, raw)
    end
    whole = view and view.plans[number] == nil and length == 13 and byte(raw, 1) == 0xA5
  end

  if whole then
    local node = begin(parent, buffer, 0, 13, "frame")
    local text, source, destination = a5(node, raw, number, again)
    local cols = pinfo.cols
    cols.protocol = "Daly"
    cols.info = text
    cols.src = source
    cols.dst = destination
    if visible then
      node:append_text(", " .. text)
    end
    return length
  end

  local items = view and streams.plan(view, number, again)
  if not items then -- nothing is known of it (see second_look; with -R, packets are left out and numbers come twice)
    view = streams.capture({ baud = 9600 })
    items = records.alone(raw)
  end
  if handed[number] then
    if has_frame(items) then
      handed[number] = nil
    elseif hand_over(buffer, pinfo, parent) then
      return length
    end
  end
  several(parent, buffer, raw, items, again, pinfo)
  return length
end

-- Doors -------------------------------------------------------------------------------------------------------------------

local encapsulations = DissectorTable.get("wtap_encap")
local claimed = {}

-- The link types of a range such as "147,150-152".
local function link_types(range)
  local wanted_types = {}
  for first, last in tostring(range):gmatch("(%d+)%-?(%d*)") do
    first = tonumber(first)
    for dlt = math.max(first, FIRST_DLT), math.min(tonumber(last) or first, LAST_DLT) do
      if dlt ~= PKTAP_DLT then
        wanted_types[dlt] = true
      end
    end
  end
  return wanted_types
end

local function claim()
  local wanted_types = link_types(prefs.link_types)
  for dlt = FIRST_DLT, LAST_DLT do
    local encapsulation = wtap["USER" .. (dlt - FIRST_DLT)]
    if wanted_types[dlt] and not claimed[dlt] then
      others[encapsulation] = others[encapsulation] or encapsulations:get_dissector(encapsulation)
      encapsulations:add(encapsulation, daly)
      claimed[dlt] = true
    elseif claimed[dlt] and not wanted_types[dlt] then
      encapsulations:remove(encapsulation, daly)
      if others[encapsulation] then
        encapsulations:add(encapsulation, others[encapsulation])
      end
      claimed[dlt] = nil
    end
  end
end

function daly.prefs_changed()
  claim()
end

claim()
