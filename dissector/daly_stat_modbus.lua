-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Statistics of Modbus: who asked for which registers, who answered, and how fast. Pure Lua, no Wireshark.
--
--   a row: board and dialect, function, registers     D2, 03, 0000 to 003D

local exchange = require("daly_modbus_exchange")
local modbus_board = require("daly_modbus_board")
local results_module = require("daly_results")

local M = {}

local byte, format = string.byte, string.format

local READ, WRITE_ONE, REFUSES = 0x03, 0x06, 0x80
local WORDS = { [0x03] = "read", [0x06] = "write", [0x10] = "write" }

local Table = {}
Table.__index = Table

--- An empty table of rows.
function M.new()
  return setmetatable({
    rows = {}, -- by key
    asked = {}, -- by packet and what answers it: the request's row
    codes = {}, -- of exceptions: how many
  }, Table)
end

local function row_of(rows, address, fn, start, count)
  local board = exchange.board(address)
  local key = format("%s %03d %02X %05X %05X", exchange.dialect(address), board or 0, fn, start or 0x10000, count)
  local row = rows[key]
  if not row then
    local range = not start and format("? (%d)", count)
      or count == 1 and format("%04X", start)
      or format("%04X-%04X", start, start + count - 1)
    row = {
      key = key,
      board = board and format("%d", board) or "D2",
      name = format("%s %02X %s %s", exchange.dialect(address), fn, WORDS[fn] or "", range),
      requests = 0,
      replies = 0,
      refused = 0,
      times = {},
    }
    rows[key] = row
  end
  return row
end

-- First register and count that a frame is about; nil where it does not tell the first.
local function place_of(raw, fn, reply, memory)
  local _, _, a, b, c, d = byte(raw, 1, 6)
  if reply and fn == READ then
    return memory and (modbus_board.unpack(memory)) or nil, (a - a % 2) / 2
  end
  return a * 256 + b, fn == WRITE_ONE and 1 or c * 256 + d
end

--- Count one frame. Returns its row when it is a request, which may stay unanswered; else nil, and the board that
-- answers where the dialect tells it.
function Table:count(number, raw, slot, results)
  local address, fn = byte(raw, 1, 2)
  local reply = exchange.is_reply(raw)
  if reply == nil then
    reply = results.flag[slot] == "reply"
  end
  local plain = fn % REFUSES
  local answered_by = exchange.answers_from(address) * 256 + plain
  if not reply then
    local row = row_of(self.rows, address, plain, place_of(raw, plain, false))
    row.requests = row.requests + 1
    self.asked[number * 65536 + answered_by] = row
    return row
  end
  local link = results_module.link(results, slot)
  local row = link and self.asked[link * 65536 + answered_by]
  if fn > REFUSES then
    local code = byte(raw, 3)
    self.codes[code] = (self.codes[code] or 0) + 1
    row = row or row_of(self.rows, address, plain, nil, 0)
    row.refused = row.refused + 1
  else
    row = row or row_of(self.rows, address, plain, place_of(raw, plain, true, results_module.memory(results, slot)))
  end
  row.replies = row.replies + 1
  local wait = results_module.wait(results, slot)
  if wait then
    row.times[#row.times + 1] = wait
  end
  return nil, exchange.board(address)
end

--- All rows, in order.
function Table:sorted()
  local list = {}
  for _, row in pairs(self.rows) do
    list[#list + 1] = row
  end
  table.sort(list, function(a, b)
    return a.key < b.key
  end)
  return list
end

--- What boards gave as reasons to refuse: words, or nil.
function Table:reasons()
  local words = {}
  for code = 0, 0xFF do
    if self.codes[code] then
      words[#words + 1] = format("0x%02X (%d)", code, self.codes[code])
    end
  end
  return #words > 0 and table.concat(words, ", ") or nil
end

return M
