-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Who speaks, by the address byte (paper 2.2; docs/records.md 5). Pure Lua, no Wireshark.

local M = {}

--- Board that a request names, or that replies; nil where it is not known.
function M.board(address)
  if address >= 0x40 and address <= 0x4F then
    return address - 0x3F
  elseif address >= 0x01 and address <= 0x10 then
    return address
  end
  return nil
end

return M
