-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- CAN, classic dialect: the eight bytes of an A5 frame under an identifier that says the rest (docs/wires.md 2).
--
--   18 | data ID | destination | source       d0 d1 d2 d3 d4 d5 d6 d7

local brief = require("daly_brief")
local fields = require("daly_fields").fields
local view = require("daly_view")

local M = {}

local char, byte, sub, format = string.char, string.byte, string.sub, string.format
local out = view.out

local FILL = ("\0"):rep(8)

--- A frame in the form of an A5 frame (daly_bus). `data`: at most eight bytes; `start`: its first byte, A5 where it is
-- nil.
function M.as_a5(id, data, destination, source, start)
  local length = #data
  if length < 8 then
    data = data .. sub(FILL, 1, 8 - length)
  end
  return char(start or 0xA5, source, id, length) .. data .. char(destination)
end

--- The same for a classic frame of this shape (daly_can_ids).
function M.raw(shape, data)
  if #data == 8 then
    local head = shape.head
    if not head then
      head = char(0xA5, shape.source, shape.classic, 8)
      shape.head, shape.tail = head, char(shape.destination)
    end
    return head .. data .. shape.tail
  end
  return M.as_a5(shape.classic, data, shape.destination, shape.source)
end

--- The head of a CAN frame: fields of its identifier (daly_can_ids.shape) and its bytes.
function M.show_head(shape, length, remote)
  out.made(fields["can.priority"], shape.priority)
  out.made(fields["can.destination"], shape.destination)
  out.made(fields["can.source"], shape.source)
  if remote then
    out.made(fields["can.remote"], true)
  end
  if length > 0 then
    out.bytes(fields.data, 0, length)
  end
end

--- What classic frames said (daly_brief); `key`: M.key.
M.memory = brief.memory()

--- The place of a frame's kind in that memory.
function M.key(shape, data)
  local length = #data
  if length ~= 8 then
    return -(shape.id * 256 + length)
  end
  local key = shape.key
  if shape.numbered then
    return key + byte(data)
  end
  return key
end

-- The frame at hand.
local shape, remote

-- The constant part of a frame's words, by identifier.
local beginnings, sources, destinations = {}, {}, {}

local function names(raw)
  local id = shape.id
  if not beginnings[id] then
    local host = view.host_name(shape.asks and shape.source or shape.destination)
    local board = format("Board %d", shape.board)
    local data_id = byte(raw, 3)
    if shape.asks then
      beginnings[id] = format("Request board %d  %s", shape.board, view.id_words(data_id))
      sources[id], destinations[id] = host, board
    else
      beginnings[id] = view.reply_words(shape.board, data_id)
      sources[id], destinations[id] = board, host
    end
  end
  return beginnings[id], sources[id], destinations[id]
end

local carrier = { names = names }

function carrier.board()
  return shape.board
end

function carrier.show(raw)
  out.made(fields.dialect, "a5")
  out.made(fields.data_id, byte(raw, 3))
  M.show_head(shape, byte(raw, 4), remote)
end

--- For daly_view.one. `frame`: { raw = as_a5, shape =, slot =, remote = }.
function M.show(item, frame)
  shape, remote = frame.shape, frame.remote
  return view.a5_on(item, frame.raw, frame.slot, carrier)
end

return M
