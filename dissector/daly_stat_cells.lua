-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Every cell and sensor of every board: how often it was seen, its lowest, mean, highest and last value, how often it
-- was the lowest or highest of all. From the tables of 0x95 and 0x96, and of Modbus replies. Pure Lua, no Wireshark.

local modbus_board = require("daly_modbus_board")
local modbus_exchange = require("daly_modbus_exchange")
local registers = require("daly_registers")
local results_module = require("daly_results")

local M = {}

local byte, format, concat = string.byte, string.format, table.concat

local A5, D2, READ = 0xA5, 0xD2, 0x03
local DATA = 4 -- where the registers of a read reply stand

local Report = {}
Report.__index = Report

--- An empty report.
function M.new()
  return setmetatable({ boards = {} }, Report)
end

local function count(values, number, value)
  local seen = values[number]
  if not seen then
    seen = { count = 0, sum = 0, min = value, max = value, lowest = 0, highest = 0 }
    values[number] = seen
  end
  seen.count, seen.sum, seen.last = seen.count + 1, seen.sum + value, value
  seen.min, seen.max = math.min(seen.min, value), math.max(seen.max, value)
  return seen
end

-- A table of values into what was seen; `skip`: tells values that stand for nothing.
local function take(values, list, skip, offset)
  local low_at, high_at
  for i = 1, #list do
    if not (skip and skip(list[i])) then
      count(values, i, list[i] - offset)
      low_at = low_at and list[low_at] <= list[i] and low_at or i
      high_at = high_at and list[high_at] >= list[i] and high_at or i
    end
  end
  if low_at then
    values[low_at].lowest, values[high_at].highest = values[low_at].lowest + 1, values[high_at].highest + 1
    count(values, "spread", list[high_at] - list[low_at])
  end
end

local function no_sensor(raw)
  return raw == 0 or raw == 0xFF
end

local function board_of(report, key)
  local board = report.boards[key]
  if not board then
    board = { cells = {}, sensors = {} }
    report.boards[key] = board
  end
  return board
end

-- A reply of Modbus: all its cells and all its sensors, where they are all among its registers.
local function take_modbus(report, raw, slot, results)
  local address, fn, length = byte(raw, 1, 3)
  local memory = fn == READ and length == #raw - 5 and results_module.memory(results, slot)
  if not memory then
    return
  end
  local start, cells, sensors = modbus_board.unpack(memory)
  local known, given = registers.MAPS[modbus_exchange.dialect(address)], length / 2
  cells = cells and registers.all(known.cells, cells, registers.HIGHEST_CELL, raw, DATA, start, given)
  sensors = sensors and registers.all(known.sensors, sensors, registers.HIGHEST_SENSOR, raw, DATA, start, given)
  local key = modbus_exchange.board(address) or D2
  if cells then
    take(board_of(report, key).cells, cells, nil, 0)
  end
  if sensors then
    take(board_of(report, key).sensors, sensors, no_sensor, 40)
  end
end

--- Count one record.
function Report:record(_, kind, raw, slot, list, results)
  if kind ~= "frame" then
    return
  elseif not list then
    if byte(raw) ~= A5 and not results.can then
      take_modbus(self, raw, slot, results)
    end
    return
  end
  local address, id = byte(raw, 2, 3)
  local board = board_of(self, address)
  if id == 0x95 then
    take(board.cells, list, nil, 0)
  else
    take(board.sensors, list, no_sensor, 40)
  end
end

local COLUMNS = "%-10s %8s %8s %8s %8s %8s %8s %8s"

local function add_table(lines, values, what, unit)
  if not values.spread then
    return
  end
  lines[#lines + 1] = format(COLUMNS, what .. ", " .. unit, "seen", "min", "mean", "max", "last", "lowest", "highest")
  local function line(name, seen, of_all)
    lines[#lines + 1] = format(
      COLUMNS,
      name,
      format("%d", seen.count),
      format("%d", seen.min),
      format("%.1f", seen.sum / seen.count),
      format("%d", seen.max),
      format("%d", seen.last),
      of_all and format("%d x", seen.lowest) or "",
      of_all and format("%d x", seen.highest) or ""
    ):gsub("%s+$", "")
  end
  for number = 1, 48 do
    if values[number] then
      line(format("%d", number), values[number], true)
    end
  end
  line("spread", values.spread, false)
end

--- The report as text.
function Report:text()
  local lines = {}
  for address = 0, D2 do
    local board = self.boards[address]
    if board then
      lines[#lines + 1] = address == D2 and "D2 (names no board)" or format("Board %d", address)
      add_table(lines, board.cells, "cell", "mV")
      add_table(lines, board.sensors, "sensor", "C")
      lines[#lines + 1] = ""
    end
  end
  if #lines == 0 then
    return "No table of cells was seen: that takes a 0x94 (how many there are) and all frames of a 0x95, "
      .. "or a reply of Modbus with all of them."
  end
  return concat(lines, "\n")
end

return M
