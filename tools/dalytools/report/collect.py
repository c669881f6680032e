# SPDX-License-Identifier: GPL-2.0-or-later
"""From decoded records to what a page shows. Memory does not grow with the capture."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.no_sensor import NO_SENSOR
from dalytools.report.quantiles import Quantiles
from dalytools.report.series import Counts, Series

if TYPE_CHECKING:
    from dalyref.decoder import Decoded
    from dalyref.values import Fields, Value

REQUEST, REPLY, ECHO = 1, 2, 3
NANO = 1_000_000_000
QUIET_S = 5.0
"""A pause as long as this is listed."""
_MOST_BOARDS = 64
_MOST_SPANS = 2000
_MOST_LISTED = 200
_FAULT = "daly.fault."

QUANTITIES = {
    "daly.pack.voltage": "voltage",
    "daly.pack.current": "current",
    "daly.soc": "soc",
    "daly.cells.spread": "spread",
    "daly.mos.charge": "charge MOS",
    "daly.mos.discharge": "discharge MOS",
    "daly.state": "state",
    "daly.power": "power",
    "daly.temperature.mos": "MOS",
    "daly.temperature.board": "board",
}
LISTS = {"daly.cells.voltage": "cell", "daly.sensors.temperature": "sensor"}


@dataclass(slots=True)
class Span:
    """A fault while it was there, s; `end` None: to the end."""

    name: str
    start: float
    end: float | None = None


@dataclass(slots=True)
class BoardSeen:
    """What one board told."""

    name: str
    series: dict[str, Series] = field(default_factory=dict[str, Series])
    """By quantity: the values of QUANTITIES, "cell 1" .., "sensor 1" ..."""
    faults: list[Span] = field(default_factory=list[Span])
    faults_left_out: int = 0
    standing: dict[str, Span] = field(default_factory=dict[str, Span])
    balancing: Counts = field(default_factory=Counts)
    """Names are cells' numbers, and "replies" how many replies there were."""
    newest: dict[str, object] = field(default_factory=dict[str, object])

    def add(self, name: str, time: float, value: float) -> None:
        """Take one value of a quantity."""
        series = self.series.get(name)
        if series is None:
            series = self.series[name] = Series()
        series.add(time, value)


@dataclass(slots=True)
class Asked:
    """What was asked of a board by one data ID or register."""

    requests: int = 0
    unanswered: int = 0
    retries: int = 0
    echoes: int = 0
    replies: int = 0
    response: Quantiles = field(default_factory=Quantiles)


class Collected:
    """Takes record after record; then holds what a page shows. All times are in seconds from the first record."""

    def __init__(self) -> None:
        self.records = 0
        self.kinds: Counter[str] = Counter()
        self.transports: Counter[str] = Counter()
        self.dialects: Counter[str] = Counter()
        self.boards: dict[str, BoardSeen] = {}
        self.boards_left_out = 0
        self.asked: dict[tuple[str, str], Asked] = {}
        self.over_time = Counts()
        self.response = Series()
        self.events: list[tuple[float, str]] = []
        self.events_left_out = 0
        self.pauses: list[tuple[float, float]] = []
        """When each began, and how long it was; the longest."""
        self.begin_ns = 0
        """Of the first record; `start` is below 0 where a clock went back behind it."""
        self.start = self.end = 0.0

    def add(self, record: Decoded) -> None:
        """Take the next record."""
        if not self.records:
            self.begin_ns = record.time_ns
        time = (record.time_ns - self.begin_ns) / NANO
        self.records += 1
        kind = record.kind.value
        self.kinds[kind] += 1
        self.over_time.add(time, (kind,))
        self._pause(time)
        self.start, self.end = min(self.start, time), max(self.end, time)
        fields = record.fields
        self.transports[str(fields.get("daly.transport", ""))] += 1
        if record.kind is Kind.EVENT:
            self._event(time, record.comment)
        if "daly.dialect" in fields:
            self.dialects[str(fields["daly.dialect"])] += 1
        direction = fields.get("daly.direction")
        if direction is None:
            return
        key = (_board_name(fields), _what(fields))
        asked = self.asked.get(key)
        if asked is None:
            if len(self.asked) >= _MOST_SPANS:
                return
            asked = self.asked[key] = Asked()
        if direction == REPLY:
            self._reply(time, fields, asked, key[0])
        elif direction == ECHO:
            asked.echoes += 1
        else:
            asked.requests += 1
            asked.unanswered += "daly.unanswered" in fields
            asked.retries += "daly.retry" in fields

    def finish(self) -> None:
        """Take the end of the capture."""
        self.pauses.sort()

    def _pause(self, time: float) -> None:
        if time - self.end >= QUIET_S:
            self.pauses.append((self.end, time - self.end))
            if len(self.pauses) > 2 * _MOST_LISTED:
                self.pauses.sort(key=lambda pause: -pause[1])
                del self.pauses[_MOST_LISTED:]

    def _event(self, time: float, text: str) -> None:
        if len(self.events) < _MOST_LISTED:
            self.events.append((time, text))
        else:
            self.events_left_out += 1

    def _reply(self, time: float, fields: Fields, asked: Asked, name: str) -> None:
        asked.replies += 1
        wait = fields.get("daly.response_time")
        if isinstance(wait, float):
            asked.response.add(wait)
            self.response.add(time, wait * 1000)
        board = self.boards.get(name)
        if board is None:
            if len(self.boards) >= _MOST_BOARDS:
                self.boards_left_out += 1
                return
            board = self.boards[name] = BoardSeen(name)
        for field_name, quantity in QUANTITIES.items():
            value = fields.get(field_name)
            if isinstance(value, int | float):
                board.add(quantity, time, float(value))
        for field_name, what in LISTS.items():
            if field_name in fields:
                for number, value in enumerate(_all(fields, field_name), 1):
                    if isinstance(value, int | float) and not (what == "sensor" and value in NO_SENSOR):
                        board.add(f"{what} {number}", time, float(value))
        if "daly.fault_count" in fields:
            _take_faults(board, time, fields)
        if "daly.balance.mask" in fields:
            cells = tuple(str(cell) for cell in _all(fields, "daly.balance.cell"))
            board.balancing.add(time, ("replies", *cells))
        for text in ("daly.software_version", "daly.hardware_version", "daly.battery_code"):
            if text in fields:
                board.newest[text] = _all(fields, text)[0]


def _take_faults(board: BoardSeen, time: float, fields: Fields) -> None:
    """Note which faults came, and which went."""
    there = {name.removeprefix(_FAULT) for name, value in fields.items() if name.startswith(_FAULT) and value is True}
    for name in [name for name in board.standing if name not in there]:
        board.standing.pop(name).end = time
    for name in sorted(there - board.standing.keys()):
        span = board.standing[name] = Span(name, time)
        if len(board.faults) < _MOST_SPANS:
            board.faults.append(span)
        else:
            board.faults_left_out += 1


def _all(fields: Fields, name: str) -> list[Value]:
    value = fields.get(name, [])
    return value if isinstance(value, list) else [value]


def _board_name(fields: Fields) -> str:
    board = fields.get("daly.board")
    if isinstance(board, int):
        return f"board {board}"
    if fields.get("daly.dialect") == "d2":
        return "D2"
    return "any board" if fields.get("daly.direction") == REQUEST else "no board"


def _what(fields: Fields) -> str:
    data_id = fields.get("daly.data_id")
    if isinstance(data_id, int):
        return f"0x{data_id:02X}"
    register = fields.get("daly.modbus.register")
    if isinstance(register, int):
        return f"register {register:04X}"
    register = fields.get("daly.can.register")
    return f"CAN register {register:04X}" if isinstance(register, int) else "?"
