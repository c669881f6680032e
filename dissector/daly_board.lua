-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- What is remembered of each board (address byte of replies) on a bus: what changed since, and what contradicts what
-- (docs/records.md 9, 11). Pure Lua, no Wireshark. Times are seconds.
--
--   0x90  pack voltage ----- 1 % ------ sum of the table of 0x95
--   0x91  highest, lowest -- 20 mV ---- table of 0x95;  numbers -- count of 0x94
--   0x92  highest, lowest -- 2 C ------ table of 0x96;  numbers -- count of 0x94

local results_module = require("daly_results")
local exchange = require("daly_exchange")
local settings = require("daly_settings")
local soc = require("daly_soc")

local M = {}

local byte, char, sub, format = string.byte, string.char, string.sub, string.format
local GRACE = exchange.GRACE

local contradict, change = results_module.contradict, results_module.change

--- Counts above these are ignored.
M.MOST_CELLS, M.MOST_SENSORS = 48, 21
local MOST_CELLS, MOST_SENSORS = M.MOST_CELLS, M.MOST_SENSORS

--- What is remembered of a board.
function M.board_of(state, address)
  local board = state.boards[address]
  if not board then
    board = {}
    state.boards[address] = board
  end
  return board
end

local board_of = M.board_of

-- Whether another record (or none) is new enough to say something about the same moment.
local function is_new(bus, other, starts)
  return other and starts - other.ended <= bus.times.age + GRACE
end

local function keep(board, name, packet, ends)
  local other = board[name]
  if not other then
    other = {}
    board[name] = other
  end
  other.packet, other.ended = packet, ends
  other.current, other.state = board.current, board.load_state
  return other
end

-- Replies after wake-up: a 0x90 or 0x93 of zeros tells nothing of the load.
local ZEROS = ("\0"):rep(8)

-- Voltages of two moments can be compared where the load was the same: 1 A is 10 of the raw current.
local function same_load(mine, theirs)
  if mine.state and theirs.state and mine.state ~= theirs.state then
    return false
  end
  return not mine.current or not theirs.current or math.abs(mine.current - theirs.current) <= 10
end

-- Two voltages of cells, mV; nothing to say where the highest of one side is 0 (after wake-up).
local function compare_cells(bus, slot, mine, theirs, what)
  if mine.max == 0 or theirs.max == 0 or not same_load(mine, theirs) then
    return
  end
  local tolerance = bus.times.cell_tolerance
  if math.abs(mine.max - theirs.max) > tolerance then
    contradict(
      bus.results,
      slot,
      "cell_max",
      theirs.packet,
      format("Highest cell is %d mV here, %d mV in %s", mine.max, theirs.max, what)
    )
  end
  if math.abs(mine.min - theirs.min) > tolerance then
    contradict(
      bus.results,
      slot,
      "cell_min",
      theirs.packet,
      format("Lowest cell is %d mV here, %d mV in %s", mine.min, theirs.min, what)
    )
  end
end

-- Pack voltage (raw, 0.1 V) of a 0x90 against the sum of cells (mV) of a table; `theirs`: which of them is the other.
local function compare_sum(bus, slot, pack, cells, theirs, what)
  local raw, sum = pack.raw, cells.sum
  if
    raw > 0
    and sum > 0
    and same_load(pack, cells)
    and math.abs(raw * 100 - sum) * 100 > bus.times.sum_tolerance * sum
  then
    contradict(
      bus.results,
      slot,
      "pack_voltage",
      theirs.packet,
      format("Pack voltage is %.1f V, the cells sum up to %.3f V, %s", raw / 10, sum / 1000, what)
    )
  end
end

-- A sensor that is not there: raw 0 or FF.
local function is_there(raw)
  return raw ~= 0 and raw ~= 0xFF
end

-- Raw bytes of the highest and lowest temperature: `mine` against the table or the other way round. `single`: the side
-- that is 0x92, whose minimum says nothing where it equals its maximum.
local function compare_temperatures(bus, slot, mine, theirs, single, what)
  local tolerance = bus.times.temperature_tolerance
  if is_there(single.max) and math.abs(mine.max - theirs.max) > tolerance then
    contradict(
      bus.results,
      slot,
      "temperature_max",
      theirs.packet,
      format("Highest temperature is %d C here, %d C in %s", mine.max - 40, theirs.max - 40, what)
    )
  end
  if is_there(single.min) and single.min ~= single.max and math.abs(mine.min - theirs.min) > tolerance then
    contradict(
      bus.results,
      slot,
      "temperature_min",
      theirs.packet,
      format("Lowest temperature is %d C here, %d C in %s", mine.min - 40, theirs.min - 40, what)
    )
  end
end

-- A number of a cell or sensor that the board does not have by its own count.
local function compare_number(bus, slot, name, one, other, count, packet)
  if count and (one > count or other > count) then
    local words = format("Number %d, and there are %d by 0x94", math.max(one, other), count)
    contradict(bus.results, slot, name, packet, words)
  end
end

--- What reads a reply that is one frame, by ID: read(bus, board, slot, packet, raw, starts, ends) returns what it is
-- shown with (daly_results), or nil.
M.readers = {}
local take = M.readers

take[0x90] = function(bus, board, slot, packet, raw, starts, ends)
  local high, low, _, _, more, less, soc_high, soc_low = byte(raw, 5, 12)
  local current = more * 256 + less
  if current ~= 0 or sub(raw, 5, 12) ~= ZEROS then
    board.current = current
  end
  local mine = keep(board, "pack", packet, ends)
  mine.raw, mine.soc = high * 256 + low, soc_high * 256 + soc_low
  local cells = board.all_cells
  if is_new(bus, cells, starts) then
    compare_sum(bus, slot, mine, cells, cells, "the newest table of 0x95")
  end
  soc.of_a5(bus, slot, byte(raw, 2), mine, starts)
  return board.state
end

take[0x91] = function(bus, board, slot, packet, raw, starts, ends)
  local a, b, highest, d, e, lowest = byte(raw, 5, 10)
  local mine = keep(board, "cell_extremes", packet, ends)
  mine.max, mine.min = a * 256 + b, d * 256 + e
  if is_new(bus, board.all_cells, starts) then
    compare_cells(bus, slot, mine, board.all_cells, "the newest table of 0x95")
  end
  compare_number(bus, slot, "cell_number", highest, lowest, board.cells, board.cells_in)
end

take[0x92] = function(bus, board, slot, packet, raw, starts, ends)
  local max, highest, min, lowest = byte(raw, 5, 8)
  local mine = keep(board, "temperature_extremes", packet, ends)
  mine.max, mine.min = max, min
  if is_new(bus, board.all_sensors, starts) then
    compare_temperatures(bus, slot, mine, board.all_sensors, mine, "the newest table of 0x96")
  end
  compare_number(bus, slot, "sensor_number", highest, lowest, board.sensors, board.sensors_in)
end

take[0x93] = function(bus, board, slot, packet, raw)
  local state, charge, discharge = byte(raw, 5, 7)
  charge, discharge = charge ~= 0, discharge ~= 0
  local before = board.mos_in
  if before then
    if state ~= board.state then
      change(bus.results, slot, "state", before)
    end
    if charge ~= board.charge then
      change(bus.results, slot, "charge_mos", before)
    end
    if discharge ~= board.discharge then
      change(bus.results, slot, "discharge_mos", before)
    end
  end
  board.state, board.charge, board.discharge, board.mos_in = state, charge, discharge, packet
  board.switched = nil -- older than this
  if state ~= 0 or charge or discharge or sub(raw, 5, 12) ~= ZEROS then
    board.load_state = state
  end
end

-- The reply to a switch: the new state, and stale bytes behind it. It is for the next such write's note alone: what
-- changed (records.md 9) is told of 0x93 by 0x93.
local function take_switch(_, board, _, packet, raw)
  local id, on = byte(raw, 3), byte(raw, 5) ~= 0
  board.switched = board.switched or {}
  board.switched[id], board.switched[-id] = on, packet
end

take[0xD9], take[0xDA] = take_switch, take_switch

take[0x94] = function(bus, board, slot, packet, raw)
  local cells, sensors, charger, load = byte(raw, 5, 8)
  charger, load = charger ~= 0, load ~= 0
  local before = board.status_in
  if cells >= 1 and cells <= MOST_CELLS then
    if board.cells and board.cells ~= cells then
      change(bus.results, slot, "cell_count", before)
    end
    board.cells, board.cells_in = cells, packet
  end
  if sensors >= 1 and sensors <= MOST_SENSORS then
    if board.sensors and board.sensors ~= sensors then
      change(bus.results, slot, "sensor_count", before)
    end
    board.sensors, board.sensors_in = sensors, packet
  end
  if before then
    if charger ~= board.charger then
      change(bus.results, slot, "charger", before)
    end
    if load ~= board.load then
      change(bus.results, slot, "load", before)
    end
  end
  board.charger, board.load, board.status_in = charger, load, packet
end

take[0x98] = function(bus, board, slot, packet, raw)
  local data, before = sub(raw, 5, 12), board.faults
  if before and before ~= data then
    results_module.odd(bus.results, slot).from = board.faults_in
  end
  board.faults, board.faults_in = data, packet
  return before
end

-- What a read of settings tells is remembered for the write that may change it.
local function take_setting(_, board, _, packet, raw)
  local id = byte(raw, 3)
  board.settings = board.settings or {}
  board.settings[id] = sub(raw, 5, 12)
  board.settings[-id] = packet
end

for id = 0x50, 0x6A do
  if settings.READS[id] and #settings.READS[id] > 0 then
    take[id] = take_setting
  end
end

--- A request that writes: what its board had before, as the bytes of such a request (daly_results). `address`: the
-- board it names, or nil: then the bus's only one.
function M.note_before(bus, slot, address, id)
  local all = bus.state.boards
  local board = address and all[address]
  if not address then
    local only = next(all)
    board = only and not next(all, only) and all[only]
  end
  if not board then
    return
  end
  local was, was_in
  local switched = board.switched
  if switched and switched[-id] then
    was, was_in = (switched[id] and "\1" or "\0") .. ("\0"):rep(7), switched[-id]
  elseif (id == 0xD9 or id == 0xDA) and board.mos_in then
    local on = id == 0xDA and board.charge or id == 0xD9 and board.discharge
    was, was_in = (on and "\1" or "\0") .. ("\0"):rep(7), board.mos_in
  elseif id == 0x21 and board.pack then
    local charge = board.pack.soc
    was, was_in = ("\0"):rep(6) .. char(math.floor(charge / 256), charge % 256), board.pack.packet
  elseif board.settings and board.settings[id + 0x40] then
    was, was_in = board.settings[id + 0x40], board.settings[-id - 0x40]
    if id == 0x21 then
      was = sub(was, 1, 6) -- 0x61 tells the clock; where a write has the SOC, it has stale bytes
    end
  end
  if was then
    local odd = results_module.odd(bus.results, slot)
    odd.was, odd.was_in = was, was_in
  end
end

--- A table of all cells (mV) or sensors (raw) of a board with a known count is complete in this packet.
function M.feed_table(bus, slot, packet, values, address, id, starts, ends)
  local board = board_of(bus.state, address)
  if id == 0x95 then
    local mine = keep(board, "all_cells", packet, ends)
    local max, min, sum = values[1], values[1], 0
    for i = 1, #values do
      local value = values[i]
      sum = sum + value
      if value > max then
        max = value
      end
      if value < min then
        min = value
      end
    end
    mine.max, mine.min, mine.sum = max, min, sum
    if is_new(bus, board.cell_extremes, starts) then
      compare_cells(bus, slot, mine, board.cell_extremes, "the newest 0x91")
    end
    local pack = board.pack
    if is_new(bus, pack, starts) then
      compare_sum(bus, slot, pack, mine, pack, "the newest 0x90")
    end
    return
  end
  local max, min
  for i = 1, #values do
    local value = values[i]
    if is_there(value) then
      max = max and math.max(max, value) or value
      min = min and math.min(min, value) or value
    end
  end
  if not max then
    board.all_sensors = nil
    return
  end
  local mine = keep(board, "all_sensors", packet, ends)
  mine.max, mine.min = max, min
  if is_new(bus, board.temperature_extremes, starts) then
    compare_temperatures(bus, slot, mine, board.temperature_extremes, board.temperature_extremes, "the newest 0x92")
  end
end

return M
