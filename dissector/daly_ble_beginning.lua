-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Where Daly begins on a Bluetooth connection (docs/wires.md 3): other makers' devices have the same
-- attributes, so the first value that looks like Daly's tells. Pure Lua, no Wireshark.

local records = require("daly_records")
local windows = require("daly_windows")

local M = {}

local byte, find = string.byte, string.find

local A5, A5_COUNT, A5_LENGTH = 0xA5, 8, 13
local MODBUS_REPLY = "^[\xD2\x51-\x60]\3" -- to a read; then the number of bytes behind it, and a CRC
local MOST_READ, AROUND = 252, 5

-- Whether a value begins with the head of a frame that is longer than it.
local function goes_on(value)
  local first, _, third, fourth = byte(value, 1, 4)
  if first == A5 then
    return fourth == A5_COUNT and #value < A5_LENGTH
  elseif not third or not find(value, MODBUS_REPLY) or not find(value, "^" .. windows.STARTS) then
    return false
  end
  return third > 0 and third <= MOST_READ and third % 2 == 0 and third + AROUND > #value
end

--- Whether a value can be the first of Daly's on its connection: it holds a good frame, or the head of one.
function M.is_one(value)
  if goes_on(value) then
    return true
  end
  local items = records.alone(value)
  for i = 1, #items do
    if items[i].kind == "frame" then
      return true
    end
  end
  return false
end

return M
