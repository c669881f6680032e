-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- The short way to what Wireshark's objects tell. `pinfo.number` asks Lua for a way to look names up, that for the
-- function that reads the number, and this for the number; called by itself that function costs a third. They are kept
-- where all versions from 4.0 to 4.6 keep them; where they are not there, the long way serves.
--
--   local number_of = getters.attribute("Pinfo", "number")        number_of(pinfo)              is pinfo.number
--   local value_of = getters.operator("Field", "__call", call)    value_of(extractor)           is extractor()

local M = {}

local known, classes = pcall(function()
  return debug.getregistry()
end)

local function class_of(name)
  local class = known and type(classes) == "table" and rawget(classes, name)
  return type(class) == "table" and class or {}
end

--- The function that reads an attribute of the objects of a class.
function M.attribute(class, name)
  local all = rawget(class_of(class), "__getters")
  local getter = type(all) == "table" and rawget(all, name)
  return type(getter) == "function" and getter or function(object)
    return object[name]
  end
end

--- The function behind an operator ("__call", "__newindex") of the objects of a class; `long_way` does the same.
function M.operator(class, name, long_way)
  local found = rawget(class_of(class), name)
  return type(found) == "function" and found or long_way
end

return M
