# SPDX-License-Identifier: GPL-2.0-or-later
"""What a capture holds, in a few lines for people: records, boards, IDs, cells, faults, response times."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from dalyref.decoder import Decoded
    from dalyref.values import Fields

REQUEST, REPLY, ECHO = 1, 2, 3


@dataclass(slots=True)
class _Span:
    """Smallest, largest and mean of what was added."""

    count: int = 0
    total: float = 0.0
    low: float = 0.0
    high: float = 0.0

    def add(self, value: float) -> None:
        self.low = value if not self.count else min(self.low, value)
        self.high = value if not self.count else max(self.high, value)
        self.count += 1
        self.total += value


@dataclass(slots=True)
class _BoardSeen:
    ids: Counter[int] = field(default_factory=Counter[int])
    wait: _Span = field(default_factory=_Span)
    newest: dict[str, object] = field(default_factory=dict[str, object])
    faults: dict[str, None] = field(default_factory=dict[str, None])


_PACK = ("daly.pack.voltage", "daly.pack.current", "daly.soc")
_CELLS = ("daly.cells.count", "daly.cells.min", "daly.cells.max", "daly.cells.average", "daly.cells.spread")
_STATES = {0: "stationary", 1: "charging", 2: "discharging"}
_FAULT = "daly.fault."


class Summary:
    """Counts along: ``add`` every record, then ``lines``."""

    def __init__(self) -> None:
        self.kinds: Counter[str] = Counter()
        self.records = 0
        self._boards: dict[int, _BoardSeen] = {}
        self._asked: Counter[tuple[int, int]] = Counter()  # requests by address, ID
        self._unanswered: Counter[tuple[int, int]] = Counter()
        self._echoes = self._retries = 0
        self._modbus: Counter[str] = Counter()
        self._foreign: Counter[str] = Counter()

    def add(self, record: Decoded) -> None:
        """Count one record."""
        self.records += 1
        self.kinds[record.kind] += 1
        fields = record.fields
        if record.kind is Kind.FOREIGN:
            self._foreign[str(fields["daly.foreign"])] += 1
        direction = fields.get("daly.direction")
        if "daly.modbus.function" in fields:
            self._modbus["reply" if direction == REPLY else "request"] += 1
            self._modbus["unanswered"] += "daly.unanswered" in fields
            self._modbus["exception"] += "daly.modbus.exception" in fields
        elif direction is None:
            return
        elif direction == REPLY and "daly.data_id" in fields:
            self._reply(fields)
        elif direction == ECHO:
            self._echoes += 1
        elif "daly.data_id" in fields:
            key = (_number(fields, _asked_name(fields)), _number(fields, "daly.data_id"))
            self._asked[key] += 1
            self._unanswered[key] += "daly.reply_in" not in fields
            self._retries += "daly.retry" in fields

    def _reply(self, fields: Fields) -> None:
        board = self._boards.setdefault(_number(fields, _speaker_name(fields)), _BoardSeen())
        board.ids[_number(fields, "daly.data_id")] += 1
        wait = fields.get("daly.response_time")
        if isinstance(wait, float):
            board.wait.add(wait)
        if "daly.pack.voltage" in fields:  # with the state that was known when the current was told
            board.newest["daly.pack.state"] = fields.get("daly.pack.state")
        for name in (*_PACK, *_CELLS):
            if name in fields:
                board.newest[name] = fields[name]
        if "daly.fault_count" in fields:
            for name, value in fields.items():
                if name.startswith(_FAULT) and value is True:
                    board.faults[name.removeprefix(_FAULT)] = None

    def lines(self) -> list[str]:
        """Say it, a line each."""
        kinds = ", ".join(f"{count} {_kind_name(kind)}" for kind, count in self.kinds.most_common())
        out = [f"Records      {self.records}: {kinds}" if self.records else "Records      none"]
        if self._modbus:
            out.append(
                f"Modbus       {counted(self._modbus['request'], 'request')}, "
                f"{self._modbus['unanswered']} unanswered, "
                f"{counted(self._modbus['reply'], 'reply', 'replies')}, "
                f"{counted(self._modbus['exception'], 'exception')}"
            )
        for name, count in self._foreign.items():
            out.append(f"Not Daly     {name}: {count}")
        out += self._requests()
        for address, board in sorted(self._boards.items()):
            out += _board_lines(address, board)
        return out

    def _requests(self) -> list[str]:
        if not self._asked:
            return []
        asked, unanswered = self._asked.total(), self._unanswered.total()
        retries, echoes = counted(self._retries, "retry", "retries"), counted(self._echoes, "echo", "echoes")
        text = f"Requests     {asked}, {unanswered} unanswered, {retries}, {echoes}"
        out = [text]
        if unanswered:
            worst = [(key, count) for key, count in self._unanswered.most_common(5) if count]
            listed = ", ".join(f"0x{data_id:02X} to 0x{address:02X}: {count}" for (address, data_id), count in worst)
            out.append(f"  unanswered {listed}")
        return out


def _board_lines(address: int, board: _BoardSeen) -> list[str]:
    name = f"Board {address}" if 1 <= address <= 16 else f"Board 0x{address:02X}"
    ids = " ".join(f"{data_id:02X}" for data_id in sorted(board.ids))
    out = [f"{name:<12} {counted(board.ids.total(), 'reply', 'replies')}; IDs {ids}"]
    newest = board.newest
    if "daly.pack.voltage" in newest:
        state = newest.get("daly.pack.state")
        doing = f" ({_STATES.get(state, f'state {state}')})" if isinstance(state, int) else ""
        out.append(
            f"  pack       {newest['daly.pack.voltage']:.1f} V  {newest['daly.pack.current']:.1f} A{doing}  "
            f"SOC {newest['daly.soc']:.1f} %"
        )
    if "daly.cells.count" in newest:
        out.append(
            f"  cells      {newest['daly.cells.count']}: {newest['daly.cells.min']} to {newest['daly.cells.max']} mV, "
            f"average {newest['daly.cells.average']:.0f} mV, spread {newest['daly.cells.spread']} mV"
        )
    if 0x98 in board.ids:
        out.append(f"  faults     {', '.join(board.faults) or 'none'}")
    wait = board.wait
    if wait.count:
        mean = wait.total / wait.count
        out.append(f"  response   {wait.low * 1000:.1f} to {wait.high * 1000:.1f} ms, mean {mean * 1000:.1f} ms")
    return out


def _kind_name(kind: str) -> str:
    return {"frame": "good", "bad_checksum": "bad checksum", "short": "cut off"}.get(kind, kind)


def _speaker_name(fields: Fields) -> str:
    return "daly.can.source" if "daly.can.source" in fields else "daly.address"


def _asked_name(fields: Fields) -> str:
    return "daly.can.destination" if "daly.can.source" in fields else "daly.address"


def _number(fields: Fields, name: str) -> int:
    value = fields[name]
    return value if isinstance(value, int) else -1
