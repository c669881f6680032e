-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- What is found out about the frames of a capture, by the frame's slot (a number of its own: of the packet, where the
-- frame is all that is in it). Pure Lua, no Wireshark.
--
-- It is kept as long as the capture is open, so an ordinary frame costs one number in a list without gaps (`entries`):
--
--   link      + 2^10 memory  + 2^18 table  + 2^26 place in the list of response times and rare memories (`more`)
--
-- Links are kept as distances, values of memory that come again as their place in a list. It tells
--
--              of a request                                    of a reply
--   link       packet of its first reply                       packet of its request
--   wait                                                       response time, s
--   memory                                                     what it is shown with:
--                                                              0x90: state of the newest 0x93; 0x98: data bytes of the
--                                                              one before; 0x95, 0x96, texts: what daly_bursts.open
--                                                              reads: the burst (only base and count, where the count
--                                                              is known); the table of all as a string; or { burst =,
--                                                              missing =, again =, table = } where there is more;
--                                                              Modbus: see daly_modbus_board
--   table                                                      packet that has its burst's table
--
-- and there are columns for what not all have:
--
--   ended      of a request that was not answered yet, and is no echo: when it ended, s
--   flag       "echo" or "retry"; "reply" where a Modbus frame's shape does not tell
--   odd        { unasked =, late_to =, other_board =, second_host =, result =, cut_off =, changed = { names }, from =,
--                contradictions = { name, packet, words, name, packet, words, ... } }, as in docs/records.md 7 to 11;
--              of a write also was =, was_in =: what it would change, as such a write's bytes (Modbus: two bytes, by
--              register), and the packet that told; of Modbus ambiguous =, raised =, cleared = { names }

local M = {}

local collector = require("daly_collector")

local floor = math.floor

-- Parts of an entry. A distance of a link or a table is kept with an offset, for 0 says that there is none; the highest
-- value says that it is too far, and kept by itself.
local MEMORY, TABLE, MORE = 1024, 262144, 67108864
local LINK_ZERO, LINK_FAR = 512, 1023
local TABLE_ZERO, TABLE_FAR = 128, 255
-- Memory that is kept in `more`, behind the response time; what is below stands for one that many frames share.
local MEMORY_RARE = 255
local LOOK = 4096 -- so often the collector is told
local LONG = 8 -- of strings: longer ones are not shared

--- Columns for a capture.
function M.new()
  return {
    entries = {},
    more = {},
    more_count = 0,
    shared = {}, -- memory that many frames have, by number; and the numbers by what they stand for
    number_of = {},
    replies = 0, -- so many were noted
    next_look = LOOK, -- at so many the collector is told how long the lists are
    newest = nil, -- slot of the newest reply, its response time and memory: it is shown next
    newest_wait = nil,
    newest_memory = nil,
    far_links = {}, -- by slot
    far_tables = {},
    ended = {},
    flag = {},
    odd = {},
    buses = {}, -- all of the capture
    can = false, -- it is of CAN: frames are in the form that daly_bus tells
    latest = -math.huge, -- when the latest packet of the capture began, s
  }
end

local COLUMNS = { "entries", "ended", "flag", "odd" }

--- Forget all about a slot.
function M.forget(results, slot)
  for i = 1, #COLUMNS do
    results[COLUMNS[i]][slot] = nil
  end
  results.newest = nil
end

-- The number that stands for memory.
local function new_number(results, memory)
  local kind, shared = type(memory), results.shared
  if kind == "string" and #memory > LONG or kind == "table" and not memory.shared or #shared + 1 == MEMORY_RARE then
    return MEMORY_RARE
  end
  shared[#shared + 1] = memory
  results.number_of[memory] = #shared
  return #shared
end

local function far_link(results, slot, packet)
  results.far_links[slot] = packet
  return LINK_FAR
end

local function table_part(results, slot, packet)
  local part = packet - slot + TABLE_ZERO
  if part > 0 and part < TABLE_FAR then
    return part
  end
  results.far_tables[slot] = packet
  return TABLE_FAR
end

--- A reply: each false or nil where there is none. Memory that has `shared` stands for many frames.
function M.note_reply(results, slot, link, wait, memory, table_in)
  local entry, number = 0, 0
  if link then
    entry = link - slot + LINK_ZERO
    if entry <= 0 or entry >= LINK_FAR then
      entry = far_link(results, slot, link)
    end
  end
  if memory then
    number = results.number_of[memory] or new_number(results, memory)
    entry = entry + MEMORY * number
  end
  if table_in then
    entry = entry + TABLE * table_part(results, slot, table_in)
  end
  if wait or number == MEMORY_RARE then
    local more, count = results.more, results.more_count + 1
    entry = entry + MORE * count
    more[count] = wait or false
    if number == MEMORY_RARE then
      count = count + 1
      more[count] = memory
    end
    results.more_count = count
  end
  results.entries[slot] = entry
  results.newest = slot
  results.newest_wait = wait
  results.newest_memory = memory
  local replies = results.replies + 1
  results.replies = replies
  if replies == results.next_look then
    results.next_look = replies + LOOK
    collector.note(2 * replies + results.more_count) -- there are about as many requests
  end
end

--- Whether anything is known of a slot.
function M.is_known(results, slot)
  return results.entries[slot] ~= nil
end

--- Packet of the request or the first reply; nil: none.
function M.link(results, slot)
  local entry = results.entries[slot]
  local part = entry and entry % MEMORY or 0
  if part == 0 then
    return nil
  elseif part == LINK_FAR then
    return results.far_links[slot]
  end
  return floor(slot + part - LINK_ZERO)
end

--- Response time, s, or nil.
function M.wait(results, slot)
  if slot == results.newest then
    return results.newest_wait
  end
  local entry = results.entries[slot]
  return entry and entry >= MORE and results.more[(entry - entry % MORE) / MORE] or nil
end

--- What a reply is shown with, or nil.
function M.memory(results, slot)
  if slot == results.newest then
    return results.newest_memory
  end
  local entry = results.entries[slot]
  if not entry then
    return nil
  end
  local number = (entry % TABLE - entry % MEMORY) / MEMORY
  if number == MEMORY_RARE then
    return results.more[(entry - entry % MORE) / MORE + 1]
  end
  return results.shared[number]
end

--- Packet that has the table of a frame's burst, or nil.
function M.table_in(results, slot)
  local entry = results.entries[slot]
  local part = entry and (entry % MORE - entry % TABLE) / TABLE or 0
  if part == 0 then
    return nil
  elseif part == TABLE_FAR then
    return results.far_tables[slot]
  end
  return floor(slot + part - TABLE_ZERO)
end

--- The same reply, with memory that it had not yet.
function M.note_memory(results, slot, memory)
  local number = results.number_of[memory] or new_number(results, memory)
  if number == MEMORY_RARE then
    M.note_reply(results, slot, M.link(results, slot), M.wait(results, slot), memory, M.table_in(results, slot))
  else
    results.entries[slot] = results.entries[slot] + MEMORY * number
    results.newest_memory = memory
  end
end

--- The entry of a slot for rare things.
function M.odd(results, slot)
  local odd = results.odd[slot]
  if not odd then
    odd = {}
    results.odd[slot] = odd
  end
  return odd
end

--- What a record says otherwise than another, in `packet`; in words for an expert note.
function M.contradict(results, slot, name, packet, words)
  local odd = M.odd(results, slot)
  local list = odd.contradictions or {}
  odd.contradictions = list
  local n = #list
  list[n + 1], list[n + 2], list[n + 3] = name, packet, words
end

--- What changed since the record in packet `from`; of several, the newest.
function M.change(results, slot, name, from)
  local odd = M.odd(results, slot)
  odd.changed = odd.changed or {}
  odd.changed[#odd.changed + 1] = name
  odd.from = math.max(odd.from or 0, from)
end

--- Write something on an earlier frame's entry, in a way that can be taken back (daly_bus).
function M.later(bus, column, slot, value)
  local entries = bus.results[column]
  local mark = bus.mark
  if mark then
    mark.later[#mark.later + 1] = { entries, slot, entries[slot] }
  end
  entries[slot] = value
end

--- A request is answered in this packet.
function M.answered(bus, slot, packet)
  local results = bus.results
  local entry = packet - slot + LINK_ZERO
  if entry <= 0 or entry >= LINK_FAR then
    entry = far_link(results, slot, packet)
  end
  if bus.mark then
    M.later(bus, "entries", slot, entry)
    M.later(bus, "ended", slot, nil)
  else
    results.entries[slot] = entry
    results.ended[slot] = nil
  end
end

--- An earlier frame's burst has its table in this packet.
function M.note_table(bus, slot, packet)
  local results = bus.results
  local entry = results.entries[slot] + TABLE * table_part(results, slot, packet)
  if bus.mark then
    M.later(bus, "entries", slot, entry)
  else
    results.entries[slot] = entry
  end
end

return M
