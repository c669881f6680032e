-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Whose frame a CAN identifier tells of (docs/wires.md 2). Pure Lua, no Wireshark.
--
--   classic    18 | data ID | destination | source
--   HKMS       register (13 bits) | destination | source         host 80; keep-alive 0400FF80
--
-- One of destination and source is a board, 01..10, the other a host: 20, 40..4F, 80.

local NUMBERED = require("daly_bursts").IDS

local M = {}

local floor, format, concat = math.floor, string.format, table.concat

M.KEEP_ALIVE = 0x0400FF80

-- Identifiers of standard frames are below the first of these, and no extended one of ours; all are below the second.
M.STANDARD, M.EXTENDED = 0x800, 0x20000000

local CLASSIC = 0x18
local FIRST_READ, LAST_READ = 0x90, 0x98 -- of the paper: they tell Daly from others
local DEYE_SETTINGS = { [0xF0] = true, [0xF1] = true } -- in place of the data ID
local FIRST_STREAMED, LAST_STREAMED = 0x0400, 0x040E
local WRITES = { [0x182A] = true, [0x182C] = true, [0x161E] = true, [0x181E] = true }
M.SET_SOC = 0x161E -- sent on classic buses too

local function is_board(address)
  return address >= 0x01 and address <= 0x10
end

local function is_host(address)
  return address >= 0x40 and address <= 0x4F or address == 0x80 or address == 0x20
end

-- Other people's, by name (protocol.md, c.3).
local foreign = { [0x18F00180] = "Deye", [0x18F10180] = "Deye" }
for _, id in ipairs({ 0x351, 0x355, 0x356, 0x35A, 0x35E, 0x35F, 0x379 }) do
  foreign[id] = "Victron/Pylontech"
end
for id = 0x370, 0x377 do
  foreign[id] = "Victron/Pylontech"
end
for id = 0x4200, 0x42FF do
  foreign[id] = "Pylontech-HV"
end

--- Priority (bits 24 to 28), bits 16 to 23, destination and source of an extended identifier.
function M.parts(id)
  local source = id % 0x100
  local rest = (id - source) / 0x100
  local destination = rest % 0x100
  rest = (rest - destination) / 0x100
  local middle = rest % 0x100
  return floor((rest - middle) / 0x100), floor(middle), floor(destination), floor(source)
end

local parts = M.parts

-- What an identifier can be, by itself.
local function shape(id)
  if id < M.STANDARD then
    return { foreign = foreign[id] }
  end
  local priority, middle, destination, source = parts(id)
  local register = priority * 0x100 + middle
  local asks = is_board(destination) and is_host(source)
  local found = {
    id = id,
    key = id * 256,
    priority = priority,
    destination = destination,
    source = source,
    register = register,
    asks = asks,
    board = is_board(source) and source or is_board(destination) and destination or nil,
  }
  found.foreign = foreign[id]
  if priority == CLASSIC and (asks or is_board(source) and is_host(destination)) and not DEYE_SETTINGS[middle] then
    found.classic = middle
    found.sure = middle >= FIRST_READ and middle <= LAST_READ
    found.numbered = not asks and NUMBERED[middle] ~= nil
  end
  found.writes = WRITES[register] and asks or nil
  found.plain = found.classic and not found.writes
  found.streamed = register >= FIRST_STREAMED and register <= LAST_STREAMED and is_board(source) or nil
  found.keep_alive = id == M.KEEP_ALIVE or nil
  return found
end

-- A bus has few identifiers; more than this are made up, and are forgotten.
local MOST_SHAPES = 4096
local shapes, count = {}, 0

--- Those that were asked for, by identifier (M.shape).
M.shapes = shapes

--- What an identifier can be: { id =, priority =, destination =, source =, register =, board = the one that is asked or
-- speaks, asks = whether a host asks a board, classic = data ID, sure = whether that ID tells Daly from others, plain =
-- whether it is classic on any bus of Daly's, numbered = whether such replies are frames of bursts, key = what its
-- frames are remembered by (daly_can_classic), writes =, streamed =, keep_alive = of HKMS, foreign = name }, each nil
-- or false where it is not.
function M.shape(id)
  local found = shapes[id]
  if not found then
    if count >= MOST_SHAPES then
      for known in pairs(shapes) do
        shapes[known] = nil
      end
      count = 0
    end
    found = shape(id)
    shapes[id], count = found, count + 1
  end
  return found
end

-- Ranges of classic identifiers of some data IDs: "403701824-403701839,...".
local function classic_ranges(list, first, last)
  local hosts = { { 0x20, 0x20 }, { 0x40, 0x4F }, { 0x80, 0x80 } }
  for middle = first, last do
    if not DEYE_SETTINGS[middle] then
      local base = (CLASSIC * 0x100 + middle) * 0x10000
      for board = 0x01, 0x10 do
        for i = 1, #hosts do
          list[#list + 1] = format("%d-%d", base + board * 0x100 + hosts[i][1], base + board * 0x100 + hosts[i][2])
        end
      end
      for i = 1, #hosts do
        for host = hosts[i][1], hosts[i][2] do
          list[#list + 1] = format("%d-%d", base + host * 0x100 + 0x01, base + host * 0x100 + 0x10)
        end
      end
    end
  end
end

--- Whether an identifier can be ours, or a foreign one that is known by name.
function M.is_ours(id)
  local found = M.shape(id)
  return (found.classic or found.writes or found.streamed or found.keep_alive or found.foreign) ~= nil
end

--- Extended identifiers that tell Daly from others, as a range of Wireshark's.
function M.sure_ranges()
  local list = { format("%d", M.KEEP_ALIVE) }
  classic_ranges(list, FIRST_READ, LAST_READ)
  return concat(list, ",")
end

--- All other identifiers that can be ours or known foreign ones, once the bus is known: extended ones and standard
-- ones.
function M.other_ranges()
  local list, standard = {}, {}
  classic_ranges(list, 0x00, FIRST_READ - 1)
  classic_ranges(list, LAST_READ + 1, 0xFF)
  for register in pairs(WRITES) do
    -- 182A, 182C and 181E are among the classic ones.
    if floor(register / 0x100) ~= CLASSIC then
      for board = 0x01, 0x10 do
        local base = register * 0x10000 + board * 0x100
        list[#list + 1] = format("%d,%d-%d,%d", base + 0x20, base + 0x40, base + 0x4F, base + 0x80)
      end
    end
  end
  for register = FIRST_STREAMED, LAST_STREAMED do
    for destination = 0x00, 0xFF do
      local base = register * 0x10000 + destination * 0x100
      list[#list + 1] = format("%d-%d", base + 0x01, base + 0x10)
    end
  end
  for id in pairs(foreign) do
    local wanted = id < M.STANDARD and standard or list
    wanted[#wanted + 1] = format("%d", id)
  end
  return concat(list, ","), concat(standard, ",")
end

return M
