-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- HKMS dialect of CAN: cells (0400) and sensors (0401), which come in several numbered frames, put together as those of
-- 0x95 and 0x96 (docs/wires.md 2). Each register of each board is a burst of its own: boards stream, and frames of
-- others lie between.

local bus_module = require("daly_bus")
local bursts = require("daly_bursts")
local classic = require("daly_can_classic")

local M = {}

local byte = string.byte

local COUNTS = 0x0408
local MOST_CELLS, MOST_SENSORS = 48, 21

--- Registers whose frames are laid out as those of a data ID.
M.AS_A5 = { [0x0400] = 0x95, [0x0401] = 0x96 }

--- A frame of those in the form of an A5 frame, but for its first byte: it is none.
function M.as_a5(shape, data)
  return classic.as_a5(M.AS_A5[shape.register], data, shape.destination, shape.source, 0)
end

--- A bus with nothing remembered. See daly_bus.new.
function M.new(times, results)
  return { times = times, results = results, boards = {}, streams = {} }
end

-- What is remembered of one register of one board: a bus of its own, with the counts of the board.
local function stream_of(hkms, register, board)
  local key = register * 0x100 + board
  local stream = hkms.streams[key]
  if not stream then
    stream = bus_module.new(hkms.times, hkms.results)
    stream.state.boards = hkms.boards
    hkms.streams[key] = stream
  end
  return stream
end

--- One frame of this dialect, in the order of the capture.
function M.feed(hkms, slot, number, shape, data, time)
  local source = shape.source
  if not shape.streamed or #data ~= 8 then
    return
  end
  local id = M.AS_A5[shape.register]
  if id then
    local stream, results = stream_of(hkms, shape.register, source), hkms.results
    results.link[slot], results.wait[slot], results.memory[slot] = false, false, false
    if byte(data) == 0 then
      return -- skipped, as FF is: they are numbered from 1
    end
    local burst = stream.state.burst
    if burst then
      burst.asked = true -- the same number again begins a new burst
    end
    local _, wait, memory = bursts.feed(stream, slot, number, M.as_a5(shape, data), source, id, time, time)
    results.wait[slot], results.memory[slot] = wait or false, memory or false
  elseif shape.register == COUNTS then
    local board = hkms.boards[source] or {}
    hkms.boards[source] = board
    local cells, sensors = byte(data, 1, 2)
    if cells >= 1 and cells <= MOST_CELLS then
      board.cells = cells
    end
    if sensors >= 1 and sensors <= MOST_SENSORS then
      board.sensors = sensors
    end
  end
end

return M
