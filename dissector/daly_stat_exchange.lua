-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Who asked what, who answered, and how fast: per board and data ID, per board and registers (Modbus), per board and
-- register (HKMS). Pure Lua, no Wireshark.

local exchange = require("daly_exchange")
local addresses = require("daly_addresses")
local DATA_IDS = require("daly_data_ids")
local hkms = require("daly_hkms_bus")
local modbus = require("daly_stat_modbus")
local results_module = require("daly_results")

local M = {}

local byte, format, concat = string.byte, string.format, table.concat

local KINDS = {
  { "frame", "frames" },
  { "bad_checksum", "with a bad checksum" },
  { "short", "cut off" },
  { "junk", "junk" },
  { "foreign", "other people's" },
  { "event", "events" },
}

local Report = {}
Report.__index = Report

--- An empty report.
function M.new()
  return setmetatable({
    kinds = {},
    rows = {}, -- of A5
    modbus = modbus.new(),
    hkms = {}, -- frames by register and board
    records = 0,
    bytes = 0,
    boards = {},
    unknown = {},
    requests = {}, -- that may stay unanswered: row, slot, results, one behind the other
  }, Report)
end

-- The row of a board (0: none is named) and an ID.
local function row_of(report, board, id)
  local key = (board or 0) * 256 + id
  local row = report.rows[key]
  if not row then
    row =
      { key = key, board = board, id = id, requests = 0, replies = 0, retries = 0, echoes = 0, damaged = 0, times = {} }
    report.rows[key] = row
  end
  return row
end

-- Whether a request stays unanswered is known when all was read.
local function note_request(report, row, slot, results)
  local list = report.requests
  local n = #list
  list[n + 1], list[n + 2], list[n + 3] = row, slot, results
end

-- A frame that is none of A5: of Modbus, or of HKMS. Returns how many bytes it had on the wire.
local function count_other(report, number, raw, slot, results)
  if not results.can then
    local row, answers = report.modbus:count(number, raw, slot, results)
    if row then
      note_request(report, row, slot, results)
    elseif answers then
      report.boards[answers] = true
    end
    return #raw
  end
  local board, register, length = hkms.uncounted(raw)
  local key = register * 256 + board
  report.hkms[key] = (report.hkms[key] or 0) + 1
  return length
end

--- Count one record.
function Report:record(pinfo, kind, raw, slot, _, results)
  local whole = kind == "frame" and #raw == 13 and byte(raw) == 0xA5
  -- A frame of CAN comes in the form of an A5 frame (daly_bus).
  local on_can = results.can and whole
  local length = on_can and byte(raw, 4) or #raw
  if kind == "frame" and not whole then
    length = count_other(self, pinfo.number, raw, slot, results)
  end
  self.records, self.bytes = self.records + 1, self.bytes + length
  self.kinds[kind] = (self.kinds[kind] or 0) + 1
  local time = pinfo.rel_ts
  self.first, self.last = math.min(self.first or time, time), math.max(self.last or time, time)
  if kind ~= "bad_checksum" and not whole then
    return
  end
  local address, id = byte(raw, 2, 3)
  if kind == "frame" and not DATA_IDS[id] then
    self.unknown[id] = (self.unknown[id] or 0) + 1
  end
  local asked = on_can and address >= 0x20 and byte(raw, 13)
  local row = row_of(self, asked or addresses.board(address), id)
  if kind == "bad_checksum" then
    row.damaged = row.damaged + 1
  elseif address < 0x20 then
    row.replies = row.replies + 1
    self.boards[address] = true
    local wait = results_module.wait(results, slot)
    if wait then
      row.times[#row.times + 1] = wait
    end
  elseif results.flag[slot] == "echo" then
    row.echoes = row.echoes + 1
  else
    row.requests = row.requests + 1
    if results.flag[slot] == "retry" then
      row.retries = row.retries + 1
    end
    note_request(self, row, slot, results)
  end
end

local function unanswered(report)
  local count = {}
  for i = 1, #report.requests, 3 do
    local row, slot, results = report.requests[i], report.requests[i + 1], report.requests[i + 2]
    if exchange.is_unanswered(results, slot) then
      count[row] = (count[row] or 0) + 1
    end
  end
  return count
end

-- Lowest, mean, the one that 95 of 100 are not above, highest; ms.
local function spread(times)
  table.sort(times)
  local sum = 0
  for i = 1, #times do
    sum = sum + times[i]
  end
  local p95 = times[math.ceil(#times * 0.95)]
  return times[1] * 1000, sum / #times * 1000, p95 * 1000, times[#times] * 1000
end

local COLUMNS = "%-5s %-23s %7s %7s %6s %6s %6s %6s  %8s %8s %8s %8s"

local function count(value)
  return format("%d", value)
end

-- A row of a table; `columns`: board, name, and six more.
local function line(columns, times)
  local shown = { "", "", "", "" }
  if #times > 0 then
    shown = { spread(times) }
    for k = 1, 4 do
      shown[k] = format("%.1f", shown[k])
    end
  end
  for k = 1, 4 do
    columns[8 + k] = shown[k]
  end
  return (format(COLUMNS, table.unpack(columns, 1, 12)):gsub("%s+$", ""))
end

local function heading(lines, name, again, echo, last)
  lines[#lines + 1] = ""
  lines[#lines + 1] = "                                                                         response time, ms"
  local columns = { "board", name, "request", "replies", "no rep", again, echo, last, "min", "mean", "95 %", "max" }
  lines[#lines + 1] = format(COLUMNS, table.unpack(columns))
end

local function a5_table(report, lines, missing)
  local rows = {}
  for _, row in pairs(report.rows) do
    rows[#rows + 1] = row
  end
  if #rows == 0 then
    return
  end
  table.sort(rows, function(a, b)
    return a.key < b.key
  end)
  heading(lines, "data ID", "again", "echo", "damage")
  for _, row in ipairs(rows) do
    lines[#lines + 1] = line({
      row.board and count(row.board) or "any",
      format("0x%02X %s", row.id, DATA_IDS[row.id] or "unknown ID"),
      count(row.requests),
      count(row.replies),
      count(missing[row] or 0),
      count(row.retries),
      count(row.echoes),
      count(row.damaged),
    }, row.times)
  end
end

local function modbus_table(report, lines, missing)
  local rows = report.modbus:sorted()
  if #rows == 0 then
    return
  end
  heading(lines, "Modbus, registers", "", "", "refuse")
  for _, row in ipairs(rows) do
    lines[#lines + 1] = line({
      row.board,
      row.name,
      count(row.requests),
      count(row.replies),
      count(missing[row] or 0),
      "",
      "",
      count(row.refused),
    }, row.times)
  end
  local reasons = report.modbus:reasons()
  if reasons then
    lines[#lines + 1] = "exception codes: " .. reasons
  end
end

local function hkms_table(report, lines)
  local keys = {}
  for key in pairs(report.hkms) do
    keys[#keys + 1] = key
  end
  if #keys == 0 then
    return
  end
  table.sort(keys)
  lines[#lines + 1] = ""
  lines[#lines + 1] = "board HKMS register            frames"
  for _, key in ipairs(keys) do
    local board = key % 256
    local register = (key - board) / 256
    lines[#lines + 1] = format(
      "%-5s %-23s %7d",
      board > 0 and count(board) or "any",
      board > 0 and format("0x%04X %s", register, hkms.NAMES[register]) or "keep-alive",
      report.hkms[key]
    )
  end
end

--- The report as text.
function Report:text()
  if self.records == 0 then
    return "No Daly record was seen."
  end
  local lines = {}
  local parts = {}
  for i = 1, #KINDS do
    local number = self.kinds[KINDS[i][1]]
    if number then
      parts[#parts + 1] = format("%d %s", number, KINDS[i][2])
    end
  end
  lines[1] =
    format("%d records: %s; %d bytes in %.3f s", self.records, concat(parts, ", "), self.bytes, self.last - self.first)
  local boards = {}
  for board = 0, 0x1F do
    if self.boards[board] then
      boards[#boards + 1] = count(board)
    end
  end
  lines[2] = #boards > 0 and "boards that answer: " .. concat(boards, ", ") or "no board answers"
  local unknown = {}
  for id = 0, 0xFF do
    if self.unknown[id] then
      unknown[#unknown + 1] = format("0x%02X (%d)", id, self.unknown[id])
    end
  end
  if #unknown > 0 then
    lines[3] = "frames with an unknown data ID: " .. concat(unknown, ", ")
  end
  local missing = unanswered(self)
  a5_table(self, lines, missing)
  modbus_table(self, lines, missing)
  hkms_table(self, lines)
  return concat(lines, "\n")
end

return M
