-- SPDX-License-Identifier: GPL-2.0-or-later
--
-- Frames of CAN in the order of the capture: which are ours, and what they mean to each other (docs/wires.md 2).
-- A bus is an interface.
--
--   identifier --daly_can_ids--> shape --what was seen on this bus--> classic: daly_bus
--                                                                     HKMS: daly_hkms_bus
--                                                                     foreign, by name
--                                                                     not ours

local bus_module = require("daly_bus")
local results_module = require("daly_results")
local ids = require("daly_can_ids")
local classic = require("daly_can_classic")
local hkms_bus = require("daly_hkms_bus")

local M = {}

local feed_can, raw_of = bus_module.feed_can, classic.raw

local AMBIGUOUS = "HKMS or Deye"
local NOTHING = ("\0"):rep(8)

--- In found: a frame of HKMS.
M.HKMS = true

--- Everything known of one capture. `options`: see daly_streams.capture; `chosen`: the user said that it is Daly's.
function M.capture(options, chosen)
  local results = results_module.new()
  results.can = true
  return {
    options = options,
    chosen = chosen,
    results = results, -- by slot
    found = {}, -- by slot: M.HKMS, or a foreign frame's name; nil: classic where results has a link, else not ours
    buses = {}, -- by interface
    known = chosen, -- Daly was seen
  }
end

--- The user said that it is Daly's.
function M.choose(state)
  state.chosen, state.known = true, true
  for _, bus in pairs(state.buses) do
    bus.classic = true
  end
end

local function bus_of(state, key)
  local bus = state.buses[key]
  if not bus then
    local options, results = state.options, state.results
    local daly = bus_module.new(options, results)
    daly.can = true
    bus = {
      daly = daly,
      classic = state.chosen, -- a frame that tells Daly from others was seen
      alive = false, -- a keep-alive was seen
      hkms = hkms_bus.new(options, results),
    }
    state.buses[key] = bus
  end
  return bus
end

-- What a frame is on this bus: "classic", "hkms", a foreign name, or nil.
local function kind_of(bus, shape, data)
  if shape.writes and (bus.alive or shape.register == ids.SET_SOC and bus.classic) then
    return "hkms"
  elseif shape.classic and (shape.sure or bus.classic) then
    return "classic"
  elseif shape.keep_alive then
    if data == NOTHING then
      bus.alive = true
      return "hkms"
    end
    return nil
  elseif shape.streamed then
    return bus.alive and "hkms" or bus.classic and AMBIGUOUS or nil
  elseif shape.foreign and (bus.classic or bus.alive) then
    return shape.foreign
  end
  return nil
end

--- One frame, in the order of the capture, once: its `shape` (daly_can_ids), `data` (at most eight bytes), `time` in s.
-- Returns a classic frame in the form of an A5 frame.
function M.read(state, key, slot, number, shape, data, time)
  local bus = state.buses[key] or bus_of(state, key)
  local kind
  if not shape.sure then
    kind = kind_of(bus, shape, data)
    if not kind then
      return nil
    end
  end
  state.known = true
  if not kind or kind == "classic" then
    bus.classic = true
    local raw = raw_of(shape, data)
    feed_can(bus.daly, slot, number, raw, shape, #data, time)
    return raw
  end
  local results = state.results
  if time > results.latest then
    results.latest = time
  end
  if kind == "hkms" then
    state.found[slot] = M.HKMS
    hkms_bus.feed(bus.hkms, slot, number, shape, data, time)
  else
    state.found[slot] = kind
  end
  return nil
end

--- A frame that is not read: CAN FD, and remote standard frames.
function M.pass() end

return M
