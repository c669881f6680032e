-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Who asked what, who answered, and how fast: per board and data ID. Pure Lua, no Wireshark.

local exchange = require("daly_exchange")
local addresses = require("daly_addresses")
local DATA_IDS = require("daly_data_ids")

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
  return setmetatable(
    { kinds = {}, rows = {}, records = 0, bytes = 0, boards = {}, unknown = {}, requests = {} },
    Report
  )
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

--- Count one record.
function Report:record(pinfo, kind, raw, slot, _, results)
  local whole = kind == "frame" and #raw == 13 and byte(raw) == 0xA5
  -- A frame of CAN comes in the form of an A5 frame (daly_bus).
  local on_can = results.can and whole
  self.records, self.bytes = self.records + 1, self.bytes + (on_can and byte(raw, 4) or #raw)
  self.kinds[kind] = (self.kinds[kind] or 0) + 1
  self.first = self.first or pinfo.rel_ts
  self.last = pinfo.rel_ts
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
    local wait = results.wait[slot]
    if wait and wait >= 0 then
      row.times[#row.times + 1] = wait
    end
  elseif results.flag[slot] == "echo" then
    row.echoes = row.echoes + 1
  else
    row.requests = row.requests + 1
    if results.flag[slot] == "retry" then
      row.retries = row.retries + 1
    end
    -- Whether it stays unanswered is known when all was read.
    local n = #self.requests
    self.requests[n + 1], self.requests[n + 2], self.requests[n + 3] = row, slot, results
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

--- The report as text.
function Report:text()
  if self.records == 0 then
    return "No Daly record was seen."
  end
  local lines = {}
  local parts = {}
  for i = 1, #KINDS do
    local count = self.kinds[KINDS[i][1]]
    if count then
      parts[#parts + 1] = format("%d %s", count, KINDS[i][2])
    end
  end
  lines[1] =
    format("%d records: %s; %d bytes in %.3f s", self.records, concat(parts, ", "), self.bytes, self.last - self.first)
  local boards = {}
  for board = 0, 0x1F do
    if self.boards[board] then
      boards[#boards + 1] = format("%d", board)
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
  local rows = {}
  for _, row in pairs(self.rows) do
    rows[#rows + 1] = row
  end
  table.sort(rows, function(a, b)
    return a.key < b.key
  end)
  if #rows > 0 then
    lines[#lines + 1] = ""
    lines[#lines + 1] = "                                                                         response time, ms"
    lines[#lines + 1] = format(
      COLUMNS,
      "board",
      "data ID",
      "request",
      "replies",
      "no rep",
      "again",
      "echo",
      "damage",
      "min",
      "mean",
      "95 %",
      "max"
    )
  end
  local missing = unanswered(self)
  for i = 1, #rows do
    local row = rows[i]
    local times = { "", "", "", "" }
    if #row.times > 0 then
      times = { spread(row.times) }
      for k = 1, 4 do
        times[k] = format("%.1f", times[k])
      end
    end
    lines[#lines + 1] = format(
      COLUMNS,
      row.board and format("%d", row.board) or "any",
      format("0x%02X %s", row.id, DATA_IDS[row.id] or "unknown ID"),
      format("%d", row.requests),
      format("%d", row.replies),
      format("%d", missing[row] or 0),
      format("%d", row.retries),
      format("%d", row.echoes),
      format("%d", row.damaged),
      times[1],
      times[2],
      times[3],
      times[4]
    ):gsub("%s+$", "")
  end
  return concat(lines, "\n")
end

return M
