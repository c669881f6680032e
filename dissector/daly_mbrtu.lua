-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Modbus of another maker on the same line: shown by Wireshark's own dissector as well (docs/wires.md 5).
--
-- What goes wrong in there is its own affair: it shows as that dissector shows it, and our records go on.

local foreign = require("daly_foreign")

local M = {}

-- Wireshark's dissector; false where it has none. Looked up when it is first needed.
local mbrtu

local busy = false -- Decode As may lead from there back to us

--- Show a foreign record in `parent`, frame by frame. `raw`: its bytes; they stand in `buffer` from offset on.
function M.show(parent, buffer, offset, raw, pinfo)
  if mbrtu == nil then
    local known, dissector = pcall(Dissector.get, "mbrtu")
    mbrtu = known and dissector or false
  end
  if not mbrtu or busy then
    return
  end
  busy = true
  for first, last in foreign.modbus_frames(raw) do
    pcall(mbrtu.call, mbrtu, buffer(offset + first - 1, last - first + 1):tvb(), pinfo, parent)
  end
  busy = false
end

return M
