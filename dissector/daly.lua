-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Daly BMS in Wireshark and tshark:   tshark -X lua_script:dissector/daly.lua -r capture.pcapng
-- or: this folder's *.lua in Wireshark's personal Lua plugins folder (Help, About, Folders).
--
--   A5 frame    A5 | address | data ID | 08 | d0 d1 d2 d3 d4 d5 d6 d7 | sum          paper Daly UART/485 V1.2
--
--   packets --daly_streams--> records --daly_bus--> their meaning --daly_view--> tree, columns
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
local view = require("daly_view")

view.setup(daly)
daly.fields = field_module.list
local expert_list = {}
for _, e in pairs(field_module.experts) do
  expert_list[#expert_list + 1] = e
end
daly.experts = expert_list

-- Preferences: the constants of docs/records.md, and where our packets come from ------------------

local FIRST_DLT, LAST_DLT, PKTAP_DLT = 147, 162, 149

local prefs = daly.prefs
prefs.link_types = Pref.range(
  "Link types (DLT)",
  "147",
  "Link types, 147 (USER0) to 162 (USER15), whose packets hold bytes of a Daly bus. Not 149: Wireshark itself uses it.",
  LAST_DLT
)
prefs.baud = Pref.uint("Baud rate", 9600, "Baud rate of the bus, for the time that bytes take on the wire")
prefs.quiet =
  Pref.uint("Incomplete frame given up after (ms)", 250, "An incomplete frame is given up after so much quiet")
prefs.echo = Pref.uint("Echo within (ms)", 100, "A request that comes again within this time is an echo, later a retry")
prefs.reply = Pref.uint("Reply within (ms)", 1000, "A request waits so long for its reply")
prefs.burst =
  Pref.uint("Burst ends after quiet of (ms)", 500, "Frames of 0x95, 0x96 and texts further apart are not one burst")

local function seconds(milliseconds)
  return milliseconds / 1000
end

-- State of the capture that is open ---------------------------------------------------------------

local capture -- as read in order, once
local interfaces -- by number: what is known of each
local handed -- packets that were given to the user's own DLT_USER setting, by number
local read_to -- number of the newest packet that was read

-- In the first of two passes (tshark -2, the GUI's loading, sharkd) Wireshark makes no tree unless a filter needs one,
-- and without a tree nobody can tell a packet's interface. All is then taken for one interface. A second look knows
-- better: if there are several, it reads the packets again, in order, as a single pass would. (tshark -2 -Y frame knows
-- at once.) nil, or { capture =, interfaces =, after = the next packet's number by number, newest =: the last of those,
-- last =: number of the last packet read again, only =: the interface, several =: it is not the only one }.
local blind

-- DLT_USER, which served our link types before, by wtap number; and those that the user has set nothing for.
local others, unset = {}, {}

local interface_id = Field.new("frame.interface_id")
local interface_description = Field.new("frame.interface_description")
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
  local interface = interface_of(blind.interfaces)
  blind.only = blind.only or interface.key
  blind.several = blind.several or interface.key ~= blind.only
  if number == blind.after[blind.last] then
    streams.first(blind.capture, stream_of(blind.capture, interface, direction), number, time, raw)
    blind.last = number
  end
  if not blind.several then
    return capture, true
  elseif number <= blind.last then
    return blind.capture, false
  end
  return nil, true
end

-- Packets -----------------------------------------------------------------------------------------

local handle
local bytes_of = Tvb.raw

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
  local raw = bytes_of(buffer)
  local length = #raw
  local number = pinfo.number
  local again = number <= read_to or pinfo.visited
  local from = capture
  local whole
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
      from, again = second_look(number, pinfo.p2p_dir, pinfo.rel_ts, raw)
    end
    whole = from and from.plans[number] == nil and length == 13 and raw:byte() == 0xA5
  end

  handle = handle or Dissector.get("daly")
  if whole then
    view.look(parent, handle, from.results, again)
    view.whole(parent, buffer, raw, number, pinfo)
    return length
  end

  local items = from and streams.plan(from, number, again)
  if not items then -- nothing is known of it (see second_look; with -R, packets are left out and numbers come twice)
    from, items = streams.capture({ baud = prefs.baud }), records.alone(raw)
  end
  if handed[number] then
    if has_frame(items) then
      handed[number] = nil
    elseif hand_over(buffer, pinfo, parent) then
      return length
    end
  end
  view.look(parent, handle, from.results, again)
  view.several(parent, buffer, raw, items, pinfo)
  return length
end

-- Doors -------------------------------------------------------------------------------------------

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
