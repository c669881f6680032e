-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- When faults were raised and cleared, per board, and which stand at the end. From 0x98. Pure Lua, no Wireshark.

local faults = require("daly_faults")
local results_module = require("daly_results")

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

-- The board of this address whose last 0x98 had these data, or nil: several buses may have one of this number each. Of
-- several the one that was silent longest. Where a filter leaves replies out, there is but one to choose on one bus.
local function board_of(boards, before, buses)
  local found
  for i = 1, #boards do
    if boards[i].data == before and (not found or boards[i].last < found.last) then
      found = boards[i]
    end
  end
  return found or buses == 1 and boards[1] or nil
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
function Report:record(pinfo, kind, raw, slot, _, results)
  if kind ~= "frame" or byte(raw) ~= 0xA5 or byte(raw, 3) ~= 0x98 or byte(raw, 2) >= 0x20 then
    return
  end
  local address, time = byte(raw, 2), pinfo.rel_ts
  local boards = self.boards[address] or {}
  self.boards[address] = boards
  local board = board_of(boards, results_module.memory(results, slot), #results.buses)
  local names = faults.read(raw, 5)
  if not board then
    board = { count = 0, since = {} }
    boards[#boards + 1] = board
    for i = 1, #names do
      board.since[names[i]] = time
      say(self, pinfo, address, "already there  " .. names[i])
    end
  else
    local raised, cleared = faults.changes(board.data, 1, raw, 5)
    for i = 1, #raised do
      board.since[raised[i]] = time
      say(self, pinfo, address, "raised         " .. raised[i])
    end
    for i = 1, #cleared do
      local stood = time - (board.since[cleared[i]] or time)
      say(self, pinfo, address, format("cleared        %s, after %.3f s", cleared[i], stood))
      board.since[cleared[i]] = nil
    end
  end
  board.data, board.count, board.names, board.last = raw:sub(5, 12), board.count + 1, names, time
end

--- The report as text.
function Report:text()
  local lines, states = {}, {}
  for address = 0, 0x1F do
    for _, board in ipairs(self.boards[address] or {}) do
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
