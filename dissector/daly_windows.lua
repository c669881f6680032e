-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Good windows: the places in a stream of bytes that are whole, right frames. Pure Lua, no Wireshark.
--
--   A5            A5 addr id 08 d0 d1 d2 d3 d4 d5 d6 d7 sum               paper "UART/485 V1.2", 2.3
--   Modbus RTU    addr fn ... crc_lo crc_hi                               field notes d; docs/records.md 2
--
--     read request      addr 03 start.2 count.2                crc.2      D2, 81..90
--     read reply        addr 03 n data.n                       crc.2      D2, 51..60; n even, 2..252
--     write one         addr 06 register.2 value.2             crc.2      D2, 81..90, 51..60
--     write many        addr 10 start.2 count.2 data.2c        crc.2      D2, 81..90; as Daly sends it
--                       addr 10 start.2 count.2 2c data.2c     crc.2      D2, 81..90; as the standard has it
--                       addr 10 start.2 count.2                crc.2      D2, 51..60; the reply
--     exception         addr 83|86|90 code                     crc.2      D2, 51..60

local M = {}

local byte = string.byte

local A5_STARTS, ALL_STARTS = "\xA5", "[\xA5\xD2\x51-\x60\x81-\x90]"

-- Every byte that a window can begin with.
M.STARTS = ALL_STARTS

--- Whether Modbus frames are windows too, from now on.
function M.recognise_modbus(yes)
  M.STARTS = yes and ALL_STARTS or A5_STARTS
end

-- Modbus's own limit for a write of several registers.
local MOST_WRITTEN = 123
-- Bytes of a read reply: 126 registers, which the WiFi module reads at once (field notes d; Modbus allows 125).
local MOST_READ = 252

-- CRC-16 without bit operations, which plain Lua 5.2 to 5.4 do not share: exclusive or by a table of all byte pairs,
-- made when the first Modbus frame is looked at.
local xor, crc_lo, crc_hi

local function make_tables()
  xor, crc_lo, crc_hi = {}, {}, {}
  local nibble = {}
  for a = 0, 15 do
    for b = 0, 15 do
      local x, bit_value, p, q = 0, 1, a, b
      for _ = 1, 4 do
        if p % 2 ~= q % 2 then
          x = x + bit_value
        end
        p, q, bit_value = (p - p % 2) / 2, (q - q % 2) / 2, bit_value * 2
      end
      nibble[a * 16 + b] = x
    end
  end
  for a = 0, 255 do
    local al, ah = a % 16, (a - a % 16) / 16
    for b = 0, 255 do
      local bl = b % 16
      local x = nibble[ah * 16 + (b - bl) / 16] * 16 + nibble[al * 16 + bl]
      xor[a * 256 + b] = x
    end
  end
  for value = 0, 255 do
    local lo, hi = value, 0
    for _ = 1, 8 do
      local carry = lo % 2
      lo = (lo - carry) / 2 + (hi % 2) * 128
      hi = (hi - hi % 2) / 2
      if carry == 1 then
        lo, hi = xor[lo * 256 + 0x01], xor[hi * 256 + 0xA0]
      end
    end
    crc_lo[value], crc_hi[value] = lo, hi
  end
end

--- CRC-16 of Modbus (polynomial A001, start FFFF) over buf[first..last]; returns low byte, high byte.
function M.crc16(buf, first, last)
  if not xor then
    make_tables()
  end
  local lo, hi = 255, 255
  local index
  local xors, low, high = xor, crc_lo, crc_hi
  local at = first
  -- Four bytes a turn: taking each by a call of its own cost a fifth more.
  while at + 3 <= last do
    local a, b, c, d = byte(buf, at, at + 3)
    index = xors[lo * 256 + a]
    lo, hi = xors[hi * 256 + low[index]], high[index]
    index = xors[lo * 256 + b]
    lo, hi = xors[hi * 256 + low[index]], high[index]
    index = xors[lo * 256 + c]
    lo, hi = xors[hi * 256 + low[index]], high[index]
    index = xors[lo * 256 + d]
    lo, hi = xors[hi * 256 + low[index]], high[index]
    at = at + 4
  end
  for i = at, last do
    index = xors[lo * 256 + byte(buf, i)]
    lo, hi = xors[hi * 256 + low[index]], high[index]
  end
  return lo, hi
end

--- Whether the last two of buf[first..last] are the CRC of the others, low byte first.
function M.crc_right(buf, first, last)
  local lo, hi = M.crc16(buf, first, last - 2)
  return byte(buf, last - 1) == lo and byte(buf, last) == hi
end

--- Low byte of the sum of 12 bytes from p (paper, 2.3 note 2).
function M.sum(buf, p)
  local a, b, c, d, e, f, g, h, i, j, k, l = byte(buf, p, p + 11)
  return (a + b + c + d + e + f + g + h + i + j + k + l) % 256
end

-- Dialect of a Modbus address, and whether it sends requests, replies.
local function modbus_address(address)
  if address == 0xD2 then
    return "d2", true, true
  elseif address >= 0x81 and address <= 0x90 then
    return "81", true, false
  elseif address >= 0x51 and address <= 0x60 then
    return "81", false, true
  end
  return nil
end

-- The lengths, shortest first, that a Modbus frame beginning at p can have by the bytes up to n; nil where the header
-- is not there yet (then anything is possible).
local function modbus_lengths(buf, p, n)
  local dialect, asks, answers = modbus_address(byte(buf, p))
  local fn, b2, _, b4, b5, b6 = byte(buf, p + 1, math.min(p + 6, n))
  if not fn then
    return dialect, nil
  end
  if fn == 0x06 then
    return dialect, 8
  elseif fn == 0x03 then
    local asked = asks and 8 or nil
    if not answers then
      return dialect, asked
    elseif not b2 then
      return dialect, nil
    elseif b2 % 2 == 0 and b2 >= 2 and b2 <= MOST_READ then
      local answered = 5 + b2
      if not asked then
        return dialect, answered
      elseif answered < asked then
        return dialect, answered, asked
      end
      return dialect, asked, answered
    end
    return dialect, asked or 0
  elseif fn == 0x10 then
    local answered = answers and 8 or nil
    if not asks then
      return dialect, answered
    elseif b4 and b4 > 0 then
      return dialect, answered or 0 -- the count is above 255
    elseif not b5 then
      return dialect, nil
    end
    local count = b4 * 256 + b5
    if count < 1 or count > MOST_WRITTEN then
      return dialect, answered or 0
    end
    local bare, full = 8 + 2 * count, nil
    if not b6 or b6 == 2 * count then
      full = 9 + 2 * count
    end
    if answered then
      return dialect, answered, bare, full
    end
    return dialect, bare, full
  elseif answers and (fn == 0x83 or fn == 0x86 or fn == 0x90) then
    return dialect, 5
  end
  return dialect, 0
end

--- Whether these bytes have the shape of one frame, its check aside.
function M.fits(raw, length)
  local first, _, _, fourth = byte(raw, 1, 4)
  if first == 0xA5 then
    return length == 13 and fourth == 8
  elseif length < 5 then
    return false
  end
  local dialect, one, two, three = modbus_lengths(raw, 1, length)
  return dialect ~= nil and (one == length or two == length or three == length)
end

--- The good window that begins at p and ends first, in buf[1..n].
-- Returns its last position and its dialect ("a5", "d2", "81"), or nil, nil and whether one may still come: some form
-- fits the bytes that are there and is cut off by n.
function M.window(buf, p, n)
  local first = byte(buf, p)
  if first == 0xA5 then
    if p + 12 <= n then
      if byte(buf, p + 3) == 8 and M.sum(buf, p) == byte(buf, p + 12) then
        return p + 12, "a5"
      end
      return nil
    end
    return nil, nil, p + 3 > n or byte(buf, p + 3) == 8
  elseif M.STARTS == A5_STARTS then
    return nil
  end
  local dialect, one, two, three = modbus_lengths(buf, p, n)
  if not dialect then
    return nil
  end
  if not one then
    return nil, nil, true
  end
  local room = n - p + 1
  if one > 0 and one <= room and M.crc_right(buf, p, p + one - 1) then
    return p + one - 1, dialect
  end
  if two and two <= room and M.crc_right(buf, p, p + two - 1) then
    return p + two - 1, dialect
  end
  if three and three <= room and M.crc_right(buf, p, p + three - 1) then
    return p + three - 1, dialect
  end
  return nil, nil, one > room or (two and two > room) or (three and three > room) or false
end

return M
