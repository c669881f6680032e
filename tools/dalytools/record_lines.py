# SPDX-License-Identifier: GPL-2.0-or-later
"""One line a record, for people: number, time of day, who, what, values with units, warnings.

1  10:00:00.000  host 40 > board 1  90 pack?
2  10:00:00.050  board 1            90 pack      52.8 V  0.0 A  SOC 50.0 %  (36 ms)
3  10:00:00.200  host 40 > board 1  91 extremes?                              ! no reply
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from dalyref import texts
from dalyref.kinds import Kind
from dalytools import modbus_lines
from dalytools.named_values import named, of_battery
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalyref.decoder import Decoded
    from dalyref.values import Fields, Value

NAMES = {
    0x00: "restart",
    0x21: "set clock, SOC",
    0x50: "rated capacity",
    0x51: "boards",
    0x52: "totals",
    0x53: "battery",
    0x54: "firmware index",
    0x55: "manufacturer",
    0x56: "battery name",
    0x57: "battery code",
    0x58: "production date",
    0x59: "cell limits",
    0x5A: "pack limits",
    0x5B: "current limits",
    0x5C: "temp. limits",
    0x5D: "SOC limits",
    0x5E: "differences",
    0x5F: "balancing",
    0x60: "short circuit",
    0x61: "clock",
    0x62: "software version",
    0x63: "hardware version",
    0x64: "fault log",
    0x65: "board number",
    0x66: "heater, fan",
    0x67: "balancer",
    0x68: "balance set-up",
    0x69: "inverter",
    0x6A: "serial number",
    0x90: "pack",
    0x91: "cell extremes",
    0x92: "temp. extremes",
    0x93: "MOS, capacity",
    0x94: "status",
    0x95: "cells",
    0x96: "temperatures",
    0x97: "balance",
    0x98: "faults",
    0xD8: "wake-up source",
    0xD9: "discharge MOS",
    0xDA: "charge MOS",
}
"""Data IDs: the vendor's paper V1.2 section 3, and what devices answer besides (field notes, a.2 and a.3)."""

STATES = {0: "stationary", 1: "charging", 2: "discharging"}
_TROUBLE = {
    "daly.other_board": "another board than was asked",
    "daly.burst.repeat": "the same part again",
    "daly.burst.cut_off": "cut off here",
}
_UNREAD = frozenset(("temp_high", "temp_low"))
"""Classes of the alarm grid whose bytes nobody is sure of (docs/protocol.md)."""
_FILLERS = frozenset((bytes(8), b"\xaa" * 8, b""))
_MOST_BYTES = 32
_MOST_COMMENT = 300


@dataclass(frozen=True, slots=True)
class Line:
    """The parts of a line. Nothing in it can steer a terminal."""

    number: int
    time: str
    who: str
    what: str
    values: str
    warnings: str
    kind: str
    """request, reply, echo, modbus, or the record's kind: what a colour can hang on."""

    def __str__(self) -> str:
        return "".join(self.pieces()).rstrip()

    def pieces(self) -> tuple[str, str, str, str, str]:
        """Return number and time, who, what, values, warnings, each filled up to its column."""
        return (
            f"{self.number:>6}  {self.time}  ",
            f"{self.who:<19}",
            f"{self.what:<21} ",
            f"{self.values}  " if self.values else "",
            f"! {self.warnings}" if self.warnings else "",
        )


def line(record: Decoded, *, overdue: bool = False) -> Line:
    """Say in a line what a record is. overdue: its reply would have come by now."""
    fields = record.fields
    values = warnings = ""
    kind = record.kind.value
    who, what = "", kind.replace("_", " ")
    match record.kind:
        case Kind.FRAME if fields["daly.dialect"] == "a5":
            kind, who, what, values, warnings = _a5(record, overdue=overdue)
        case Kind.FRAME if fields["daly.dialect"] == "hkms":
            kind, who, what, values, warnings = _hkms(record)
        case Kind.FRAME:
            kind = "modbus"
            who, what, values, warnings = modbus_lines.said(fields, overdue=overdue)
        case Kind.BAD_CHECKSUM:
            who, what = f"address {record.data[1]:02X}", f"{record.data[2]:02X} damaged"
            values, warnings = _hex(record.data[4:12]), f"checksum {record.data[12]:02X} is wrong"
        case Kind.SHORT:
            values, warnings = _hex(record.data), "cut off"
        case Kind.JUNK:
            values = _hex(record.data)
        case Kind.FOREIGN:
            what, values = str(fields["daly.foreign"]), _hex(record.data)
        case Kind.EVENT:
            values = plain(record.comment[:_MOST_COMMENT])
    return Line(record.number, _time(record.time_ns), who, what, values, warnings, kind)


def _time(time_ns: int) -> str:
    seconds, nanos = divmod(time_ns, 1_000_000_000)
    try:
        day = datetime.fromtimestamp(seconds).astimezone()
    except (OverflowError, OSError, ValueError):  # a time stamp that no calendar has
        return "--:--:--.---"
    return f"{day:%H:%M:%S}.{nanos // 1_000_000:03d}"


def _hex(data: bytes) -> str:
    shown = data[:_MOST_BYTES].hex(" ")
    return f"{shown} ... {len(data)} bytes" if len(data) > _MOST_BYTES else shown


def _listed(fields: Fields, name: str) -> list[Value]:
    value = fields.get(name, [])
    return value if isinstance(value, list) else [value]


def _number(fields: Fields, name: str) -> int:
    value = fields[name]
    return value if isinstance(value, int) else -1


def _words(fields: Fields, name: str) -> str:
    return " ".join(str(value) for value in _listed(fields, name))


def _a5(record: Decoded, *, overdue: bool) -> tuple[str, str, str, str, str]:
    fields = record.fields
    data_id, content = _number(fields, "daly.data_id"), bytes.fromhex(str(fields.get("daly.data", "")))
    address = _number(fields, "daly.can.source" if record.transport == "can" else "daly.address")
    what = f"{data_id:02X} {NAMES.get(data_id, '')}".rstrip()
    board = fields.get("daly.board")
    warnings: list[str] = []
    if fields["daly.direction"] != 2:
        who = f"host {address:02X}" + (f" > board {board}" if board else "")
        values = of_battery(fields) or ("" if content in _FILLERS and "daly.write" not in fields else _hex(content))
        if fields["daly.direction"] == 3:
            return "echo", who, what, values, "echo: the battery sleeps, or the adapter hears itself"
        if "daly.retry" in fields:
            warnings.append("retry")
        if "daly.second_host" in fields:
            warnings.append("a second host asks")
        if "daly.reply_in" not in fields and (overdue or "daly.unanswered" in fields):
            warnings.append("no reply")
        asked = f"WRITE {what}" if "daly.write" in fields else f"{what}?"
        return "request", who, asked, values, ", ".join(warnings)
    who = f"board {board}" if board else f"address {address:02X}"
    told = _VALUES.get(data_id)
    if len(content) < 8:  # on CAN
        values, warnings = _hex(content), ["not eight bytes: no values"]
    elif told:
        values = told(fields)
    elif data_id in texts.FIELDS:
        whole = fields.get(texts.FIELDS[data_id])
        values = f"part {content[0]}: {fields['daly.text_part']}" + (f'  = "{whole}"' if whole else "")
    else:
        values = of_battery(fields) or _hex(content)
        if fields.get("daly.alarm.class") in _UNREAD:
            values += f"  {_hex(content)}"
    if "daly.response_time" in fields:
        values += f"  ({float(str(fields['daly.response_time'])) * 1000:.0f} ms)"
    if result := fields.get("daly.write_result"):
        warnings.append(f"write {result}")
    warnings += [words for name, words in _TROUBLE.items() if name in fields]
    if late := fields.get("daly.late_to"):
        warnings.append(f"late, asked in {late}")
    elif "daly.unasked" in fields:
        warnings.append("nobody asked")
    if missing := _words(fields, "daly.burst.missing"):
        warnings.append(f"missing part {missing}")
    if changed := _words(fields, "daly.changed"):
        warnings.append(f"changed: {changed}")
    for name, number in zip(_listed(fields, "daly.contradiction"), _listed(fields, "daly.contradicts"), strict=True):
        warnings.append(f"{name} contradicts {number}")
    if raised := _words(fields, "daly.fault_raised"):
        warnings.append(f"came: {raised}")
    if cleared := _words(fields, "daly.fault_cleared"):
        warnings.append(f"went: {cleared}")
    return "reply", who, what, values, ", ".join(warnings)


_HKMS_NAMES = {
    0x0400: "cells",
    0x0401: "temperatures",
    0x0402: "pack",
    0x0403: "power",
    0x0404: "cell extremes",
    0x0405: "temp. extremes",
    0x0406: "MOS",
    0x0407: "state",
    0x0408: "counts",
    0x0409: "fault info",
    0x040A: "balance",
    0x040B: "charge info",
    0x040C: "clock",
    0x040D: "limits",
    0x040E: "faults",
    0x182A: "charge MOS",
    0x182C: "discharge MOS",
    0x161E: "SOC",
    0x181E: "SOC",
}
_HKMS_OWN = ("daly.can.", "daly.kind", "daly.transport", "daly.dialect", "daly.direction", "daly.board", "daly.data")
"""Fields that a line tells otherwise, or leaves out."""


def _hkms(record: Decoded) -> tuple[str, str, str, str, str]:
    """Say what a frame of the HKMS dialect is: its values by their names, faults only those that are there."""
    fields = record.fields
    number, source = _number(fields, "daly.can.register"), _number(fields, "daly.can.source")
    board = fields.get("daly.board")
    name = f"{number:04X} {_HKMS_NAMES.get(number, '')}".rstrip()
    shown = [
        named(name, value, fields)
        for name, value in fields.items()
        if not name.startswith((*_HKMS_OWN, "daly.cell.0", "daly.cell.1", "daly.cell.2", "daly.cell.3", "daly.cell.4"))
        and name not in ("daly.reserved", "daly.write")
        and not (name.startswith(("daly.fault.", "daly.level.")) and not value)
    ]
    values = "  ".join(shown) or _hex(record.data)
    if fields["daly.direction"] == 1:
        who = f"host {source:02X}" + (f" > board {board}" if board else "")
        what = f"WRITE {name}" if "daly.write" in fields else "keep-alive"
        return "request", who, what, values if "daly.write" in fields else "", ""
    return "reply", f"board {board}", name, values, ""


def _pack(fields: Fields) -> str:
    text = f"{fields['daly.pack.voltage']} V  {fields['daly.pack.current']} A  SOC {fields['daly.soc']} %"
    state = fields.get("daly.pack.state")
    return text if state is None else f"{text}  {_state(state)}"


def _state(state: object) -> str:
    return STATES.get(state, f"state {state}") if isinstance(state, int) else ""


def _cell_extremes(fields: Fields) -> str:
    return (
        f"{fields['daly.cell.min_voltage']} mV (cell {fields['daly.cell.min_number']}) to "
        f"{fields['daly.cell.max_voltage']} mV (cell {fields['daly.cell.max_number']})"
    )


def _temperature_extremes(fields: Fields) -> str:
    return (
        f"{fields['daly.temperature.min']} C (sensor {fields['daly.temperature.min_number']}) to "
        f"{fields['daly.temperature.max']} C (sensor {fields['daly.temperature.max_number']})"
    )


def _mos(fields: Fields) -> str:
    def switch(name: str) -> str:
        return "on" if fields[name] else "off"

    return (
        f"{_state(fields['daly.state'])}  charge MOS {switch('daly.mos.charge')}  "
        f"discharge MOS {switch('daly.mos.discharge')}  {fields['daly.remaining_capacity']} mAh left"
    )


def _status(fields: Fields) -> str:
    pins = [name.upper() for kind in ("di", "do") for pin in "1234" if fields[f"daly.{(name := kind + pin)}"]]
    return "  ".join(
        (
            f"{fields['daly.cell_count']} cells",
            f"{fields['daly.sensor_count']} sensors",
            f"charger {fields['daly.charger']}",
            f"load {fields['daly.load']}",
            *pins,
            f"{fields['daly.cycles']} cycles",
        )
    )


def _cells(fields: Fields) -> str:
    cells = _words(fields, "daly.cell.voltage")
    text = f"part {fields['daly.frame_number']}: " + (f"{cells} mV" if cells else "no cells")
    if "daly.cells.count" in fields:
        text += (
            f"  = {fields['daly.cells.count']} cells {fields['daly.cells.min']} to {fields['daly.cells.max']} mV, "
            f"average {float(str(fields['daly.cells.average'])):.1f}, spread {fields['daly.cells.spread']}"
        )
    return text


def _temperatures(fields: Fields) -> str:
    sensors = _words(fields, "daly.temperature")
    return f"part {fields['daly.frame_number']}: " + (f"{sensors} C" if sensors else "no sensors")


def _balance(fields: Fields) -> str:
    cells = _words(fields, "daly.balance.cell")
    if not cells:
        return "no cell"
    active = fields["daly.balance.active_cell"]
    # 0 is none: there is nothing else that the bytes could mean.
    return f"cells {cells}" + (f"  (or, with an active balancer: cell {active})" if active else "")


_FAULT = "daly.fault."


def _faults(fields: Fields) -> str:
    named = [name.removeprefix(_FAULT) for name, on in fields.items() if on is True and name.startswith(_FAULT)]
    code = fields["daly.fault_code"]
    return "  ".join((*(named or ["none"]), *([f"code {code}"] if code else [])))


_VALUES: dict[int, Callable[[Fields], str]] = {
    0x90: _pack,
    0x91: _cell_extremes,
    0x92: _temperature_extremes,
    0x93: _mos,
    0x94: _status,
    0x95: _cells,
    0x96: _temperatures,
    0x97: _balance,
    0x98: _faults,
}
