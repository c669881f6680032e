-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Statistics: tshark -q -z daly,stat[,filter]   -z daly,cells[,filter]   -z daly,faults[,filter]
-- and the same as windows of Wireshark: Tools, Daly BMS.
--
-- While somebody asks, daly_view hands on every record that it shows; a listener tells whether the filter lets its
-- packet through. Each report counts, and writes its text when it is drawn.

local view = require("daly_view")

local M = {}

local REPORTS = {
  { name = "stat", title = "Requests and replies", make = require("daly_stat_exchange").new },
  { name = "cells", title = "Cells and sensors", make = require("daly_stat_cells").new },
  { name = "faults", title = "Faults", make = require("daly_stat_faults").new },
}

-- Records of the packet at hand: { kind, raw, slot, values, results, ... } flat, five a record.
local shown, count, shown_of, taken = {}, 0, nil, true

local function collect(number, kind, raw, slot, values, results)
  if taken or number ~= shown_of then
    shown_of, count, taken = number, 0, false
  end
  shown[count + 1], shown[count + 2], shown[count + 3] = kind, raw, slot or false
  shown[count + 4], shown[count + 5] = values or false, results
  count = count + 5
end

-- Rows are of a board's number, which each bus of a capture may have.
local function words_of_buses(captures)
  local buses = 0
  for results in pairs(captures) do
    buses = buses + #results.buses
  end
  if buses < 2 then
    return ""
  end
  return ("%d buses; which of them a board is of, only a filter tells\n"):format(buses)
end

-- A listener that feeds a report; `draw(text)` is called when it is to be shown. Raises an error for a bad filter.
local function listen(report, filter, draw)
  local listener = Listener.new("frame", filter ~= "" and filter or nil)
  local counted = report.make()
  local captures = {} -- results of the records that were counted
  view.count(collect)
  function listener.packet(pinfo)
    if shown_of ~= pinfo.number then
      return
    end
    for i = 1, count, 5 do
      counted:record(pinfo, shown[i], shown[i + 1], shown[i + 2], shown[i + 3], shown[i + 4])
      captures[shown[i + 4]] = true
    end
    taken = true -- the next record, of the same packet too, is of a new look
  end
  function listener.draw()
    draw(words_of_buses(captures) .. counted:text())
  end
  function listener.reset()
    counted, captures, taken = report.make(), {}, true
  end
  return listener
end

local function heading(report, filter)
  local text = "Daly BMS: " .. report.title .. (filter ~= "" and ", filter: " .. filter or "")
  return text .. "\n" .. ("="):rep(#text) .. "\n"
end

-- Windows -----------------------------------------------------------------------------------------

local function open_window(report, filter)
  local window = TextWindow.new("Daly BMS: " .. report.title)
  local made, listener = pcall(listen, report, filter, function(text)
    window:set(heading(report, filter) .. text)
  end)
  if not made then
    window:set("This filter can't be used: " .. filter)
    return
  end
  window:set_atclose(function()
    listener:remove()
  end)
  window:add_button("Filter ...", function()
    new_dialog("Daly BMS: " .. report.title, function(text)
      open_window(report, text or "")
    end, "Filter (such as daly.board == 2)")
  end)
  window:add_button("Refresh", function()
    retap_packets()
  end)
  retap_packets()
end

-- End the program as Wireshark's own statistics do, when what stands behind -z can't be used.
local function refuse(argument, why)
  io.stderr:write(("-z %s: %s\n"):format(argument, why))
  os.exit(1)
end

--- Make the commands and the menu; once (some versions load each module twice).
function M.register()
  for i = 1, #REPORTS do
    local report = REPORTS[i]
    local word = "daly," .. report.name
    register_stat_cmd_arg(word, function(argument)
      local comma, filter = argument:match("^(,?)(.*)", #word + 1)
      if comma == "" and filter ~= "" then -- such as daly,stats
        refuse(argument, "it is " .. word .. ", or " .. word .. ",FILTER")
      end
      local made, problem = pcall(listen, report, filter, function(text)
        print(heading(report, filter) .. text)
      end)
      if not made then
        refuse(argument, tostring(problem):match("([^\n]*)%s*$"))
      end
    end)
    if gui_enabled() then
      register_menu("Daly BMS/" .. report.title, function()
        open_window(report, "")
      end, MENU_TOOLS_UNSORTED)
    end
  end
end

return M
