-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Kinds of values: what some bytes say, as a value for the tree and as words. High byte first everywhere. The tables of
-- daly_settings (A5) and daly_registers (Modbus) are written with these kinds. Pure Lua, no Wireshark.

local M = {}

local byte, format, sub, floor = string.byte, string.format, string.sub, math.floor

--- The number in raw[at .. at + length - 1], of one, two or four bytes.
local function number(raw, at, length)
  local a, b, c, d = byte(raw, at, at + length - 1)
  if length == 1 then
    return a
  elseif length == 2 then
    return a * 256 + b
  end
  return ((a * 256 + b) * 256 + c) * 256 + d
end

M.number = number

-- Whether these bytes are all 00, or all FF.
local function is_empty(raw, at, length)
  local bytes = sub(raw, at, at + length - 1)
  return bytes == ("\0"):rep(length) or bytes == ("\xFF"):rep(length)
end

--- Bytes as they can be shown.
function M.printable(bytes)
  return (bytes:gsub("[^\x20-\x7E]", "?"))
end

-- A text without the padding at its end (00, FF, 20); nil where nothing is left.
local function stripped(bytes)
  local text = bytes:match("^(.-)[%z\xFF\x20]*$")
  return text ~= "" and text or nil
end

local function text(raw, at, length)
  local bytes = stripped(sub(raw, at, at + length - 1))
  return bytes and M.printable(bytes)
end

--- Values by kind, nil where the bytes say that there is none.
M.read = {
  number = number,
  hex = number,
  name = number,
  double = number,
  tenth = function(raw, at, length)
    return number(raw, at, length) / 10
  end,
  hundredth = function(raw, at, length)
    return number(raw, at, length) / 100
  end,
  current = function(raw, at)
    return (number(raw, at, 2) - 30000) / 10
  end,
  offset = function(raw, at)
    return number(raw, at, 2) - 30000
  end,
  hundreds = function(raw, at)
    return number(raw, at, 2) * 100
  end,
  -- Of a time to sleep: FFFF is "never", no time.
  tens = function(raw, at)
    local value = number(raw, at, 2)
    return value ~= 0xFFFF and value * 10 or nil
  end,
  temperature = function(raw, at, length)
    return number(raw, at, length) - 40
  end,
  switch = function(raw, at, length)
    return number(raw, at, length) ~= 0
  end,
  date = function(raw, at)
    if is_empty(raw, at, 3) then
      return nil
    end
    return format("20%02d-%02d-%02d", byte(raw, at, at + 2))
  end,
  clock = function(raw, at)
    if is_empty(raw, at, 6) then
      return nil
    end
    return format("20%02d-%02d-%02d %02d:%02d:%02d", byte(raw, at, at + 5))
  end,
  text = text,
  -- As boards that speak D2 send their versions: the last character first.
  reversed = function(raw, at, length)
    local bytes = stripped(sub(raw, at, at + length - 1))
    return bytes and M.printable(bytes:reverse())
  end,
}

local WHOLE, TEXT = "%.0f%s", '"%s"'

-- How a value of a kind reads.
local WORDS = {
  tenth = "%.1f%s",
  current = "%.1f%s",
  hundredth = "%.2f%s",
  hex = "0x%02X%s",
  text = TEXT,
  reversed = TEXT,
  date = "%s",
  clock = "%s",
}

--- A value in words. `names`: those of a kind "name"; `unit`: such as " mV", or nil.
function M.words(kind, value, unit, names)
  if kind == "switch" then
    return value and "on" or "off"
  elseif kind == "name" then
    return names[value] or format("%d", value)
  end
  return format(WORDS[kind] or WHOLE, value, unit or "")
end

local SPELT = { soc = "SOC", mos = "MOS", rs485 = "RS485", can = "CAN" }
local SPECIAL =
  { ["mos charge"] = "charge MOS", ["mos discharge"] = "discharge MOS", ["mos precharge"] = "precharge MOS" }
local labels = {}

--- A field's name as people say it: "setting.cell_high_1" is "cell high 1".
function M.label(name)
  local label = labels[name]
  if not label then
    label = name:gsub("^%l+%.", { ["setting."] = "", ["alarm."] = "", ["wakeup."] = "" }):gsub("[._]", " ")
    label = SPECIAL[label] or label:gsub("%w+", SPELT)
    labels[name] = label
  end
  return label
end

--- Whether a bit is set in a number.
function M.has_bit(value, bit)
  return floor(value / 2 ^ bit) % 2 == 1
end

return M
