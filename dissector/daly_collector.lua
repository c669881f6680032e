-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- How long Lua's collector waits. By itself it waits until there is twice of what is kept (its pause, 200 %). What we
-- keep of a capture are long lists of numbers (daly_results), in which it has nothing to follow, but for which it would
-- wait longer and longer, until what it then takes back has long left the processor's cache. So lists of numbers count
-- for an eighth, and once it begins it ends sooner (bench/README tells what that is worth):
--
--   kept     |<--- the rest --->|<----------- lists of numbers ----------->|
--   garbage  |<--- as much ---->|<-8th->|
--
-- Plugins of one program share one collector: what others keep (as it was when the capture began) counts in full, and
-- what they chose is scaled. Pure Lua, no Wireshark.

local M = {}

local NUMBER = 16 -- bytes, in a list
local PART = 1 / 8
local FASTER = 5
local FASTEST = 1000 -- Lua 5.4 keeps none above 1020

-- What of the collector is set: `ours` is what we made of it, `theirs` what it is without us, in %.
local pause, pace = { name = "setpause" }, { name = "setstepmul" }
local rest = 0 -- what was kept when the capture began, bytes

-- In multiples of 4, as Lua 5.4 keeps them.
local function set(parameter, value)
  parameter.ours = 4 * math.floor(value / 4)
  collectgarbage(parameter.name, parameter.ours)
end

-- What it is without us: another plugin may have set it since. To be followed by setting it, for it is read so.
local function theirs(parameter)
  local now = collectgarbage(parameter.name, parameter.ours or 200)
  if now ~= parameter.ours then
    parameter.theirs = now
  end
  return parameter.theirs
end

--- A capture begins: what was kept of the one before goes.
function M.init()
  for _, parameter in ipairs({ pause, pace }) do
    if parameter.ours then
      collectgarbage(parameter.name, theirs(parameter))
      parameter.ours = nil
    end
  end
  collectgarbage()
  rest = collectgarbage("count") * 1024
end

--- So many numbers are kept in lists by now.
function M.note(numbers)
  local lists = numbers * NUMBER
  local share = (rest + PART * lists) / (rest + lists)
  local wait, speed = theirs(pause), theirs(pace)
  set(pause, wait > 100 and 100 + (wait - 100) * share or wait)
  set(pace, math.max(speed, math.min(FASTEST, FASTER * speed)))
end

return M
