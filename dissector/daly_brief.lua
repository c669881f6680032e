-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- The short way to show a frame, where nobody looks closer (no tree, no filter by our fields, no statistics) and
-- nothing is to be noted: an item and four columns. Most frames of a bus say what the one before of their kind said, or
-- the same with other values; so one is remembered of each kind (who, data ID, number in a burst):
--
--   raw, memory       its bytes, and what it was shown with (daly_results)
--   words, source, destination                 columns
--   longest           how long it may have waited for nothing to be noted, s; below 0 where its bytes bring a note
--   beginning, say    how its words begin, and what makes the rest of a reply's bytes (daly_payload.words); nil where
--                     other bytes are to be looked at closer
--   numbered          it is one of a burst
--   data              on CAN: the frame's own bytes

local getters = require("daly_getters")
local payload = require("daly_payload")

local M = {}

local add, referenced = TreeItem.add, TreeItem.referenced
local columns_of = getters.attribute("Pinfo", "cols")
local set_column = getters.operator("Columns", "__newindex", function(columns, name, text)
  columns[name] = text
end)
local whole = payload.whole

local daly
local counting = false
local memories = {}

-- The frame at hand, for daly_payload.
local frame = {}

--- Once: the protocol, which the items of the tree belong to.
function M.setup(proto)
  daly = proto
end

--- A capture begins.
function M.init()
  for i = 1, #memories do
    memories[i].entries, memories[i].count = {}, 0
  end
end

--- Somebody counts all frames from now on: none takes the short way.
function M.stop()
  counting = true
end

--- A memory of what frames said, for a carrier: { entries = by key, count = }.
function M.memory()
  local memory = { entries = {}, count = 0 }
  memories[#memories + 1] = memory
  return memory
end

-- A bus has few kinds of frames; more than this are made up, and are forgotten.
local MOST = 4096

--- The entry for a kind of frame, to be filled in.
function M.entry(memory, key)
  local entry = memory.entries[key]
  if not entry then
    if memory.count >= MOST then
      memory.entries, memory.count = {}, 0
    end
    -- Made in one go: of Modbus each frame with other bytes has one.
    entry = { raw = false, memory = false, words = false, source = false, destination = false, longest = 0 }
    memory.entries[key] = entry
    memory.count = memory.count + 1
  end
  return entry
end

--- The columns of a packet that is one record.
function M.set_columns(pinfo, text, source, destination)
  local columns = columns_of(pinfo)
  set_column(columns, "protocol", "Daly")
  set_column(columns, "info", text)
  if source then
    set_column(columns, "src", source)
    set_column(columns, "dst", destination)
  end
end

-- What a reply with other bytes, or another memory, says; nil where it is to be looked at closer.
local function say_anew(entry, raw, memory, slot)
  local say = entry.say
  if not say or type(memory) == "table" and not memory.shared then
    return nil
  end
  frame.raw = raw
  frame.memory = memory or nil
  frame.table = entry.numbered and type(memory) == "string" and whole(slot, memory, false) or nil
  local words = entry.beginning .. say(frame)
  entry.raw = raw
  entry.memory = memory
  entry.words = words
  return words
end

--- Show a whole frame that was read right before, if the short way is enough; returns whether it was. `entry`: of its
-- kind; `known`: results of its bus.
function M.show(parent, handle, known, entry, slot, pinfo, raw)
  local memory, wait = false, 0
  if slot == known.newest then
    memory = known.newest_memory or false
    wait = known.newest_wait or 0
  elseif known.entries[slot] ~= 0 then
    return false -- it is no request either
  end
  if wait > entry.longest or known.odd[slot] or known.flag[slot] or counting or referenced(parent, handle) then
    return false
  end
  local words = entry.words
  if entry.raw ~= raw or entry.memory ~= memory then
    words = say_anew(entry, raw, memory, slot)
    if not words then
      return false
    end
  end
  add(parent, daly)
  local columns = columns_of(pinfo) -- what M.set_columns does: most frames come by here
  set_column(columns, "protocol", "Daly")
  set_column(columns, "info", words)
  set_column(columns, "src", entry.source)
  set_column(columns, "dst", entry.destination)
  return true
end

return M
