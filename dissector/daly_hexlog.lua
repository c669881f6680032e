-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Opens a terminal's hex log as a capture of link type USER0: each line a time stamp and bytes.
--
--   1700000000.10 A5 40 90 08 00 00 00 00 00 00 00 00 7D     seconds since 1970 (UTC)
--   2026-11-21T12:34:56.789Z a5:01:90:08:02:15               date and time, T or a blank between; Z, +hh:mm, else UTC
--   [12:34:56.789] TX: A54090080000000000000000 7D           time of day: day 1 of 1970, the next day after midnight
--   # a comment, // too, ; too
--
-- TX, RX, >>, <<, Send, Recv before the bytes are left aside (a Lua reader can't tell Wireshark a direction). A line
-- that is none of this becomes an empty packet with the line as its comment: nothing is lost without a word.

if not FileHandler then
  return
end

local M = {}

-- A file is taken for a hex log when the first of so many lines is of the form, and at least half of them, none is too
-- long, and one holds what a Daly frame can begin with.
local LINES_LOOKED_AT, LONGEST_LINE = 10, 8192
local A5_OR_D2, MODBUS = "[\xA5\xD2]", "[\x51-\x60\x81-\x90][\x03\x06\x10]"
-- A byte that is no text: such a file is none of ours.
local BINARY = "[%z\1-\8\14-\31]"

local DAY = 86400

-- Days from 1970-01-01 of a date of the Gregorian calendar.
local function days(year, month, day)
  if month <= 2 then
    year, month = year - 1, month + 12
  end
  local era = math.floor(year / 400)
  local of_era = year - era * 400
  local of_year = math.floor((153 * (month - 3) + 2) / 5) + day - 1
  return era * 146097 + of_era * 365 + math.floor(of_era / 4) - math.floor(of_era / 100) + of_year - 719468
end

-- A fraction's digits as nanoseconds.
local function nanoseconds(digits)
  return tonumber((digits .. "000000000"):sub(1, 9))
end

local function time_of_day(hour, minute, second)
  hour, minute, second = tonumber(hour), tonumber(minute), tonumber(second)
  if hour > 23 or minute > 59 or second > 60 then
    return nil
  end
  return hour * 3600 + minute * 60 + second
end

-- The time stamp at a line's beginning: seconds, nanoseconds, rest of the line, whether it is a time of day; or nil.
local function stamp(line)
  local text, rest = line:match("^%[([^%]]+)%]%s*(.*)$")
  text = text or line
  local tail
  local y, mo, d, h, mi, s, after = text:match("^(%d%d%d%d)[-/](%d%d)[-/](%d%d)[T ](%d%d):(%d%d):(%d%d)(.*)$")
  local seconds, fraction, only_day
  if y then
    local of_day = time_of_day(h, mi, s)
    y, mo, d = tonumber(y), tonumber(mo), tonumber(d)
    if not of_day or y < 1970 or mo < 1 or mo > 12 or d < 1 or d > 31 then
      return nil
    end
    seconds = days(y, mo, d) * DAY + of_day
    fraction, tail = after:match("^[%.,](%d+)(.*)$")
    tail = tail or after
    local sign, zh, zm = tail:match("^([-+])(%d%d):?(%d%d)")
    if sign then
      seconds = seconds - (sign == "+" and 1 or -1) * (tonumber(zh) * 3600 + tonumber(zm) * 60)
      tail = tail:gsub("^[-+]%d%d:?%d%d", "")
    else
      tail = tail:gsub("^Z", "")
    end
  else
    h, mi, s, after = text:match("^(%d%d):(%d%d):(%d%d)(.*)$")
    if h then
      seconds = time_of_day(h, mi, s)
      if not seconds then
        return nil
      end
      only_day = true
      fraction, tail = after:match("^[%.,](%d+)(.*)$")
      tail = tail or after
    else
      seconds, fraction, tail = text:match("^(%d%d%d%d%d%d%d%d%d?%d?)[%.,](%d+)(.*)$")
      if not seconds then
        return nil
      end
      seconds = tonumber(seconds)
    end
  end
  if rest then
    if tail ~= "" then
      return nil
    end
    tail = rest
  elseif not tail:match("^[%s:,;|]") then
    return nil -- digits that merely begin like a time
  end
  return seconds, fraction and nanoseconds(fraction) or 0, tail:match("^[%s:,;|]*(.-)%s*$"), only_day
end

local WORDS = {
  "^[TR][Xx]%f[%A]",
  "^[Ss][Ee][Nn][TtDd]%f[%A]",
  "^[Rr][Ee][Cc][EeVv]%a*",
  "^[<>]+",
  "^[Ww]rite%f[%A]",
  "^[Rr]ead%f[%A]",
}

-- The bytes of "A5 40", "a5:40", "A540", "0xA5, 0x40"; nil when it is anything else.
local function bytes_of(text)
  for i = 1, #WORDS do
    local without, count = text:gsub(WORDS[i], "")
    if count > 0 then
      text = without:match("^[%s:%-]*(.*)$")
      break
    end
  end
  local digits = text:gsub("0[xX]", ""):gsub("[%s:,;%-|]", "")
  if digits == "" or #digits % 2 == 1 or digits:find("%X") then
    return nil
  end
  -- Two digits belong to each other: "A 5" or "A5 4 0" is no dump.
  for word in text:gsub("0[xX]", ""):gmatch("%x+") do
    if #word % 2 == 1 then
      return nil
    end
  end
  return (digits:gsub("%x%x", function(pair)
    return string.char(tonumber(pair, 16))
  end))
end

local function is_comment(line)
  return line:match("^%s*$") or line:match("^%s*#") or line:match("^%s*//") or line:match("^%s*;")
end

-- One line without its end: seconds, nanoseconds, bytes, only_day; or nil.
local function parse(line)
  local seconds, fraction, rest, only_day = stamp(line)
  if not seconds then
    return nil
  end
  local bytes = bytes_of(rest)
  if not bytes then
    return nil
  end
  return seconds, fraction, bytes, only_day
end

-- What programs of Windows put before a text in UTF-8.
local MARK = "^\xEF\xBB\xBF"

-- The next line of the file; of a longer one than LONGEST_LINE, a piece. nil at the end.
local function next_line(file)
  local position = file:seek("cur")
  for _, size in ipairs({ 256, LONGEST_LINE }) do
    local text = file:read(size)
    if not text or text == "" then
      return nil
    end
    local stop = text:find("\n", 1, true)
    if stop then
      file:seek("set", position + stop)
      text = text:sub(1, stop - 1):gsub("\r$", "")
      return position == 0 and text:gsub(MARK, "") or text
    elseif #text < size or size == LONGEST_LINE then
      return (text:gsub("\r$", ""))
    end
    file:seek("set", position)
  end
end

local function read_open(file, capture)
  local looked, understood, daly = 0, 0, false
  while looked < LINES_LOOKED_AT do
    local line = next_line(file)
    if not line then
      break
    end
    if #line >= LONGEST_LINE or line:find(BINARY) then
      return false
    end
    if not is_comment(line) then
      looked = looked + 1
      local seconds, _, bytes = parse(line)
      if seconds then
        understood = understood + 1
        daly = daly or (bytes:find(A5_OR_D2) or bytes:find(MODBUS)) ~= nil
      elseif looked == 1 then
        return false
      end
    end
  end
  if not daly or understood * 2 < looked then
    return false
  end
  file:seek("set", 0)
  capture.encap = wtap.USER0
  capture.time_precision = wtap_filetypes.TSPREC_NSEC
  capture.snapshot_length = 0
  capture.private_table = { last = nil, day = 0 }
  return true
end

-- Fill in the packet of a line; `known` = { last =, day = } goes on from line to line.
local function fill(line, frame, known)
  local seconds, fraction, bytes, only_day = parse(line)
  if not seconds then
    seconds, fraction, bytes = known.last or 0, known.fraction or 0, ""
    frame.comment = "not understood: " .. line:sub(1, 200):gsub("[%c]", "?")
  elseif only_day then
    if known.of_day and seconds < known.of_day - DAY / 2 then
      known.day = known.day + 1
    end
    known.of_day = seconds
    seconds = seconds + known.day * DAY
  end
  known.last, known.fraction = seconds, fraction
  frame.rec_type = wtap_rec_types.PACKET
  frame.flags = wtap_presence_flags.TS + wtap_presence_flags.CAP_LEN
  frame.time = NSTime.new(seconds, fraction)
  frame.captured_length = #bytes
  frame.original_length = #bytes
  frame.encap = wtap.USER0
  frame.data = bytes
  return true
end

local function read(file, capture, frame)
  local known = capture.private_table
  while true do
    local position = file:seek("cur")
    local line = next_line(file)
    if not line then
      return false
    end
    if not is_comment(line) then
      fill(line, frame, known)
      return position
    end
  end
end

local function seek_read(file, _, frame, offset)
  file:seek("set", offset)
  local line = next_line(file)
  if not line then
    return false
  end
  -- Times of random lines are known to Wireshark already: it keeps those of the first reading.
  return fill(line, frame, { last = 0, day = 0 })
end

--- Make it known to Wireshark; once (some versions load each module twice).
function M.register()
  local text = "A terminal's hex log: a time stamp and bytes on each line"
  local reader = FileHandler.new("Daly hex log", "dalyhexlog", text, "rs")
  reader.read_open, reader.read, reader.seek_read = read_open, read, seek_read
  reader.extensions = "log;txt;hex"
  register_filehandler(reader)
end

return M
