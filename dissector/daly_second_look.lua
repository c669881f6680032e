-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Packets that were read without knowing all about them. In the first of two passes (tshark -2, the GUI's loading,
-- sharkd) Wireshark makes no tree unless a filter needs one, and without a tree nobody can tell a packet's interface,
-- or other things that only fields hold. Those packets are all taken for one line. A second look knows better: where
-- there are several lines, or something was not as it was taken, it reads the packets again, in order, as a single pass
-- would; from when all are read again, it knows what comes later too. (tshark -2 -Y frame knows at once.) Pure Lua, no
-- Wireshark.

local M = {}

--- Begin. `state`: where packets are read into when they are read again.
function M.new(state)
  return {
    state = state,
    after = {}, -- by packet number: the next packet's, where that does not follow it
    newest = 0, -- the last of those
    last = 0, -- the last packet that was read again
    only = nil, -- the line
    several = false, -- it is not the only one
  }
end

--- A packet was read without knowing all about it.
function M.note(blind, number)
  if number ~= blind.newest then
    if number ~= blind.newest + 1 then
      blind.after[blind.newest] = number
    end
    blind.newest = number
  end
end

--- Whether all packets were read again.
function M.is_complete(blind)
  return blind.last >= blind.newest
end

--- A second look at a packet, which belongs to `line`; `surprise`: something is not as it was taken. `read(state, ...)`
-- reads it. Returns the state that it is to be shown from: `first`, what was read at first; the state that was read
-- again, and whether its end is not known yet; or nil, where packets of several lines were mixed up and this one was
-- not read again.
function M.look(blind, first, number, line, surprise, read, ...)
  blind.only = blind.only or line
  blind.several = blind.several or line ~= blind.only or surprise
  local last, complete = blind.last, M.is_complete(blind)
  if not complete and number == (blind.after[last] or last + 1) then
    read(blind.state, ...)
    blind.last = number
  end
  if not blind.several then
    return first, false
  elseif number <= blind.last then
    return blind.state, not complete
  end
  return nil, false
end

return M
