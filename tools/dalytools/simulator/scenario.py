# SPDX-License-Identifier: GPL-2.0-or-later
"""What to simulate: one tree of plain values. Everything has a default, and the default is what real devices do.

Scenario
  boards: Board ...        which addresses, and for each
    pack: Pack             the battery behind it
    habits: Habits         how its firmware answers
    texts: Texts           what it says of itself
  host, other_hosts: Host  who polls, what and how often
  foreign: Foreign ...     who else is on the wire
  damage: Damage           what happens to bytes on the wire
  events: Event ...        what happens when

As a file: scenario_file.py.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from dalytools.simulator.chemistry import CHEMISTRIES
from dalytools.simulator.faults import FAULT_BITS
from dalytools.simulator.texts import Texts

Dialect = Literal["a5", "d2", "81"]
Writes = Literal["accept", "ignore", "pretend", "silent"]
Lie = Literal[
    "pack_voltage", "cell_max", "cell_min", "cell_number", "temperature_max", "temperature_min", "sensor_number", "soc"
]
Harm = Literal["drop", "flip", "insert", "cut", "collide"]
What = Literal[
    "sleep",
    "wake",
    "fault",
    "clear",
    "send",
    "silent",
    "late",
    "cut_burst",
    "skip_frame",
    "repeat_frame",
    "other_board",
    "contradict",
    "damage",
]
Reserved = Literal["stale", "zero", "ff"]
Asleep = Literal["", "echo", "silence"]

MAX_CELLS = 48  # paper, section 3, 0x95
MAX_SENSORS = 21  # paper, section 3, 0x96: 3 frames of 7
MAX_BOARDS = 16  # field notes b, parallel boards
HOST_BASE = 0x3F  # the host that asks board N writes 0x3F + N (field notes, fact 3)

PC_SOFTWARE_PLAN = (0x90, 0x91, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0xD8)  # field notes b, polling patterns


def _require(fine: bool, otherwise: str) -> None:
    if not fine:
        raise ValueError(otherwise)


@dataclass(frozen=True, slots=True)
class Phase:
    """A stretch of the load profile: so many amperes (+ charges the pack, - discharges it) for so many seconds."""

    current_a: float
    seconds: float


@dataclass(frozen=True, slots=True)
class Pack:
    """The battery: cells in series. ``speed`` 0 stands still, 1 is real time, 60 shows an hour in a minute."""

    cells: int = 16
    sensors: int = 2
    capacity_mah: int = 100_000
    start_soc: float = 62.5  # percent
    ambient_c: float = 21.0
    cycles: int = 37
    profile: tuple[Phase, ...] = (Phase(-32.0, 30), Phase(0.0, 10), Phase(25.0, 30), Phase(0.0, 10))
    ripple: float = 0.04  # of the current, changes every half second
    spread: float = 0.01  # of each cell's capacity and resistance, and of its charge at the start
    speed: float = 1.0
    chemistry: str = "lfp"
    production_date: tuple[int, int, int] = (2024, 3, 15)

    def __post_init__(self) -> None:
        _require(self.chemistry in CHEMISTRIES, f"chemistry {self.chemistry!r}: {', '.join(CHEMISTRIES)}")
        _require(1 <= self.cells <= MAX_CELLS, f"{self.cells} cells: a Daly board has 1 to {MAX_CELLS}")
        _require(1 <= self.sensors <= MAX_SENSORS, f"{self.sensors} sensors: a Daly board has 1 to {MAX_SENSORS}")
        _require(0 <= self.start_soc <= 100, f"a state of charge of {self.start_soc} %: must be 0 to 100")
        _require(self.capacity_mah > 0, f"a capacity of {self.capacity_mah} mAh: must be more than 0")
        _require(0 <= self.speed <= 3600, f"pack speed {self.speed}: must be 0 (stands still) to 3600")
        _require(all(phase.seconds > 0 for phase in self.profile), "a phase of the load profile must last some time")


@dataclass(frozen=True, slots=True)
class Habits:
    """How a board's firmware answers. The defaults are what most captures show (field notes, ten facts)."""

    frame_base: int = 1  # first frame number of 0x95, 0x96: 1 on every device seen, 0 in the paper (fact 1)
    reserved: Reserved = "stale"  # what stands in reserved bytes and unused slots (fact 2)
    sensor_frames: int = 1  # 0x96 has at least so many frames; 2 was seen for one sensor (fact 6)
    discharge_high: bool = True  # raw current above 30000 means discharge; False: means charge (fact 5)
    reply_ms: float = 37.0  # from the request's end to the reply's start: 50 ms for a whole exchange (field notes b)
    jitter_ms: float = 1.5
    echo_ms: float = 4.0  # a sleeping board gives the request back after
    zero_replies: int = 10  # replies that are all zero after waking up (field notes b, sleep)
    writes: Writes = "accept"  # ignore: answered with the old state; pretend: as if taken; silent: not answered
    unanswered: tuple[int, ...] = ()  # data IDs that this firmware does not know
    alarm_grid: bool = False  # whether it answers 70 to 8A (field notes a.2: one source; another board is silent)
    undocumented: bool = False  # whether it answers the made-up IDs of undocumented.py

    def __post_init__(self) -> None:
        _require(self.frame_base in {0, 1}, f"frame numbers from {self.frame_base}: must be 0 or 1")
        _require(self.reserved in {"stale", "zero", "ff"}, f"reserved bytes {self.reserved!r}: stale, zero or ff")
        _require(1 <= self.sensor_frames <= 3, f"{self.sensor_frames} frames of 0x96: must be 1 to 3")


@dataclass(frozen=True, slots=True)
class Board:
    """One BMS on the bus. Board N answers the host 0x3F+N; board 1 (so 0x40) also 0x80 (app) and 0x20 (GPRS)."""

    number: int = 1
    pack: Pack = field(default_factory=Pack)
    habits: Habits = field(default_factory=Habits)
    asleep: Asleep = ""
    faults: tuple[str, ...] = ()
    dialects: tuple[Dialect, ...] = ("a5",)  # some boards answer all three on one port (field notes e)
    texts: Texts = field(default_factory=Texts)

    def __post_init__(self) -> None:
        _require(bool(self.dialects), "a board speaks at least one dialect: a5, d2, 81")
        for dialect in self.dialects:
            _require(dialect in get_args(Dialect), f"dialect {dialect!r}: a5, d2 or 81")
        _require(1 <= self.number <= MAX_BOARDS, f"board {self.number}: boards are numbered 1 to {MAX_BOARDS}")
        _require(self.asleep in {"", "echo", "silence"}, f"asleep {self.asleep!r}: echo or silence")
        for name in self.faults:
            _require(
                name in FAULT_BITS, f"there is no fault {name!r}; such as cell_volt_high_level_1, short_circuit_protect"
            )


@dataclass(frozen=True, slots=True)
class Host:
    """Who polls. ``address`` None: each board by its own, 0x3F+N; else this one address only (A5 alone).

    A host that ``listens`` waits until the wire is free; one that does not speaks when its time has come, and what it
    says then is mixed with what is on the wire.
    """

    polls: bool = True
    address: int | None = None
    plan: tuple[int, ...] = PC_SOFTWARE_PLAN
    filler: int = 0x00  # the request's reserved bytes; some hosts send 0xAA (field notes b)
    gap_ms: float = 60.0  # from the end of a reply to the next request
    pause_ms: float = 0.0  # more of it after a whole plan
    timeout_ms: float = 500.0
    retries: int = 2
    name: str = "host"
    dialect: Dialect = "a5"
    reads: tuple[tuple[int, int], ...] = ()  # Modbus: (first register, count); none: what Daly's app reads
    boards: tuple[int, ...] = ()  # which boards it asks; none: all
    listens: bool = True
    start_s: float = 0.0
    stop_s: float = 0.0  # 0: never

    def __post_init__(self) -> None:
        for register, count in self.reads:
            fine = register >= 0 and register + count <= 0x10000 and 1 <= count <= 125
            _require(fine, f"a read of {count} registers from {register}: 1 to 125, from 0 to 65535")
        fine = self.address is None or 0x20 <= self.address <= 0xFF
        _require(
            fine, f"host address {self.address}: hosts have 0x20 to 0xff (0x40 RS-485, 0x80 app, 0x41 asks board 2)"
        )
        _require(bool(self.plan), "a host that polls needs at least one data ID")
        _require(self.gap_ms > 0 and self.timeout_ms > 0, "the host's gap and time-out must be more than 0 ms")


@dataclass(frozen=True, slots=True)
class Foreign:
    """Somebody else on the wire, who says the same thing again and again, and may be answered.

    data: on a serial line, or the payload of a CAN frame with ``can_id``; a CAN station is not heard on other wires.
    """

    data: bytes
    period_s: float = 1.0
    start_s: float = 0.0
    answer: bytes = b""
    answer_ms: float = 20.0
    can_id: int | None = None
    name: str = "foreign"

    def __post_init__(self) -> None:
        _require(self.period_s > 0, f"a period of {self.period_s} s: must be more than 0")
        if self.can_id is None:
            _require(0 < len(self.data) <= 256, "a foreign station says 1 to 256 bytes")
        else:
            _require(len(self.data) <= 8, "a CAN frame holds at most 8 bytes")
            _require(0 <= self.can_id < 1 << 29, f"CAN identifier {self.can_id}: 0 to 0x1fffffff")


@dataclass(frozen=True, slots=True)
class Damage:
    """Shares of frames (0..1 each, together at most 1) that the wire damages, in one of five ways."""

    drop: float = 0.0  # one to three bytes out of the middle are lost
    flip: float = 0.0  # one bit is wrong
    insert: float = 0.0  # one to four bytes that nobody sent
    cut: float = 0.0  # the end is missing
    collide: float = 0.0  # somebody speaks at the same time: both are lost from there on

    def __post_init__(self) -> None:
        rates = (self.drop, self.flip, self.insert, self.cut, self.collide)
        _require(min(rates) >= 0 and self.total <= 1, f"damage to {self.total} of the frames: must be 0 to 1 in all")

    @property
    def total(self) -> float:
        """Share of frames damaged in any way."""
        return self.drop + self.flip + self.insert + self.cut + self.collide


@dataclass(frozen=True, slots=True)
class Event:
    """At a time (seconds of bus time) something happens, to a board where nothing else is said.

    ``sleep`` (name "echo" or "silence"), ``wake``
    ``fault``, ``clear`` (name of a fault; "" clears all)
    ``send``: a host puts ``data`` on the wire, as soon as it is free
    and, for the next ``times`` requests to the board that it would answer (of ``data_id``, where one is given):
    ``silent``: it does not answer
    ``late``: its answer comes ``delay_ms`` late, in between what was asked meanwhile
    ``cut_burst``: it stops after ``frames`` frames; ``skip_frame``, ``repeat_frame``: number ``frames`` of the burst
    ``other_board``: this board answers, too and first, what another one was asked
    ``contradict``: its answer says something that other answers do not (name: one of Lie)
    ``damage``: its answer is damaged on the wire (name: one of Harm), in frame number ``frames``
    """

    at_s: float
    what: What
    board: int = 1
    name: str = ""
    data: bytes = b""
    sender: str = "host"
    times: int = 1
    data_id: int | None = None
    delay_ms: float = 1500.0
    frames: int = 1

    def __post_init__(self) -> None:
        _require(self.what in get_args(What), f"there is no event {self.what!r}: {', '.join(get_args(What))}")
        if self.what == "fault" or (self.what == "clear" and self.name):
            _require(self.name in FAULT_BITS, f"there is no fault {self.name!r}")
        if self.what == "sleep":
            _require(self.name in {"", "echo", "silence"}, f"asleep {self.name!r}: echo or silence")
        if self.what == "contradict":
            _require(self.name in get_args(Lie), f"contradict {self.name!r}: {', '.join(get_args(Lie))}")
        if self.what == "damage":
            _require(self.name in get_args(Harm), f"damage {self.name!r}: {', '.join(get_args(Harm))}")
        if self.what == "send":
            _require(0 < len(self.data) <= 256, "what is sent has 1 to 256 bytes")
        _require(self.at_s >= 0, f"an event at {self.at_s} s: must be 0 or later")
        _require(self.times > 0 and self.frames > 0, "times and frames must be 1 or more")


@dataclass(frozen=True, slots=True)
class Scenario:
    """A whole bus. The same scenario gives the same traffic, byte for byte and nanosecond for nanosecond."""

    seed: int = 1
    baud: int = 9600
    boards: tuple[Board, ...] = (Board(),)
    host: Host = field(default_factory=Host)
    damage: Damage = field(default_factory=Damage)
    events: tuple[Event, ...] = ()
    other_hosts: tuple[Host, ...] = ()
    foreign: tuple[Foreign, ...] = ()
    about: str = ""
    story: str = ""  # of the field notes, such as g.1
    wire: str = "uart"  # what it is shown on when nothing else is asked for
    duration_s: float = 60.0
    start_ns: int = 1_767_225_600 * 10**9  # 2026-01-01 00:00:00 UTC

    @property
    def hosts(self) -> tuple[Host, ...]:
        """All hosts that poll."""
        return tuple(host for host in (self.host, *self.other_hosts) if host.polls)

    def __post_init__(self) -> None:
        numbers = [board.number for board in self.boards]
        _require(bool(numbers), "a bus needs at least one board")
        _require(len(set(numbers)) == len(numbers), "two boards with one number cannot share a bus")
        _require(300 <= self.baud <= 4_000_000, f"{self.baud} baud: must be 300 to 4000000")
        for event in self.events:
            _require(event.board in numbers, f"an event for board {event.board}, which is not on the bus")
