-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Packets of a serial line: a capture of a user link type (each packet is bytes of the line, docs/records.md 1), or an
-- RTAC serial capture (link type 250), whose own dissector takes a header of 12 bytes off and hands us the rest.
--
--   packet --interface, direction--> stream (daly_streams) --> records --> daly_view

local getters = require("daly_getters")
local streams = require("daly_streams")
local records = require("daly_records")
local is_known = require("daly_results").is_known
local second_look = require("daly_second_look")
local view = require("daly_view")
local windows = require("daly_windows")

local M = {}

local bytes_of = Tvb.raw
local read_first, show_whole = streams.first, view.whole
local number_of, is_again = getters.attribute("Pinfo", "number"), getters.attribute("Pinfo", "visited")
local time_of, side_of = getters.attribute("Pinfo", "rel_ts"), getters.attribute("Pinfo", "p2p_dir")
local value_of = getters.attribute("FieldInfo", "value")
local extract = getters.operator("Field", "__call", function(field)
  return field()
end)

-- State of the capture that is open.
local options
local capture -- as read in order, once
local interfaces -- by number: what is known of each
local newest_id, newest_direction -- of the newest packet: of its interface; and what is known of that and of its line
local newest_interface, newest_stream
local handed -- packets that were given to the user's own DLT_USER setting, by number
local read_to -- number of the newest packet that was read

-- Packets whose interface could not be told (daly_second_look), nil: none. With one_way: RTAC's directions could not be
-- told either; interfaces: as found at the second look.
local blind

-- DLT_USER, which served our link types before, by wtap number; and those that the user has set nothing for.
local unset = {}
M.others = {}

local has_tree = Field.new("frame") -- Wireshark asks for this one anyway
local interface_id = Field.new("frame.interface_id")
local interface_description = Field.new("frame.interface_description")
local has_not_handled, not_handled = pcall(Field.new, "user_dlt.not_handled")
local has_rtac, rtac_event = pcall(Field.new, "rtacser.eventtype")

-- pinfo.match_uint where no number but the user's choice (Decode As) brought the packet here, as of RTAC's.
local CHOSEN = 0

-- RTAC serial: events 01 and 02 carry data, sent and received by the RTAC; as p2p_dir: 0 sent, 1 received.
local RTAC_DIRECTION = { [1] = 0, [2] = 1 }

--- Begin a capture. `with`: see daly_streams.capture.
function M.init(with)
  options = with
  capture = streams.capture(options)
  interfaces, handed, read_to, blind = {}, {}, 0, nil
  newest_id = nil
end

--- What was found out about the capture's frames so far, see daly_streams.
function M.capture()
  return capture
end

-- Number of the interface of the packet at hand; -1: it can't be told.
local function interface_key()
  local id = extract(interface_id)
  return id and value_of(id) or -1
end

-- The interface of the packet at hand, which has this number, in this list of those known.
local function interface_of(known, key)
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

-- Direction of the packet at hand: -1 not known, 0 sent, 1 received; and whether it takes a tree to know it. `key`: as
-- in M.dissect.
local function direction_of(pinfo, key)
  if key == CHOSEN and has_rtac then
    local event = rtac_event()
    return event and RTAC_DIRECTION[event.value] or -1, event == nil
  end
  return side_of(pinfo), false
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

local function read_again(state, interface, direction, number, pinfo, raw)
  streams.first(state, stream_of(state, interface, direction), number, time_of(pinfo), raw)
end

-- What to show a packet from that was read without its interface: the capture, and whether its end is known.
-- nil where packets of several interfaces were mixed up and this one was not read again: it is shown by itself.
local function look_again(number, pinfo, raw, key)
  local interface, direction = interface_of(blind.interfaces, interface_key()), direction_of(pinfo, key)
  if interface.ours then -- as only its description tells, which nobody saw at first
    handed[number] = nil
  end
  -- A direction that was known in the first pass too divides nothing that was not divided then.
  local line = interface.key * 4 + (blind.one_way and direction or -1)
  local from, anew =
    second_look.look(blind, capture, number, line, false, read_again, interface, direction, number, pinfo, raw)
  return from, not anew
end

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
  local other = M.others[encapsulation]
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

--- Dissect a packet of a serial line. `handle`: our protocol's dissector; `key`: what brought it here, as
-- pinfo.match_uint has it. Returns how many bytes were taken.
function M.dissect(buffer, pinfo, parent, handle, key)
  local raw = bytes_of(buffer)
  local length = #raw
  local number = number_of(pinfo)
  local again = number <= read_to or is_again(pinfo)
  local from = capture
  local whole
  if not again then
    read_to = number
    -- What interface_key and direction_of do, written out: all frames come by here, and a call costs 350 instructions.
    local id = extract(interface_id)
    id = id and value_of(id) or -1
    local direction, unseen
    if key == CHOSEN then
      direction, unseen = direction_of(pinfo, key)
    else
      direction = side_of(pinfo)
    end
    if id ~= newest_id or direction ~= newest_direction then
      newest_interface = interface_of(interfaces, id)
      newest_stream = stream_of(capture, newest_interface, direction)
      newest_id, newest_direction = id, direction
    end
    local interface = newest_interface
    whole = read_first(capture, newest_stream, number, time_of(pinfo), raw)
    if id == -1 then
      blind = blind or second_look.new(streams.capture(options))
      blind.interfaces = blind.interfaces or {}
      second_look.note(blind, number)
      blind.one_way = blind.one_way or unseen
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
      from, again = look_again(number, pinfo, raw, key)
    end
    whole = from and from.plans[number] == nil and is_known(from.results, number) and windows.fits(raw, length)
  end

  if whole then
    show_whole(parent, handle, from.results, again, "uart", buffer, raw, number, pinfo)
    return length
  end

  local items = from and streams.plan(from, number, again)
  if not items then -- nothing is known of it (see second_look; with -R, packets are left out and numbers come twice)
    from, items = streams.capture(options), records.alone(raw)
  end
  if handed[number] then
    if has_frame(items) then
      handed[number] = nil
    elseif hand_over(buffer, pinfo, parent) and (again or has_tree()) then
      return length
    end
    -- Without a tree nobody knows yet whose it is: so that Wireshark's Modbus reads it once, in order (daly_mbrtu).
  end
  view.look(parent, handle, from.results, again, "uart")
  view.several(parent, buffer, raw, items, pinfo)
  return length
end

return M
