# SPDX-License-Identifier: GPL-2.0-or-later
"""What to simulate: one tree of plain values. Everything has a default, and the default is what real devices do.

Scenario
  boards: Board ...        which addresses, and for each
    pack: Pack             the battery behind it
    habits: Habits         how its firmware answers
  host: Host               who polls, what and how often
  damage: Damage           what happens to bytes on the wire
  events: Event ...        what happens when
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from dalytools.simulator.faults import FAULT_BITS

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
    """The battery: LFP cells in series. ``speed`` 0 stands still, 1 is real time, 60 shows an hour in a minute."""

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

    def __post_init__(self) -> None:
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

    def __post_init__(self) -> None:
        _require(1 <= self.number <= MAX_BOARDS, f"board {self.number}: boards are numbered 1 to {MAX_BOARDS}")
        _require(self.asleep in {"", "echo", "silence"}, f"asleep {self.asleep!r}: echo or silence")
        for name in self.faults:
            _require(
                name in FAULT_BITS, f"there is no fault {name!r}; such as cell_volt_high_level_1, short_circuit_protect"
            )


@dataclass(frozen=True, slots=True)
class Host:
    """Who polls. ``address`` None: each board by its own, 0x3F+N; else this one address only."""

    polls: bool = True
    address: int | None = None
    plan: tuple[int, ...] = PC_SOFTWARE_PLAN
    filler: int = 0x00  # the request's reserved bytes; some hosts send 0xAA (field notes b)
    gap_ms: float = 60.0  # from the end of a reply to the next request
    pause_ms: float = 0.0  # more of it after a whole plan
    timeout_ms: float = 500.0
    retries: int = 2

    def __post_init__(self) -> None:
        fine = self.address is None or 0x20 <= self.address <= 0xFF
        _require(
            fine, f"host address {self.address}: hosts have 0x20 to 0xff (0x40 RS-485, 0x80 app, 0x41 asks board 2)"
        )
        _require(bool(self.plan), "a host that polls needs at least one data ID")
        _require(self.gap_ms > 0 and self.timeout_ms > 0, "the host's gap and time-out must be more than 0 ms")


@dataclass(frozen=True, slots=True)
class Damage:
    """Shares of frames (0..1 each, together at most 1) that the wire damages, in one of four ways."""

    drop: float = 0.0  # one to three bytes out of the middle are lost
    flip: float = 0.0  # one bit is wrong
    insert: float = 0.0  # one to four bytes that nobody sent
    cut: float = 0.0  # the end is missing

    def __post_init__(self) -> None:
        rates = (self.drop, self.flip, self.insert, self.cut)
        _require(min(rates) >= 0 and self.total <= 1, f"damage to {self.total} of the frames: must be 0 to 1 in all")

    @property
    def total(self) -> float:
        """Share of frames damaged in any way."""
        return self.drop + self.flip + self.insert + self.cut


@dataclass(frozen=True, slots=True)
class Event:
    """At a time (seconds of bus time) something happens to a board.

    ``sleep`` (name "echo" or "silence"), ``wake``, ``fault`` and ``clear`` (name of a fault; "" clears all).
    """

    at_s: float
    what: Literal["sleep", "wake", "fault", "clear"]
    board: int = 1
    name: str = ""

    def __post_init__(self) -> None:
        if self.what == "fault" or (self.what == "clear" and self.name):
            _require(self.name in FAULT_BITS, f"there is no fault {self.name!r}")
        if self.what == "sleep":
            _require(self.name in {"", "echo", "silence"}, f"asleep {self.name!r}: echo or silence")


@dataclass(frozen=True, slots=True)
class Scenario:
    """A whole bus. The same scenario gives the same traffic, byte for byte and nanosecond for nanosecond."""

    seed: int = 1
    baud: int = 9600
    boards: tuple[Board, ...] = (Board(),)
    host: Host = field(default_factory=Host)
    damage: Damage = field(default_factory=Damage)
    events: tuple[Event, ...] = ()

    def __post_init__(self) -> None:
        numbers = [board.number for board in self.boards]
        _require(bool(numbers), "a bus needs at least one board")
        _require(len(set(numbers)) == len(numbers), "two boards with one number cannot share a bus")
        _require(300 <= self.baud <= 4_000_000, f"{self.baud} baud: must be 300 to 4000000")
        for event in self.events:
            _require(event.board in numbers, f"an event for board {event.board}, which is not on the bus")
