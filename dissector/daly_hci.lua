-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Bluetooth as a host's controller hands it over (HCI): the values of a board's attributes (docs/wires.md 3). Pure Lua,
-- no Wireshark.
--
--   H4 captures (187, 201)   type | packet       type 02 ACL data, 04 event
--   monitor, H1 (254)               packet
--
--   ACL data      connection and flags u16 | length u16 | L2CAP: length u16 | channel u16 | ATT, on channel 0004
--   event         code | length | parameters     03, 3E: connection complete
--   ATT           opcode | handle u16 | value    of the opcodes below; little-endian all
--
-- A connection is what a Connection Complete event begins, or the capture itself; on it we learn which attributes have
-- a characteristic of Daly's, and from which value on they are (daly_ble_beginning). Packets are read once, in the
-- order of the capture.

local beginning = require("daly_ble_beginning")

local M = {}

local byte, sub = string.byte, string.sub

--- Directions, as Wireshark has them (pinfo.p2p_dir); any other: not known.
M.SENT, M.RECEIVED = 0, 1
local SENT, RECEIVED = M.SENT, M.RECEIVED

local ATT_CHANNEL = 4
local EVENT_COMPLETE, EVENT_LE = 0x03, 0x3E
local LE_COMPLETE = { [0x01] = true, [0x0A] = true, [0x29] = true } -- plain, enhanced, enhanced 2
local ERROR, FIND_INFO_REPLY, READ_TYPE, READ_TYPE_REPLY = 0x01, 0x05, 0x08, 0x09
local CARRIES = { [0x12] = SENT, [0x52] = SENT, [0x1B] = RECEIVED, [0x1D] = RECEIVED }

local CHARACTERISTIC = 0x2803
local OURS = { [0xFFF1] = true, [0xFFF2] = true, [0xFF01] = true, [0xFF02] = true }
-- A short UUID in 16 bytes: these, the short one, two zeros.
local BASE = "\xFB\x34\x9B\x5F\x80\0\0\x80\0\x10\0\0"

local function u16(raw, at)
  local low, high = byte(raw, at, at + 1)
  return high and low + 256 * high
end

-- The short form of the UUID raw[first..last]; 0 for one that has none.
local function short_uuid(raw, first, last)
  if last - first == 1 then
    return u16(raw, first)
  elseif last - first == 15 and sub(raw, first, first + 11) == BASE and u16(raw, last - 1) == 0 then
    return u16(raw, first + 12)
  end
  return 0
end

--- Connections of a capture. `chosen`: set of handles that are Daly's on all connections. In it, `learned` tells
-- how often discovery named an attribute of Daly's, and `unseen` whether packets were not read before the first one.
function M.new(chosen)
  return { chosen = chosen, connections = {}, count = 0, learned = 0, unseen = false }
end

-- A connection begins; what was known of an earlier one is forgotten. `asked`: see below.
local function connect(host, key, asked)
  host.count = host.count + 1
  local connection = {
    number = host.count, -- of all, in order
    attributes = {}, -- by handle: whether its characteristic is one that Daly has, as discovered
    begun = false, -- whether a value was Daly's: until then what discovery alone tells is nobody's
    asked = asked, -- the UUID that the last Read By Type request asks for
    pending = {}, -- by direction: the beginning of an L2CAP packet
  }
  host.connections[key] = connection
  return connection
end

local function key_of(adapter, connection_handle)
  return adapter * 4096 + connection_handle
end

-- A connection's number if this event tells that it is complete. `at`: where the event's code stands.
local function completed(raw, at)
  local code, _, a, b = byte(raw, at, at + 3)
  local handle
  if code == EVENT_COMPLETE and a == 0 then -- status
    handle = u16(raw, at + 3)
  elseif code == EVENT_LE and LE_COMPLETE[a] and b == 0 then
    handle = u16(raw, at + 4)
  end
  return handle and handle % 4096
end

--- What an HCI packet is, by its shape: "acl", position of its handle; "event", position of its code; or nil.
-- `length`: as it was before the snap length.
function M.shape(raw, length)
  local first, second, third, fourth, fifth = byte(raw, 1, 5)
  if not third then
    return nil
  elseif first == 2 and fifth and fourth + 256 * fifth == length - 5 then
    return "acl", 2
  elseif first == 4 and third == length - 3 then
    return "event", 2
  elseif fourth and third + 256 * fourth == length - 4 then
    return "acl", 1
  elseif (first == EVENT_COMPLETE or first == EVENT_LE) and second == length - 2 then
    return "event", 1
  end
  return nil
end

-- What a discovery's reply tells: pairs of `size` bytes from `at` on, each a handle and what stands behind it.
local function learn(host, connection, pdu, at, size, handle_at, uuid_at)
  while size > uuid_at and at + size - 1 <= #pdu do
    local uuid = short_uuid(pdu, at + uuid_at, at + size - 1)
    local ours = OURS[uuid] or false
    connection.attributes[u16(pdu, at + handle_at)] = ours
    host.learned = host.learned + (ours and 1 or 0)
    at = at + size
  end
end

-- Whether an ATT packet goes the way that it goes between a host and its board.
local function goes(direction, way)
  return direction == way or (direction ~= SENT and direction ~= RECEIVED)
end

-- The way that an ATT packet, or the beginning of one, goes where it carries a value of an attribute of ours; else nil.
local function way_of(host, connection, pdu, direction)
  local opcode = byte(pdu, 1)
  local handle = u16(pdu, 2)
  local way = CARRIES[opcode]
  if way and handle and goes(direction, way) and (connection.attributes[handle] or host.chosen[handle]) then
    return way
  end
  return nil
end

-- An ATT packet: learn from it; the way that it goes, where it carries a value of ours, else nil.
local function attribute(host, connection, pdu, direction)
  local opcode, format = byte(pdu, 1, 2)
  if opcode == READ_TYPE and goes(direction, SENT) then
    connection.asked = #pdu >= 7 and short_uuid(pdu, 6, #pdu) or 0
  elseif opcode == READ_TYPE_REPLY and goes(direction, RECEIVED) then
    if format and connection.asked == CHARACTERISTIC then
      learn(host, connection, pdu, 3, format, 3, 5) -- declaration's handle, properties, value's handle, UUID
    end
    connection.asked = nil
  elseif opcode == ERROR and format == READ_TYPE and goes(direction, RECEIVED) then
    connection.asked = nil
  elseif opcode == FIND_INFO_REPLY and goes(direction, RECEIVED) then
    learn(host, connection, pdu, 3, format == 1 and 4 or format == 2 and 18 or 0, 0, 2)
  else
    return way_of(host, connection, pdu, direction)
  end
  return nil
end

-- What the L2CAP packet that ends with this piece carries, where that is ATT, else nil; and the ways of bytes of ours
-- that are lost, nil where none are: of the rest of the one before, and of this one. Where the capture does not tell
-- directions, those may go either way each.
local function put_together(host, connection, piece, continues, direction, cut)
  local pending, lost = connection.pending[direction], nil
  connection.pending[direction] = nil
  if continues then
    if not pending then
      return nil
    end
    piece = pending .. piece
  elseif pending then
    lost = way_of(host, connection, sub(pending, 5), direction)
  end
  local size, channel = u16(piece, 1), u16(piece, 3)
  if channel and channel ~= ATT_CHANNEL then
    return nil, lost
  elseif channel and #piece >= size + 4 then
    return sub(piece, 5, size + 4), lost
  elseif cut then
    return nil, lost, way_of(host, connection, sub(piece, 5), direction)
  end
  connection.pending[direction] = piece
  return nil, lost
end

-- Whether an ATT packet with a value of an attribute of ours is the first of Daly's on its connection.
local function begins(host, pdu)
  local value = sub(pdu, 4)
  return value ~= "" and (host.chosen[u16(pdu, 2)] or beginning.is_one(value))
end

--- One HCI packet, in the order of the capture, once. `length`: as it was before the snap length; `adapter`: a number;
-- `unseen`: packets before this one were not read, so that on any connection the first reply may be to any request.
-- Returns, where it has to do with us, its connection and
--   the value of an attribute of ours, its way (M.SENT, M.RECEIVED), and its position in `raw`, or nil where it came in
--   several packets; or three times nil;
--   the ways of bytes that are lost, nil where none are: of a packet before this one, and of this one.
function M.read(host, raw, length, adapter, direction, unseen)
  local kind, at = M.shape(raw, length)
  if kind == "event" then
    local handle = direction ~= SENT and completed(raw, at)
    if handle then
      connect(host, key_of(adapter, handle))
    end
    return nil
  elseif kind ~= "acl" then
    return nil
  end
  local field = u16(raw, at)
  local key = key_of(adapter, field % 4096)
  host.unseen = host.unseen or unseen
  local connection = host.connections[key] or connect(host, key, host.unseen and CHARACTERISTIC or nil)
  local continues = (field - field % 4096) / 4096 % 4 == 1
  local pdu, lost, cut = put_together(host, connection, sub(raw, at + 4), continues, direction, #raw < length)
  local way = pdu and attribute(host, connection, pdu, direction)
  if way and not connection.begun then
    connection.begun = begins(host, pdu)
  end
  if not connection.begun then
    return nil
  elseif way then
    return connection, sub(pdu, 4), way, not continues and at + 11 or nil, lost, nil
  elseif lost or cut then
    return connection, nil, nil, nil, lost, cut
  end
  return nil
end

return M
