-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- What is found out about the frames of a capture, by the frame's slot (a number of its own: of the packet, where the
-- frame is all that is in it). Pure Lua, no Wireshark.
--
-- Every frame has an entry in three columns, which are lists without gaps and cost it no table of its own:
--
--              of a request                                    of a reply
--   link       packet of its first reply, or false             packet of its request, or false
--   wait       when it ended, s                                response time, s; or, of a later frame of a burst, minus
--                                                              the packet that has the burst's table; or false
--   memory     its bus                                         what it is shown with, or false:
--                                                              0x90: state of the newest 0x93; 0x98: data bytes of the
--                                                              one before; 0x95, 0x96, texts: what daly_bursts.open
--                                                              reads: the burst (only base and count, where the count
--                                                              is known); the table of all as a string; or { burst =,
--                                                              missing =, again =, table = } where there is more;
--                                                              Modbus: see daly_modbus_board
--
-- and there are three for what is rare:
--
--   flag       "echo" or "retry"; "reply" where a Modbus frame's shape does not tell
--   whole_in   first frame of a burst: packet that has the burst's table
--   odd        { unasked =, late_to =, other_board =, second_host =, result =, cut_off =, changed = { names }, from =,
--                contradictions = { name, packet, words, name, packet, words, ... } }, as in docs/records.md 7 to 11;
--              of a write also was =, was_in =: what it would change, as such a write's bytes (Modbus: two bytes, by
--              register), and the packet that told; of Modbus ambiguous =, raised =, cleared = { names }

local M = {}

--- Columns for a capture.
function M.new()
  return {
    link = {},
    wait = {},
    memory = {},
    flag = {},
    whole_in = {},
    odd = {},
    buses = {}, -- all of the capture
    can = false, -- it is of CAN: frames are in the form that daly_bus tells
    latest = -math.huge, -- when the latest packet of the capture began, s
  }
end

--- The columns' names.
M.COLUMNS = { "link", "wait", "memory", "flag", "whole_in", "odd" }

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

return M
