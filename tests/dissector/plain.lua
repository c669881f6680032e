-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Checks of the pure modules: lua5.2 plain.lua FOLDER. Expected values are worked out by hand or come from the papers.

package.path = arg[1] .. "/?.lua;" .. package.path

local collector = require("daly_collector")
local windows = require("daly_windows")
local foreign = require("daly_foreign")
local records = require("daly_records")
local streams = require("daly_streams")

local function bytes(hex)
  return (hex:gsub("%s", ""):gsub("..", function(pair)
    return string.char(tonumber(pair, 16))
  end))
end

local function same(got, wanted, what)
  if got ~= wanted then
    error(string.format("%s: got %s, wanted %s", what, tostring(got), tostring(wanted)), 2)
  end
end

-- The CRC examples of the vendor's article, and the check value of CRC-16/MODBUS.
for _, frame in ipairs({ "D203000C000157AA", "D203020001FC56", "D206000C00019BAA", "D210000C000200010002 7D65" }) do
  local raw = bytes(frame)
  same(windows.crc_right(raw, 1, #raw), true, frame)
end
local lo, hi = windows.crc16("123456789", 1, 9)
same(hi * 256 + lo, 0x4B37, "check value")

-- Sinowealth's CRC-8 on the two real exchanges.
same(foreign.name(bytes("0a010 20d03fd"), 1, 6), "Sinowealth", "sino-0")
same(foreign.name(bytes("0a0b02340d0f"), 1, 6), "Sinowealth", "sino-1")

-- A request and a reply of JBD, a request of Pylontech: checks that the real frames have.
same(foreign.name(bytes("dda50300fffd77"), 1, 7), "JBD", "jbd-req")
same(foreign.name("~20024600800800000000FC22\r", 1, 26), "Pylontech RS485", "pylon")
same(foreign.name("~20024600800800000000fC22\r", 1, 26), nil, "small letters")

-- The collector's pause: as it was, shorter the longer our lists are, never so short that it does not stop, as it was
-- again with the next capture; and what another chose meanwhile stays chosen.
local function pause_now()
  local now = collectgarbage("setpause", 200)
  collectgarbage("setpause", now)
  return now
end
collectgarbage("setpause", 240)
collector.init()
same(pause_now(), 240, "pause before anything is kept")
local pauses = {}
for i, numbers in ipairs({ 1000, 100000, 1000000, 100000000 }) do
  collector.note(numbers)
  pauses[i] = pause_now()
end
for i = 2, #pauses do
  same(pauses[i] < pauses[i - 1], true, "shorter with longer lists")
end
same(pauses[1] > 220 and pauses[#pauses] > 110 and pauses[#pauses] < 120, true, "an eighth of what lists take")
collector.note(1000)
same(pause_now(), pauses[1], "by the lists alone")
collector.init()
same(pause_now(), 240, "the next capture")
collector.note(1000000)
collectgarbage("setpause", 160)
collector.note(1000000)
same(pause_now() < 160 and pause_now() > 100, true, "another's choice is scaled")
collector.init()
same(pause_now(), 160, "another's choice stays")
collector.init()
same(pause_now(), 160, "and again")
for _, chosen in ipairs({ 203, 150, 100, 60 }) do
  collectgarbage("setpause", chosen)
  local before = pause_now()
  collector.note(1000000)
  same(pause_now() <= before, true, "never lazier")
  collector.init()
  same(pause_now(), before, "given back as it was")
end
collectgarbage("setpause", 200)
local function pace_now()
  local now = collectgarbage("setstepmul", 200)
  collectgarbage("setstepmul", now)
  return now
end
for _, chosen in ipairs({ 100, 203, 1000, 2000 }) do
  collectgarbage("setstepmul", chosen)
  local before = pace_now()
  collector.note(1000000)
  same(pace_now() >= before, true, "never slower")
  collector.init()
  same(pace_now(), before, "given back as it was")
end
collectgarbage("setstepmul", 200)

-- It is told of what is kept, however far apart the frames are.
local results = require("daly_results")
local sparse, dense = results.new(), results.new()
collector.init()
for i = 1, 5000 do
  results.note_reply(dense, 2 * i, 2 * i - 1, 0.1)
end
local for_dense = pause_now()
collector.init()
for i = 1, 5000 do
  results.note_reply(sparse, 1000 * i, 1000 * i - 1, 0.1)
end
same(for_dense < 200 and pause_now() >= for_dense, true, "sparse frames")
collector.init()

-- Conservation and independence of chunking, on pseudo-random streams with real beginnings in them.
local seed = 12345
local function random(n)
  seed = (seed * 1103515245 + 12345) % 2147483648
  return math.floor(seed / 65536) % n
end

local PIECES = {
  bytes("a540900800000000000000007d"),
  bytes("a501900802100000753001f4ea"),
  bytes("d203000c000157aa"),
  bytes("010300000002c40b"),
  bytes("0a01020d03fd"),
  bytes("a501950802"),
  bytes("dda50300fffd77"),
  "~250F46900000FD90\r",
  bytes("a5a5a508a50108"),
  bytes("d203faa5"),
}

local function stream()
  local list = {}
  for _ = 1, 30 do
    if random(4) == 0 then
      list[#list + 1] = string.char(random(256), random(256))
    else
      list[#list + 1] = PIECES[random(#PIECES) + 1]
    end
  end
  return table.concat(list)
end

local function frames_of(found, raw, list)
  for _, record in ipairs(found) do
    if record.kind == "frame" then
      list[#list + 1] = record.first .. ":" .. raw:sub(record.first, record.last)
    end
  end
  return list
end

for round = 1, 200 do
  local raw = stream()
  local whole = records.take(records.new(), raw, true)
  local at = 1
  for _, record in ipairs(whole) do
    same(record.first, at, "round " .. round .. ": records follow each other")
    at = record.last + 1
  end
  same(at, #raw + 1, "round " .. round .. ": no byte is lost")
  local wanted = table.concat(frames_of(whole, raw, {}), "|")
  for _ = 1, 5 do
    local cutter, got, from = records.new(), {}, 1
    while from <= #raw do
      local length = 1 + random(random(3) == 0 and 40 or 5)
      frames_of(records.take(cutter, raw:sub(from, from + length - 1), false), raw, got)
      from = from + length
    end
    frames_of(records.take(cutter, "", true), raw, got)
    same(table.concat(got, "|"), wanted, "round " .. round .. ": cut otherwise, the frames are the same")
  end
end

-- An ordinary capture keeps nothing a packet but its links: no plan.
local capture = streams.capture({ baud = 9600, quiet = 0.25, echo = 0.1, reply = 1, burst = 0.5 })
local one = streams.stream(capture, 0, 0, nil)
for i = 1, 1000 do
  same(streams.first(capture, one, i, i * 0.05, PIECES[1 + i % 2]), true, "whole")
end
same(next(capture.plans), nil, "no plan is kept for whole frames")

-- Memory of a stream of nothing but junk is bounded.
local junk = streams.stream(capture, 1, 1, nil)
for i = 1001, 6000 do
  streams.first(capture, junk, i, i * 0.0135, string.rep("\0", 13))
end
same(#junk.cutter.buf < 6000, true, "held junk is bounded")
same(#junk.packets < 600, true, "held packets are bounded")

print("all fine")
