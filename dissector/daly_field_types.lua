-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- How a field is declared: its short name in the Lua, its name as people type it, and a maker that knows its type. The
-- tables of fields (daly_fields*.lua) are written with these.

local M = {}

-- How sure each reading is, by name, where its description does not tell: see daly_fields.lua.
M.SURE = {}

local function sure(abbreviation, description)
  if description:sub(-1) == "]" then
    return description
  end
  local word = M.SURE[abbreviation]
    or description:find("generated", 1, true) and "generated"
    or (description:find("V1.2", 1, true) or description:find("vendor's article", 1, true)) and "documented"
  return word and description .. " [" .. word .. "]" or description
end

--- Begin a table of fields. Returns { fields =, by short name, list =, as Wireshark wants them, add =, a function of
--- short name, name and maker }.
function M.new()
  local fields, list = {}, {}
  local function add(short, abbreviation, make)
    local field = make("daly." .. abbreviation)
    fields[short] = field
    fields[abbreviation] = fields[abbreviation] or field -- tables of facts name fields as people type them
    list[#list + 1] = field
  end
  return { fields = fields, list = list, add = add }
end

function M.plain(make, name, description)
  return function(abbreviation)
    return make(abbreviation, name, base.DEC, nil, nil, sure(abbreviation, description))
  end
end

function M.hex(make, name, description, values)
  return function(abbreviation)
    return make(abbreviation, name, base.HEX, values, nil, sure(abbreviation, description))
  end
end

function M.number(name, description)
  return M.plain(ProtoField.uint8, name, description)
end

function M.named(name, values, description)
  return function(abbreviation)
    return ProtoField.uint8(abbreviation, name, base.DEC, values, nil, sure(abbreviation, description))
  end
end

function M.double(name, description)
  return function(abbreviation)
    -- The short constructor's arguments differ between versions.
    return ProtoField.new(name, abbreviation, ftypes.DOUBLE, nil, base.NONE, nil, sure(abbreviation, description))
  end
end

function M.text(name, description)
  return function(abbreviation)
    return ProtoField.new(name, abbreviation, ftypes.STRING, nil, base.NONE, nil, sure(abbreviation, description))
  end
end

function M.bytes(name, description)
  return function(abbreviation)
    return ProtoField.bytes(abbreviation, name, base.NONE, sure(abbreviation, description))
  end
end

function M.boolean(name, description)
  return function(abbreviation)
    return ProtoField.bool(abbreviation, name, base.NONE, nil, nil, sure(abbreviation, description))
  end
end

function M.packet(name, kind, description)
  return function(abbreviation)
    return ProtoField.framenum(abbreviation, name, base.NONE, kind, nil, sure(abbreviation, description))
  end
end

return M
