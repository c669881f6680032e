-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Other people's traffic on the same pair, named and not decoded (docs/records.md 4). Pure Lua, no Wireshark.
--
--   Modbus RTU    addr fn ... crc_lo crc_hi      any address that is not Daly's
--   Sinowealth    0A reg len | data.len crc8     request | reply without a header (field notes b)
--   Pylontech     "~" ver.2 adr.2 cid.2 cid.2 len.4 info.len sum.4 CR    all digits of hex
--   JBD           DD . . len data.len sum.2 77

local windows = require("daly_windows")

local M = {}

local byte = string.byte

-- CRC-8, polynomial 07, start 0, over request and reply: found on the real exchanges sino-0 and sino-1.
local crc8_table

local function crc8(buf, first, last)
  if not crc8_table then
    crc8_table = {}
    for value = 0, 255 do
      local crc = value
      for _ = 1, 8 do
        local high = crc >= 128
        crc = (crc * 2) % 256
        if high then -- xor with 07: its three low bits turn
          local low = crc % 8
          crc = crc - low + (7 - low)
        end
      end
      crc8_table[value] = crc
    end
  end
  local crc = 0
  for i = first, last do
    local a, b, x, bit_value = crc, byte(buf, i), 0, 1
    for _ = 1, 8 do
      if a % 2 ~= b % 2 then
        x = x + bit_value
      end
      a, b, bit_value = (a - a % 2) / 2, (b - b % 2) / 2, bit_value * 2
    end
    crc = crc8_table[x]
  end
  return crc
end

local function is_daly_address(address)
  return address == 0xD2 or (address >= 0x51 and address <= 0x60) or (address >= 0x81 and address <= 0x90)
end

-- The end of the Modbus frame of another maker that begins at p, or nil.
local function modbus_end(buf, p, n)
  local address, fn = byte(buf, p, p + 1)
  if not fn or is_daly_address(address) then
    return nil
  end
  local one, two
  if fn >= 0x01 and fn <= 0x04 then
    one = 8
    local count = byte(buf, p + 2)
    if count and count >= 1 and count <= 250 then
      two = 5 + count
    end
  elseif fn == 0x05 or fn == 0x06 then
    one = 8
  elseif fn == 0x0F or fn == 0x10 then
    one = 8
    local count = byte(buf, p + 6)
    if count and count >= 1 and count <= 250 then
      two = 9 + count
    end
  elseif (fn >= 0x81 and fn <= 0x86) or fn == 0x8F or fn == 0x90 then
    one = 5
  else
    return nil
  end
  if two and two < one then
    one, two = two, one
  end
  if p + one - 1 <= n and windows.crc_right(buf, p, p + one - 1) then
    return p + one - 1
  elseif two and p + two - 1 <= n and windows.crc_right(buf, p, p + two - 1) then
    return p + two - 1
  end
  return nil
end

local function sinowealth_request(buf, p, n)
  local start, register, length = byte(buf, p, p + 2)
  return p + 2 <= n
    and start == 0x0A
    and register >= 0x01
    and register <= 0x16
    and (length == 2 or length == 4)
    and length
end

local function sinowealth_end(buf, p, n)
  local length = sinowealth_request(buf, p, n)
  if not length then
    return nil
  end
  local reply_end = p + 2 + length + 1
  if reply_end <= n and crc8(buf, p, reply_end - 1) == byte(buf, reply_end) then
    return reply_end
  elseif p + 2 == n or sinowealth_request(buf, p + 3, n) then
    return p + 2
  end
  return nil
end

local function all(buf, first, last, frame_end)
  local p = first
  while p <= last do
    local stop = frame_end(buf, p, last)
    if not stop then
      return false
    end
    p = stop + 1
  end
  return true
end

-- The sum of a run of bytes and a check of 16 bits behind it make a multiple of 65536.
local function sums_up(buf, first, last, check)
  local sum = check
  for i = first, last do
    sum = sum + byte(buf, i)
  end
  return sum % 65536 == 0
end

local function pylontech_end(buf, p, n)
  local length = byte(buf, p) == 0x7E and buf:match("^[0-9A-F]+", p + 1)
  length = length and #length >= 16 and tonumber(length:sub(9, 12), 16) % 4096
  local check = length and p + 13 + length
  if not check or check + 4 > n or byte(buf, check + 4) ~= 0x0D then
    return nil
  end
  local digits = buf:sub(p + 1, check + 3)
  if not digits:find("[^0-9A-F]") and sums_up(buf, p + 1, check - 1, tonumber(digits:sub(-4), 16)) then
    return check + 4
  end
  return nil
end

local function jbd_end(buf, p, n)
  local length = p + 6 <= n and byte(buf, p) == 0xDD and byte(buf, p + 3)
  local check = length and p + 4 + length
  if not check or check + 2 > n or byte(buf, check + 2) ~= 0x77 then
    return nil
  end
  local high, low = byte(buf, check, check + 1)
  return sums_up(buf, p + 2, check - 1, high * 256 + low) and check + 2 or nil
end

--- Name of other makers' Modbus.
M.MODBUS = "Modbus RTU"

--- Iterate over the frames of a record of that name: first and last position of each.
function M.modbus_frames(raw)
  local last = 0
  return function()
    local first = last + 1
    last = first <= #raw and modbus_end(raw, first, #raw)
    if last then
      return first, last
    end
    return nil
  end
end

--- What buf[first..last] is when it is, whole, other people's traffic: its name, or nil.
function M.name(buf, first, last)
  if all(buf, first, last, modbus_end) then
    return M.MODBUS
  elseif all(buf, first, last, sinowealth_end) then
    return "Sinowealth"
  elseif all(buf, first, last, pylontech_end) then
    return "Pylontech RS485"
  elseif all(buf, first, last, jbd_end) then
    return "JBD"
  end
  return nil
end

return M
