-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- CAN frames: SocketCAN captures, candump logs, and whatever else Wireshark shows as CAN (docs/wires.md 2).
--
-- Lua sees a frame's identifier in fields alone, which are not always there (daly_second_look), and which make every
-- packet dearer. But a dissector that is registered for an identifier finds it in pinfo.match_uint. So we register for
-- all that can be ours, and nothing of ours runs for other frames. Identifiers that tell Daly from others are
-- registered from the start; the others, some 200,000, once one of those was seen or the user chose us (Decode As).
--
--   frame --identifier--> us? --daly_can_bus--> what it is --view--> tree, columns

local brief = require("daly_brief")
local bus_module = require("daly_bus")
local can_bus = require("daly_can_bus")
local classic = require("daly_can_classic")
local getters = require("daly_getters")
local hkms = require("daly_hkms")
local ids = require("daly_can_ids")
local second_look = require("daly_second_look")
local view = require("daly_view")
local is_known = require("daly_results").is_known
local fields = require("daly_fields").fields

local M = {}

local byte = string.byte

-- Called by its name, a method of Wireshark's objects is looked up in C every time.
local bytes_of, place_of, length_of = Tvb.raw, Tvb.offset, Tvb.reported_len
local number_of, is_again = getters.attribute("Pinfo", "number"), getters.attribute("Pinfo", "visited")
local time_of = getters.attribute("Pinfo", "rel_ts")
local value_of = getters.attribute("FieldInfo", "value")
local extract = getters.operator("Field", "__call", function(field)
  return field()
end)
local out, look, briefly = view.out, view.look, brief.show
local raw_of, key_of, memory = classic.raw, classic.key, classic.memory
local read, feed_can, shape_of, shapes = can_bus.read, bus_module.feed_can, ids.shape, ids.shapes

-- State of the capture that is open.
local options
local state -- as read in order, once
local results, buses -- its
local read_to -- number of the newest packet that was read
local blind -- frames whose interface could not be told (daly_second_look), nil: none
local usual -- where the frame lies in its packet
local others -- slots of frames that lie elsewhere, by number and place
local slots -- given to those, counted down from -1
local searching -- the preference
local no_interfaces -- the file does not tell any
local chosen -- the user chose us for CAN, as far as was seen
local refused_number, refused_id -- the newest frame that was not taken for ours

local interface_id = Field.new("frame.interface_id")
local is_remote = Field.new("can.flags.rtr")
local fd_flag = Field.new("canfd.flags.brs")

local extended_ids, standard_ids = DissectorTable.get("can.extended_id"), DissectorTable.get("can.id")
local next_level = DissectorTable.get("can.subdissector")
local CHOSEN = 0 -- pinfo.match_uint when the user's choice brings us a frame
local daly
local all_registered = false

--- Once: the protocol, for which identifiers are registered.
function M.setup(proto)
  daly = proto
  extended_ids:add(ids.sure_ranges(), daly)
  next_level:add_for_decode_as(daly)
end

local function register_all()
  if not all_registered then
    local extended, standard = ids.other_ranges()
    extended_ids:add(extended, daly)
    standard_ids:add(standard, daly)
    all_registered = true
  end
end

--- Begin a capture. `with`: see daly_streams.capture; `search`: look for Daly's identifiers.
function M.init(with, search)
  options, searching = with, search
  chosen, no_interfaces, refused_number, refused_id = false, false, nil, nil
  state = can_bus.capture(options, chosen)
  results, buses = state.results, state.buses
  read_to, blind, usual, others, slots = 0, nil, nil, {}, 0
end

-- The slot of a frame that lies elsewhere than others in its packet, and whether it is seen for the first time: some
-- carriers put several frames into one packet.
local function slot_elsewhere(number, place)
  local key = number .. ":" .. place
  local slot = others[key]
  if slot then
    return slot, false
  end
  slots = slots - 1
  others[key] = slots
  return slots, true
end

local NO_INTERFACE = -1 -- where it is not told, or there is none

-- Number of the interface of the frame at hand. `tree`: whether there is one, which would tell it.
local function interface_key(tree)
  if no_interfaces then
    return NO_INTERFACE
  end
  local id = extract(interface_id)
  no_interfaces = tree and not id -- a classic pcap
  return id and value_of(id) or NO_INTERFACE
end

-- The frame at hand, for view.one.
local frame = {}

local function show_foreign(_, thing, wanted)
  local shape, length = thing.shape, thing.length
  if wanted then
    if shape.priority then
      classic.show_head(shape, 0, thing.remote)
    end
    out.made(fields.foreign, thing.name)
    if length > 0 then
      out.bytes(fields.undecoded, 0, length)
    end
  end
  return "Not Daly: " .. thing.name
end

-- Show a classic frame in full, after view.look. `raw`: in the form of an A5 frame.
local function show_classic(slot, shape, raw, data, remote, buffer, pinfo, parent)
  frame.shape, frame.slot, frame.remote, frame.raw = shape, slot, remote, raw
  local key = key_of(shape, data)
  local kept = view.one(parent, buffer, #data, "frame", raw, slot, pinfo, classic.show, frame, memory, key)
  if kept then
    kept.data = data
  end
end

-- Show what was found out of a frame, if it is ours. Returns how many bytes were taken.
local function show(from, slot, shape, data, remote, buffer, pinfo, parent, handle, again)
  local found, length = from.found[slot], #data
  if not found and not is_known(from.results, slot) then
    return 0
  end
  look(parent, handle, from.results, again, "can")
  if not found then
    show_classic(slot, shape, raw_of(shape, data), data, remote, buffer, pinfo, parent)
    return length > 0 and length or 1 -- 0 would say that it is not ours
  end
  frame.shape, frame.slot, frame.remote, frame.length = shape, slot, remote, length
  if found == can_bus.HKMS then
    frame.raw = data
    view.one(parent, buffer, length, "frame", view.counts() and hkms.counted(frame), slot, pinfo, hkms.show, frame)
  else
    frame.name = found
    view.one(parent, buffer, length, "foreign", data, slot, pinfo, show_foreign, frame)
  end
  return length > 0 and length or 1
end

local LOWEST = 0x351 -- of the identifiers; above all of wtap_encap's numbers
local RTAC_HEADER = 12
M.LOWEST = LOWEST

--- Whether what brought us a packet is CAN, by pinfo.match_uint: an identifier; or the user's choice, which can be of
-- RTAC serial too.
function M.brought(buffer, key)
  return key >= LOWEST or key == CHOSEN and place_of(buffer) ~= RTAC_HEADER
end

local function refuse(number, id)
  refused_number, refused_id = number, id
  return 0
end

local EXTENDED = 2 ^ 31 -- in the word of an identifier and its flags

-- The identifier of a frame that the user's choice brought; nil where it is none of ours, or can't be told. `flag`: one
-- of those in its word, which is read in the order of bytes that makes it one of ours. None is in both, for the bit of
-- extended ones stands beside the priority.
local function chosen_id(number, flag)
  if refused_number == number then
    return refused_id
  end
  local word = flag and flag.range
  for _, value in ipairs(word and { word:uint(), word:le_uint() } or {}) do
    local extended = value >= EXTENDED
    local id = value % (extended and ids.EXTENDED or ids.STANDARD)
    if extended == (id >= ids.STANDARD) and ids.is_ours(id) then
      return id
    end
  end
  return nil
end

-- The frame that shows that the user chose us: from now on all that can be ours is registered.
local function choose()
  chosen = true
  can_bus.choose(state)
  if blind then
    can_bus.choose(blind.state)
  end
  register_all()
end

local function note_blind(number)
  blind = blind or second_look.new(can_bus.capture(options, chosen))
  second_look.note(blind, number)
end

-- Dissect any frame of CAN: M.dissect.
local function dissect_any(buffer, pinfo, parent, handle, id)
  local number, place = number_of(pinfo), place_of(buffer)
  usual = usual or place
  local slot, first = number, false
  if place == usual then
    if number > read_to then
      first = true
      read_to = number
    end
  else
    slot, first = slot_elsewhere(number, place)
  end
  if id == CHOSEN then
    if chosen then
      return 0 -- its identifier brought it here before
    end
    choose()
    local flag = extract(is_remote)
    first, id = true, chosen_id(number, flag)
    if not id then
      if not (flag or fd_flag()) then
        note_blind(number)
        blind.several = true -- it may be ours, and a second look knows
      end
      return 0
    end
  elseif not (searching or chosen) then
    return refuse(number, id)
  end
  local data = bytes_of(buffer)
  local length = #data
  if length ~= 8 and (length > 8 or length ~= length_of(buffer)) then
    return 0
  end
  local shape = shapes[id] or shape_of(id)
  -- Every frame but those of CAN FD has this flag, where there is a tree.
  local flag = extract(is_remote)
  local remote = flag and value_of(flag)
  local from, whole = state, true
  -- Without a tree it was taken for a data frame.
  local seen = flag or fd_flag()
  local not_ours = seen and not flag or remote and id < ids.STANDARD
  local surprise = not_ours or remote and length > 0
  if remote then
    data = ""
  end
  if first and not is_again(pinfo) then
    if not_ours then
      return 0
    end
    read(state, interface_key(seen), slot, number, shape, data, time_of(pinfo))
    if not seen then
      note_blind(number)
    end
    if not all_registered and state.known then
      register_all()
    end
    whole = false
  elseif blind and seen then
    local key = interface_key(seen)
    local reads = not_ours and can_bus.pass or read
    local anew
    from, anew =
      second_look.look(blind, state, number, key, surprise, reads, key, slot, number, shape, data, time_of(pinfo))
    if not from then
      return 0
    end
    whole = not anew
  end
  local taken = show(from, slot, shape, data, remote, buffer, pinfo, parent, handle, whole)
  return taken > 0 and taken or refuse(number, id)
end

--- Dissect a CAN frame. `handle`: our protocol's dissector; `id`: pinfo.match_uint. Returns how many bytes were taken,
-- 0: it is not ours.
--
-- Most frames come for the first time, have eight bytes, and are classic ones on a bus that is known as such: for them
-- this does what dissect_any does, and nothing that could be left out.
function M.dissect(buffer, pinfo, parent, handle, id)
  local number, shape = number_of(pinfo), shapes[id]
  if not shape or not shape.plain or number <= read_to or place_of(buffer) ~= usual or not (searching or chosen) then
    return dissect_any(buffer, pinfo, parent, handle, id)
  end
  local data, flag = bytes_of(buffer), extract(is_remote)
  if #data ~= 8 or not flag or value_of(flag) or is_again(pinfo) then
    return dissect_any(buffer, pinfo, parent, handle, id)
  end
  local key = NO_INTERFACE
  if not no_interfaces then
    local interface = extract(interface_id)
    if interface then
      key = value_of(interface)
    else
      no_interfaces = true -- a classic pcap
    end
  end
  local bus = buses[key]
  if not bus or not bus.classic then
    return dissect_any(buffer, pinfo, parent, handle, id)
  end
  read_to = number
  local kind = shape.key -- as key_of has it
  if shape.numbered then
    kind = kind + byte(data)
  end
  local entry = memory.entries[kind]
  local raw = entry and entry.data == data and entry.raw or raw_of(shape, data)
  feed_can(bus.daly, number, number, raw, shape, 8, time_of(pinfo))
  if entry and briefly(parent, handle, results, entry, number, pinfo, raw) then
    entry.data = data
  else
    look(parent, handle, results, false, "can")
    show_classic(number, shape, raw, data, false, buffer, pinfo, parent)
  end
  return 8
end

return M
