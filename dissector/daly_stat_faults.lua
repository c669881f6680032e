-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- When faults were raised and cleared, per board, and which stand at the end. From 0x98. Pure Lua, no Wireshark.

local faults = require("daly_faults")

local M = {}

local byte, format, concat = string.byte, string.format, table.concat

-- So many lines are kept of one capture.
local MOST_LINES = 10000

local Report = {}
Report.__index = Report

--- An empty report.
function M.new()
  return setmetatable({ boards = {}, lines = {}, left_out = 0 }, Report)
end

local function say(report, pinfo, address, text)
  local lines = report.lines
  if #lines >= MOST_LINES then
    report.left_out = report.left_out + 1
    return
  end
  lines[#lines + 1] = format("%14.6f  %8d  %5d  %s", pinfo.rel_ts, pinfo.number, address, text)
end

--- Count one record.
function Report:record(pinfo, kind, raw)
  if kind ~= "frame" or byte(raw) ~= 0xA5 or byte(raw, 3) ~= 0x98 or byte(raw, 2) >= 0x20 then
    return
  end
  local address = byte(raw, 2)
  local board = self.boards[address]
  local names = faults.read(raw, 5)
  if not board then
    board = { count = 0, since = {} }
    self.boards[address] = board
    for i = 1, #names do
      board.since[names[i]] = pinfo.rel_ts
      say(self, pinfo, address, "already there  " .. names[i])
    end
  else
    local raised, cleared = faults.changes(board.raw, 5, raw, 5)
    for i = 1, #raised do
      board.since[raised[i]] = pinfo.rel_ts
      say(self, pinfo, address, "raised         " .. raised[i])
    end
    for i = 1, #cleared do
      local stood = pinfo.rel_ts - (board.since[cleared[i]] or pinfo.rel_ts)
      say(self, pinfo, address, format("cleared        %s, after %.3f s", cleared[i], stood))
      board.since[cleared[i]] = nil
    end
  end
  board.raw, board.count, board.names, board.last = raw, board.count + 1, names, pinfo.rel_ts
end

--- The report as text.
function Report:text()
  local lines, states = {}, {}
  for address = 0, 0x1F do
    local board = self.boards[address]
    if board then
      local standing = {}
      for i = 1, #board.names do
        standing[i] = format("%s (for %.3f s)", board.names[i], board.last - board.since[board.names[i]])
      end
      local text = #standing > 0 and concat(standing, ", ") or "none"
      states[#states + 1] = format("Board %d, after %d replies to 0x98: %s", address, board.count, text)
    end
  end
  if #states == 0 then
    return "No 0x98 was seen."
  end
  if #self.lines > 0 then
    lines[1] = format("%14s  %8s  %5s", "time, s", "packet", "board")
    for i = 1, #self.lines do
      lines[#lines + 1] = self.lines[i]
    end
    if self.left_out > 0 then
      lines[#lines + 1] = format("... and %d more", self.left_out)
    end
    lines[#lines + 1] = ""
  end
  lines[#lines + 1] = concat(states, "\n")
  return concat(lines, "\n")
end

return M
