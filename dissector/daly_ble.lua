-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Bluetooth: values of a board's attributes in HCI captures (docs/wires.md 3).
--
-- No dissector of Wireshark's hands us what we need - events, discovery, the operation that a value comes with - where
-- there is no tree. So we look at whole packets ourselves, after Wireshark's dissectors (a postdissector). That costs
-- something for each packet of any capture; so it begins with the first packet of H4, or when the first value of any
-- attribute of Bluetooth comes by.
--
--   packet --daly_hci--> value of an attribute of ours --daly_streams--> records --> daly_view
--
-- What was there before that first value is read at a second look.

local hci = require("daly_hci")
local second_look = require("daly_second_look")
local streams = require("daly_streams")
local view = require("daly_view")

local M = {}

local MOST_HANDLE = 65535

-- State of the capture that is open.
local options
local first -- as read in order, once
local read_to -- number of the newest packet that was read
local began -- number of the first packet that was read, and whether discovery of an attribute of ours was known by then
local learned
local blind -- for a second look (daly_second_look): packets may have been read without a tree, or not at all
local untold -- whether some were read without a tree, so that their adapters are not known
local chosen = {} -- handles that are Daly's: by preference or by the user's choice

local hook -- protocol of the postdissector
local watching = false
local at_hand -- { state, number, again, raw }: what daly's dissector is called for

local attributes = DissectorTable.get("btatt.handle")
local has_tree = Field.new("frame") -- Wireshark asks for this one anyway
local interface_id = Field.new("frame.interface_id")
local has_adapter, adapter_id = pcall(Field.new, "hci_mon.adapter_id")

-- What is known of a capture.
local function new_state()
  local without_time = {}
  for name, value in pairs(options) do
    without_time[name] = value
  end
  -- Silence divides nothing, and a byte takes no time.
  without_time.baud, without_time.quiet = math.huge, math.huge
  return {
    host = hci.new(chosen),
    capture = streams.capture(without_time),
    values = {}, -- by packet number: what it carries of ours
    places = {}, -- where it stands in the packet; nil: it came in several packets
  }
end

-- Handles of a preference's range such as "15,17".
local function handles_of(range)
  local set = {}
  for from, to in tostring(range):gmatch("(%d+)%-?(%d*)") do
    from = tonumber(from)
    for handle = from, math.min(tonumber(to) or from, MOST_HANDLE) do
      set[handle] = true
    end
  end
  return set
end

-- Come in at the values of all attributes, where nobody else is: what handles a board's have, its maker decides.
local function come_in()
  local others, free = attributes.get_dissector, 1
  for handle = 1, MOST_HANDLE + 1 do
    if handle > MOST_HANDLE or others(attributes, handle) then
      if free < handle then
        attributes:add(free .. "-" .. handle - 1, hook)
      end
      free = handle + 1
    end
  end
end

--- Begin a capture. `with`: see daly_streams.capture; `handles`: the preference.
function M.init(with, handles)
  options, chosen = with, handles_of(handles)
  first, read_to, began, untold = new_state(), 0, nil, false
  blind = second_look.new(new_state())
  blind.early = 0 -- number of the newest of those that were not read at first
end

-- Reading -----------------------------------------------------------------------------------------

-- A piece of text that the module says for itself.
local function is_text(value)
  return #value >= 2
    and not value:find("[^\x20-\x7E\r\n]")
    and (
      value:find("^AT") ~= nil
      or value:find("^%+") ~= nil
      or value:find("^OK") ~= nil
      or value:find("^ERROR") ~= nil
      or value:find("^HiLink") ~= nil
    )
end

local function stream_of(capture, connection, way)
  return streams.stream(capture, connection.number * 2 + way, connection.number, way)
end

-- One packet, in the order of the capture, once. `unseen`: the one before it was not read.
local function read(state, adapter, number, pinfo, raw, length, unseen)
  local connection, value, way, at, lost, cut = hci.read(state.host, raw, length, adapter, pinfo.p2p_dir, unseen)
  if not connection then
    return
  end
  local capture = state.capture
  if lost then
    streams.divide(capture, stream_of(capture, connection, lost))
  end
  if cut then
    streams.divide(capture, stream_of(capture, connection, cut))
  end
  if value and value ~= "" then
    local stream = stream_of(capture, connection, way)
    state.values[number], state.places[number] = value, at
    if is_text(value) and not streams.is_open(stream) then
      streams.aside(capture, stream, number, pinfo.rel_ts, value, "Bluetooth module")
    else
      streams.first(capture, stream, number, pinfo.rel_ts, value)
    end
  end
end

-- Where the packet comes from, as a number: of its interface and its adapter.
local function adapter_of()
  local interface, adapter = interface_id(), has_adapter and adapter_id()
  return (interface and interface.value or 0) * 65536 + (adapter and adapter.value or 0)
end

-- What to show a packet from that was read before, and whether it was read again.
local function look_again(number, pinfo, raw, length)
  if not has_tree() then -- no tree now either
    if not blind.several then
      return first, false
    end
    return number <= blind.last and blind.state or nil, not second_look.is_complete(blind)
  end
  local adapter = adapter_of()
  if blind.last == 0 and number < (began or math.huge) then
    if number > blind.early then -- from before we came in
      blind.early = number
      read(blind.state, adapter, number, pinfo, raw, length)
    end
    return nil, true
  end
  local complete = number ~= began or number == blind.early + 1
  -- Where all adapters were known at first, they are no reason to read again.
  local line = untold and adapter or 0
  local state, anew =
    second_look.look(blind, first, number, line, false, read, adapter, number, pinfo, raw, length, not complete)
  if number == began and complete and not blind.several and blind.state.host.learned ~= learned then
    blind.several = true -- what came before tells otherwise
    return blind.state, true
  end
  return state, anew
end

local function look(buffer, pinfo, parent)
  local number, raw, length = pinfo.number, buffer:raw(), buffer:reported_len()
  if not hci.shape(raw, length) then
    return
  end
  local state, again = first, number <= read_to or pinfo.visited
  if not again then
    read_to = number
    local told = has_tree()
    untold = untold or not told
    read(first, told and adapter_of() or 0, number, pinfo, raw, length, not began and number > 1)
    if not began then
      began, learned = number, first.host.learned
    end
    second_look.note(blind, number)
  else
    local anew
    state, anew = look_again(number, pinfo, raw, length)
    again = not anew
  end
  local value = state and state.values[number]
  if not value then
    return
  end
  local handle = Dissector.get("daly")
  at_hand = { state = state, number = number, again = again }
  local place = state.places[number]
  if not place then
    handle:call(ByteArray.new(value, true):tvb("ATT value"), pinfo, parent)
  elseif raw:sub(place, place + #value - 1) == value then -- with -R, numbers come twice
    handle:call(buffer(place - 1, #value):tvb(), pinfo, parent)
  end
  at_hand = nil
end

-- Doors -------------------------------------------------------------------------------------------

-- Discovery before the first value that comes by would be missed: where Wireshark's dissectors need nothing from
-- outside a packet (H4, but not the monitor's and H1's), we begin with the first one, which we hand on; then the door
-- is Wireshark's own again.
local encapsulations = DissectorTable.get("wtap_encap")
local wiresharks = {} -- by number of the encapsulation

-- From now on look at each packet.
local function watch()
  if not watching then
    watching = true
    register_postdissector(hook)
    for encapsulation, door in pairs(wiresharks) do
      encapsulations:add(encapsulation, door)
    end
  end
end

local function hand_on(buffer, pinfo, parent)
  watch()
  return wiresharks[pinfo.match_uint]:call(buffer, pinfo, parent)
end

--- Once: where we come in. `daly`: the protocol.
function M.setup(daly)
  -- With each handle Wireshark looks for the protocol in a list sorted by name, behind all of Bluetooth's own, which
  -- begin with bt: there it would start up half again as slowly.
  -- It stands in frame.protocols of a first packet, whose traffic ours may not be: so it is not named for Daly.
  hook = Proto("ble_bms", "BMS over Bluetooth")
  function hook.dissector(buffer, pinfo, parent)
    if buffer:offset() > 0 then -- the value of an attribute
      watch()
    elseif not watching then
      return hand_on(buffer, pinfo, parent)
    elseif pinfo.port_type == M.PORT_TYPE then
      look(buffer, pinfo, parent)
    end
    return 0
  end
  come_in()
  for _, encapsulation in ipairs({ wtap.BLUETOOTH_H4, wtap.BLUETOOTH_H4_WITH_PHDR }) do
    wiresharks[encapsulation] = encapsulations:get_dissector(encapsulation)
    if wiresharks[encapsulation] then
      encapsulations:add(encapsulation, hook)
    end
  end
  attributes:add_for_decode_as(daly)
end

--- pinfo.port_type of Bluetooth.
M.PORT_TYPE = 11

--- What daly's dissector is called for in Bluetooth: to show the value at hand, or because the user chose Daly for an
-- attribute (Decode As). `handle`: daly's dissector. Returns how many bytes were taken.
function M.dissect(buffer, pinfo, parent, handle)
  if not at_hand then
    chosen[pinfo.match_uint] = true
    watch()
    return 0
  end
  local number, again = at_hand.number, at_hand.again
  local capture = at_hand.state.capture
  local raw = buffer:raw()
  local items = streams.plan(capture, number, again)
  if items then
    view.look(parent, handle, capture.results, again, "ble")
    view.several(parent, buffer, raw, items, pinfo)
  else
    view.whole(parent, handle, capture.results, again, "ble", buffer, raw, number, pinfo)
  end
  return #raw
end

return M
