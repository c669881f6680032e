-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Daly BMS in Wireshark and tshark:   tshark -X lua_script:dissector/daly.lua -r capture.pcapng
-- or: this folder's *.lua in Wireshark's personal Lua plugins folder (Help, About, Folders).
--
--   A5 frame    A5 | address | data ID | 08 | d0 d1 d2 d3 d4 d5 d6 d7 | sum          paper Daly UART/485 V1.2
--
--   packets --daly_serial, daly_tcp, daly_can, daly_ble--> records --daly_bus--> meaning --daly_view--> tree, columns
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
local getters = require("daly_getters")
local windows = require("daly_windows")
local view = require("daly_view")
local serial = require("daly_serial")
local tcp = require("daly_tcp")
local can = require("daly_can")
local ble = require("daly_ble")
local collector = require("daly_collector")
require("daly_stat").register()
require("daly_hexlog").register()

view.setup(daly)
daly.fields = field_module.list
local expert_list = {}
for _, e in pairs(field_module.experts) do
  expert_list[#expert_list + 1] = e
end
daly.experts = expert_list

-- Preferences: the constants of docs/records.md, and where our packets come from ------------------

local FIRST_DLT, LAST_DLT, PKTAP_DLT = 147, 162, 149
local LAST_PORT = 65535
local LAST_HANDLE = 65535

local prefs = daly.prefs
prefs.link_types = Pref.range(
  "Link types (DLT)",
  "147",
  "Link types, 147 (USER0) to 162 (USER15), whose packets hold bytes of a Daly bus. Not 149: Wireshark itself uses it.",
  LAST_DLT
)
prefs.tcp_ports =
  Pref.range("TCP ports", "", "Ports of serial servers that carry the bytes of a bus (raw, no Telnet)", LAST_PORT)
prefs.heuristic = Pref.bool(
  "Look for Daly frames in any TCP connection",
  false,
  "Take a TCP connection for a bus when it begins with a Daly frame, whatever its port"
)
prefs.can = Pref.bool(
  "Look for Daly frames on CAN",
  true,
  "Take CAN frames with Daly's identifiers for Daly's; off: only where you choose Daly for CAN (Decode As)"
)
prefs.ble_handles = Pref.range(
  "Bluetooth handles",
  "",
  "Handles of attributes that are a board's, where the capture does not hold their discovery; old dongles: 15,17,48",
  LAST_HANDLE
)
prefs.modbus = Pref.bool(
  "Recognise Modbus frames",
  true,
  "Frames of Daly's Modbus dialects (addresses D2, 81..90, 51..60) are records; off: their bytes are junk"
)
prefs.baud = Pref.uint("Baud rate", 9600, "Baud rate of the bus, for the time that bytes take on the wire")
prefs.quiet =
  Pref.uint("Incomplete frame given up after (ms)", 250, "An incomplete frame is given up after so much quiet")
prefs.echo = Pref.uint("Echo within (ms)", 100, "A request that comes again within this time is an echo, later a retry")
prefs.reply = Pref.uint("Reply within (ms)", 1000, "A request waits so long for its reply")
prefs.late =
  Pref.uint("Late reply within (ms)", 10000, "A reply later than its request waits, but within this, is late")
prefs.slow = Pref.uint("Slow reply after (ms)", 500, "A reply that takes longer than this gets a note")
prefs.burst =
  Pref.uint("Burst ends after quiet of (ms)", 500, "Frames of 0x95, 0x96 and texts further apart are not one burst")
prefs.age = Pref.uint("Records compared within (ms)", 10000, "Records further apart do not contradict each other")
prefs.cell_tolerance =
  Pref.uint("Tolerance of cell voltages (mV)", 20, "0x91 and the cells of 0x95 may differ by so much")
prefs.temperature_tolerance =
  Pref.uint("Tolerance of temperatures (C)", 2, "0x92 and the sensors of 0x96 may differ by so much")
prefs.sum_tolerance =
  Pref.uint("Tolerance of the pack voltage (%)", 1, "The pack voltage and the sum of the cells may differ by so much")

prefs.soc_tolerance = Pref.uint("Tolerance of the SOC (%)", 1, "The SOC over A5 and over Modbus may differ by so much")

local function seconds(milliseconds)
  return milliseconds / 1000
end

-- Packets -----------------------------------------------------------------------------------------

local function begin()
  windows.recognise_modbus(prefs.modbus)
  local options = {
    baud = math.max(1, prefs.baud),
    quiet = seconds(prefs.quiet),
    echo = seconds(prefs.echo),
    reply = seconds(prefs.reply),
    late = seconds(prefs.late),
    slow = seconds(prefs.slow),
    burst = seconds(prefs.burst),
    age = seconds(prefs.age),
    cell_tolerance = prefs.cell_tolerance,
    temperature_tolerance = prefs.temperature_tolerance,
    sum_tolerance = prefs.sum_tolerance,
    soc_tolerance = prefs.soc_tolerance,
  }
  view.init(options)
  serial.init(options)
  tcp.init(options)
  can.init(options, prefs.can)
  ble.init(options, prefs.ble_handles)
  collector.init()
end

local NO_PORTS = 0 -- pinfo.port_type of what is not TCP, UDP or the like
local CHOSEN = 0 -- pinfo.match_uint where the user chose us (Decode As)
local LOWEST = can.LOWEST
local show_can, show_serial = can.dissect, serial.dissect

local ports_of, brought_by = getters.attribute("Pinfo", "port_type"), getters.attribute("Pinfo", "match_uint")
local handle

function daly.dissector(buffer, pinfo, parent)
  handle = handle or Dissector.get("daly")
  local key = brought_by(pinfo)
  if key > LAST_PORT then -- an extended identifier of CAN: nothing else that brings us packets is so high
    return show_can(buffer, pinfo, parent, handle, key)
  end
  local ports = ports_of(pinfo)
  if ports ~= NO_PORTS then
    return (ports == ble.PORT_TYPE and ble or tcp).dissect(buffer, pinfo, parent, handle)
  elseif key >= LOWEST or key == CHOSEN and can.brought(buffer, key) then
    return show_can(buffer, pinfo, parent, handle, key)
  end
  return show_serial(buffer, pinfo, parent, handle, key)
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
      serial.others[encapsulation] = serial.others[encapsulation] or encapsulations:get_dissector(encapsulation)
      encapsulations:add(encapsulation, daly)
      claimed[dlt] = true
    elseif claimed[dlt] and not wanted_types[dlt] then
      encapsulations:remove(encapsulation, daly)
      if serial.others[encapsulation] then
        encapsulations:add(encapsulation, serial.others[encapsulation])
      end
      claimed[dlt] = nil
    end
  end
end

-- TCP ports that are ours, as the preference says.
local tcp_ports = DissectorTable.get("tcp.port")
local claimed_ports = ""

local function claim_ports()
  local wanted = tostring(prefs.tcp_ports)
  if wanted == claimed_ports then
    return
  end
  if claimed_ports ~= "" then
    tcp_ports:remove(claimed_ports, daly)
  end
  if wanted ~= "" then
    tcp_ports:add(wanted, daly)
  end
  claimed_ports = wanted
end

local function take_doors()
  claim()
  claim_ports()
end

daly.prefs_changed = take_doors

-- Here too: some programs (sharkd) change preferences without telling.
function daly.init()
  take_doors()
  begin()
end

claim()
can.setup(daly)
ble.setup(daly)
tcp_ports:add_for_decode_as(daly)
DissectorTable.get("rtacser.data"):add_for_decode_as(daly)

daly:register_heuristic("tcp", function(buffer, pinfo, parent)
  if not prefs.heuristic or not tcp.looks_like(buffer) then
    return false
  end
  pinfo.conversation = daly
  daly.dissector(buffer, pinfo, parent)
  return true
end)
