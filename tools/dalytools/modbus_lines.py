# SPDX-License-Identifier: GPL-2.0-or-later
"""A Modbus frame in words, for ``dalyshark decode``: who, what, values, what is odd about it (docs/wires.md 1)."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from dalytools.named_values import named

if TYPE_CHECKING:
    from dalyref.values import Fields, Value

REPLY: Final = 2
_READ, _WRITE_ONE, _WRITE_MANY, _REFUSES = 0x03, 0x06, 0x10, 0x80
_CELL_13: Final = 0x000C
_MOST_RAW = 8
_ONE_CELL: Final = re.compile(r"daly\.cell\.\d\d")

_OWN: Final = frozenset(
    (
        "daly.kind",
        "daly.transport",
        "daly.dialect",
        "daly.direction",
        "daly.board",
        "daly.request_in",
        "daly.reply_in",
        "daly.response_time",
        "daly.unanswered",
        "daly.unasked",
        "daly.late_to",
        "daly.write",
        "daly.write_result",
        "daly.changed",
        "daly.changed_from",
        "daly.contradiction",
        "daly.contradicts",
        "daly.fault_raised",
        "daly.fault_cleared",
        "daly.fault_count",
        "daly.fault_code",
        "daly.cells.voltage",
        "daly.cells.average",
        "daly.cells.min_number",
        "daly.cells.max_number",
        "daly.sensors.temperature",
        "daly.sensors.average",
        "daly.sensors.min_number",
        "daly.sensors.max_number",
        "daly.pack.current_raw",
    )
)
"""Fields that a line tells otherwise, or leaves out."""


def said(fields: Fields, *, overdue: bool = False) -> tuple[str, str, str, str]:
    """Return who, what, values and warnings of one frame. overdue: its reply would have come by now."""
    reply = fields["daly.direction"] == REPLY
    board = fields.get("daly.board")
    unit = f"board {board}" if board else "D2"
    function = _number(fields, "daly.modbus.function")
    register = fields.get("daly.modbus.register")
    start = f" {register:04X}" if isinstance(register, int) else ""
    count = fields.get("daly.modbus.count")
    size = f" x {count}" if isinstance(count, int) else ""
    warnings = _warnings(fields, reply=reply, overdue=overdue)
    if "daly.modbus.exception" in fields:
        refused = "read" if function == _REFUSES + _READ else "write"
        return unit, f"refuses a {refused}", f"code {_number(fields, 'daly.modbus.exception'):02X}", warnings
    if function == _READ:
        what = f"read{start}{size}" + ("" if reply else "?")
    else:
        what = f"{'' if reply else 'WRITE '}{'wrote' if reply else 'to'}{start}{size}"
    who = unit if reply else f"host > {unit}"
    return who, what, _values(fields, reply=reply), warnings


def _values(fields: Fields, *, reply: bool) -> str:
    shown: list[str] = []
    for name, value in fields.items():
        if name in _OWN or name.startswith("daly.modbus.") or _ONE_CELL.fullmatch(name):
            continue
        if name.startswith("daly.fault."):
            if value is True:
                shown.append(name.removeprefix("daly.fault."))
            continue
        shown.append(named(name, value, fields))
    raw = [f"{number:04X}" for number in _all(fields.get("daly.modbus.value", [])) if isinstance(number, int)]
    if not shown and raw:
        shown.append(" ".join(raw[:_MOST_RAW]) + (f" ... {len(raw)} registers" if len(raw) > _MOST_RAW else ""))
    if reply and "daly.response_time" in fields:
        shown.append(f"({float(str(fields['daly.response_time'])) * 1000:.0f} ms)")
    return "  ".join(shown)


def _warnings(fields: Fields, *, reply: bool, overdue: bool) -> str:
    warnings: list[str] = []
    if not reply:
        if "daly.reply_in" not in fields and (overdue or "daly.unanswered" in fields):
            warnings.append("no reply")
        register, count = fields.get("daly.modbus.register"), fields.get("daly.modbus.count", 1)
        if (
            "daly.write" in fields
            and fields["daly.dialect"] == "d2"
            and isinstance(register, int)
            and isinstance(count, int)
            and register <= _CELL_13 < register + count
        ):
            warnings.append("000C is cell 13, not the switch that the article's example takes it for: nothing switches")
        return ", ".join(warnings)
    if "daly.modbus.ambiguous" in fields:
        warnings.append("two requests fit: its registers can't be named")
    if "daly.modbus.assumed" in fields:
        warnings.append("request not seen, register taken from the values")
    if result := fields.get("daly.write_result"):
        warnings.append(f"write {result}")
    if late := fields.get("daly.late_to"):
        warnings.append(f"late, asked in {late}")
    elif "daly.unasked" in fields:
        warnings.append("nobody asked")
    for name, word in (("daly.changed", "changed"), ("daly.fault_raised", "came"), ("daly.fault_cleared", "went")):
        if name in fields:
            warnings.append(f"{word}: {' '.join(map(str, _all(fields[name])))}")
    for name, number in zip(
        _all(fields.get("daly.contradiction", [])), _all(fields.get("daly.contradicts", [])), strict=False
    ):
        warnings.append(f"{name} contradicts {number}")
    return ", ".join(warnings)


def _all(value: Value | list[Value]) -> list[Value]:
    return value if isinstance(value, list) else [value]


def _number(fields: Fields, name: str) -> int:
    value = fields[name]
    return value if isinstance(value, int) else -1
