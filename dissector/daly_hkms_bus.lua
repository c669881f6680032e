-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- HKMS dialect of CAN: cells (0400) and sensors (0401), which come in several numbered frames, put together as those of
-- 0x95 and 0x96 (docs/wires.md 2). Each register of each board is a burst of its own: boards stream, and frames of
-- others lie between.

local bus_module = require("daly_bus")
local bursts = require("daly_bursts")
local note_reply = require("daly_results").note_reply
local classic = require("daly_can_classic")

local M = {}

local byte = string.byte

local COUNTS = 0x0408
local MOST_CELLS, MOST_SENSORS = 48, 21

--- Registers whose frames are laid out as those of a data ID.
M.AS_A5 = { [0x0400] = 0x95, [0x0401] = 0x96 }

--- Names of the registers.
M.NAMES = {
  [0x0400] = "Cell voltages",
  [0x0401] = "Temperatures",
  [0x0402] = "Pack",
  [0x0403] = "Power",
  [0x0404] = "Cell extremes",
  [0x0405] = "Temp. extremes",
  [0x0406] = "MOS status",
  [0x0407] = "State",
  [0x0408] = "Status",
  [0x0409] = "Fault info",
  [0x040A] = "Balance",
  [0x040B] = "Charge info",
  [0x040C] = "Clock",
  [0x040D] = "Limits",
  [0x040E] = "Faults",
  [0x182A] = "Charge MOS",
  [0x182C] = "Discharge MOS",
  [0x161E] = "SOC",
  [0x181E] = "SOC",
}

--- Any other frame for daly_stat: 00 | board, 0: a keep-alive | register u16 | data, shorter than one of those below.
function M.counted(register, board, data)
  return string.char(0, board, math.floor(register / 256), register % 256) .. data
end

--- Board, register and number of data bytes of a frame in either form.
function M.uncounted(raw)
  local _, board, a, b = byte(raw, 1, 4)
  if #raw < 13 then
    return board, a * 256 + b, #raw - 4
  end
  for register, id in pairs(M.AS_A5) do
    if id == a then
      return board, register, b
    end
  end
  return board, 0, b
end

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
    if byte(data) == 0 then
      note_reply(results, slot)
      return -- skipped, as FF is: they are numbered from 1
    end
    local burst = stream.state.burst
    if burst then
      burst.asked = true -- the same number again begins a new burst
    end
    local _, wait, memory, _, table_in =
      bursts.feed(stream, stream.state, slot, number, M.as_a5(shape, data), source, id, time, time)
    note_reply(results, slot, nil, wait, memory, table_in)
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
