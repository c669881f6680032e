# SPDX-License-Identifier: GPL-2.0-or-later
"""The values of the selected board: pack, switches, temperatures, fault lamps, balancing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools.dashboard.told import FAULT, STATES
from dalytools.dashboard.words import OLD, STALE_S, Value, aged, flow, said, span
from dalytools.no_sensor import NO_SENSOR
from dalytools.record_lines import STATES as DOING

if TYPE_CHECKING:
    from rich.text import Text

    from dalytools.dashboard.glyphs import Glyphs
    from dalytools.dashboard.told import BoardTold

_CAME: Final = "bold red"
_SWITCHES: Final = {
    "daly.mos.charge": "charge",
    "daly.mos.discharge": "discharge",
    "daly.mos.precharge": "precharge",
    "daly.heater": "heater",
    "daly.fan": "fan",
}
_LAMPS: Final = (  # what stands at it, how its faults' names begin
    ("cell V", ("cell_volt_", "cell_high", "cell_low", "cell_difference", "diff_volt")),
    ("pack V", ("sum_volt_high", "sum_volt_low", "pack_high", "pack_low", "charge_undervolt", "discharge_overvolt")),
    ("chg temp", ("chg_temp_", "charge_temp_")),
    ("dis temp", ("dischg_temp_", "discharge_temp_", "diff_temp", "temp_difference")),
    ("chg A", ("chg_overcurrent", "charge_current")),
    ("dis A", ("dischg_overcurrent", "discharge_current")),
    ("SOC", ("soc_",)),
    ("MOS", ("chg_mos", "dischg_mos", "precharge", "mos_temp")),
    ("short", ("short_circuit",)),
    ("other", ("",)),
)


def pack_lines(board: BoardTold, width: int, now: float, glyphs: Glyphs) -> list[Text]:
    """Lay out a board's values, a line or more for each kind; of what was never told it is said."""
    kinds = (
        ("Pack", aged(_pack(board, width, glyphs), now)),
        ("MOS", aged(_switches(board, glyphs), now)),
        ("Temp.", aged(_temperatures(board), now)),
        ("Faults", _faults(board, now, glyphs)),
        ("Balance", aged(_balance(board), now)),
    )
    unknown = [said("not told yet", OLD)]
    return [text for label, pieces in kinds for text in flow(label, pieces or unknown, width)]


def _pack(board: BoardTold, width: int, glyphs: Glyphs) -> list[Value]:
    told = board.told
    voltage, current, soc = (told.get(f"daly.{name}") for name in ("pack.voltage", "pack.current", "soc"))
    left, power, state = (told.get(f"daly.{name}") for name in ("remaining_capacity", "power", "state"))
    values: list[Value] = []
    if voltage:
        values.append(Value(voltage, f"{voltage.number:.1f} V", "bold"))
    if current:
        values.append(Value(current, f"{current.number:.1f} A", "bold"))
    if state:
        doing = DOING.get(int(state.number), f"state {state.number:.0f}")
        values.append(Value(state, doing, {1: "green", 2: "cyan"}.get(int(state.number), "")))
    if power:
        values.append(Value(power, f"{power.number:.0f} W"))
    elif voltage and current and voltage.at == current.at:  # of one reply
        values.append(Value(current, f"{voltage.number * current.number:.0f} W"))
    if soc:
        length = 12 if width >= 100 else 6
        filled = max(0, min(2 * length, round(soc.number / 100 * 2 * length)))
        bar = (glyphs.full * (filled // 2) + glyphs.half * (filled % 2)).ljust(length, glyphs.empty)
        values.append(Value(soc, f"SOC {bar} {soc.number:.1f} %", "green" if soc.number >= 20 else "yellow"))
    if left:
        values.append(Value(left, f"{left.number / 1000:.1f} Ah left"))
    return values


def _switches(board: BoardTold, glyphs: Glyphs) -> list[Value]:
    told = board.told
    values: list[Value] = []
    for name, what in _SWITCHES.items():
        if switch := told.get(name):
            on = bool(switch.number)
            sign = glyphs.on if on else glyphs.off
            values.append(Value(switch, f"{sign} {what} {'on' if on else 'off'}", "green" if on else "yellow"))
    for name in ("charger", "load"):
        if there := told.get(f"daly.{name}"):
            values.append(Value(there, name if there.number else f"no {name}"))
    for name in sorted(STATES):
        if (state := told.get(name)) and state.value is True:
            values.append(Value(state, name.removeprefix(FAULT).replace("_", " "), "yellow"))
    if cycles := told.get("daly.cycles"):
        values.append(Value(cycles, f"{cycles.number:.0f} cycles"))
    return values


def _temperatures(board: BoardTold) -> list[Value]:
    told = board.told
    values: list[Value] = []
    if sensors := told.get("daly.sensors.temperature"):
        for number, value in enumerate(sensors.all, 1):
            values.append(Value(sensors, f"{number}: none" if value in NO_SENSOR else f"{number}: {value} C"))
    elif (low := told.get("daly.temperature.min")) and (high := told.get("daly.temperature.max")):
        there = [f"{one.number:.0f}" for one in (low, high) if one.number not in NO_SENSOR]
        values.append(Value(high, f"{' to '.join(there)} C" if there else "no sensor"))
    for name, what in (("mos", "MOS"), ("board", "board"), ("heater", "heater")):
        if value := told.get(f"daly.temperature.{name}"):
            values.append(Value(value, f"{what}: {value.number:.0f} C"))
    return values


def _faults(board: BoardTold, now: float, glyphs: Glyphs) -> list[Text]:
    """Return lamps, then the names of the faults that stand. A digit in a lamp is the higher level of its faults."""
    at = board.faults_at()
    standing = board.faults()
    old = at is not None and now - at > STALE_S
    pieces: list[Text] = []
    for what, mine in _lamps(standing):
        if at is None:
            pieces.append(said(f"{glyphs.unknown} {what}", OLD))
        elif mine:
            level = max((name[-1] for name in mine if name[-2:-1] == "_" and name[-1].isdigit()), default=" ")
            pieces.append(said(f"{glyphs.on}{level}{what}", OLD if old else _CAME))
        else:
            pieces.append(said(f"{glyphs.off} {what}", OLD if old else "green"))
    pieces += [said(name, OLD if old else _CAME) for name in standing]
    if at is not None and old:
        pieces.append(said(f"({span(now - at)} old)", OLD))
    return pieces


def _lamps(standing: list[str]) -> list[tuple[str, list[str]]]:
    """Share out the faults to the lamps, each to the first that takes it."""
    left, lamps = list(standing), list[tuple[str, list[str]]]()
    for what, beginnings in _LAMPS:
        mine = [name for name in left if name.startswith(beginnings)]
        left = [name for name in left if name not in mine]
        lamps.append((what, mine))
    return lamps


def _balance(board: BoardTold) -> list[Value]:
    told = board.told
    mask, cells, state = (told.get(f"daly.balance.{name}") for name in ("mask", "cell", "state"))
    if cells and cells.all:
        listed = " ".join(map(str, cells.all))
        return [Value(cells, f"cell{'s' if len(cells.all) > 1 else ''} {listed}", "magenta")]
    if mask:
        return [Value(mask, "no cell")]
    return [Value(state, f"state {state.number:.0f}")] if state else []
