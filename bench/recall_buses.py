# SPDX-License-Identifier: GPL-2.0-or-later
"""Buses with trouble, by a number: boards, hosts, wire and what goes wrong are drawn by lot; the number gives it again.

noise     frames damaged in five ways, one in 50 to one in 8
tricks    something on demand every two to five seconds: every event that a scenario knows
masters   two hosts or three, of which some do not listen, and foreign devices
all       a little of each
"""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, get_args

from tests.tools.dalytools.findings.explained import SAID_BY

from dalytools.simulator.board import LIE_IDS, frame
from dalytools.simulator.faults import FAULT_BITS
from dalytools.simulator.modbus import write_request
from dalytools.simulator.scenario import (
    PC_SOFTWARE_PLAN,
    Board,
    Damage,
    Event,
    Foreign,
    Habits,
    Harm,
    Host,
    Pack,
    Phase,
    Scenario,
)

if TYPE_CHECKING:
    from dalytools.simulator.scenario import Dialect

SECONDS = 240.0
KINDS = ("noise", "tricks", "masters", "all")
_METER = Foreign(bytes.fromhex("010300000002C40B"), 7.0, answer=bytes.fromhex("01030443666666A422"), name="meter")
_SINOWEALTH = Foreign(bytes.fromhex("0A0102"), 11.0, 3.0, answer=bytes.fromhex("0D03FD"), name="BMSTool")
_READS = ((0x00, 62), (0x00, 80), (0x80, 41), (0x28, 22))
_LIES = {name: needs for name, needs in SAID_BY.items() if name != "soc"}
"""What must be asked so that it shows. SOC against Modbus: where a program reads that too."""


def bus(number: int) -> Scenario:
    """Return the bus of that number."""
    r = random.Random(f"bus {number}")
    kind = KINDS[number % len(KINDS)]
    boards = _boards(r, steady=kind in {"tricks", "all"} or r.random() < 0.5)
    hosts = _hosts(r, kind, boards)
    harm = {"noise": 1.0, "all": 0.2}.get(kind, 0.0) * r.choice((0.02, 0.05, 0.12))
    parts = [r.random() for _ in range(5)]
    return Scenario(
        seed=number,
        boards=boards,
        host=hosts[0],
        other_hosts=hosts[1:],
        damage=Damage(*(harm * part / sum(parts) for part in parts)),
        foreign=(r.choice((_METER, _SINOWEALTH)),) if kind in {"masters", "all"} and r.random() < 0.7 else (),
        events=_events(r, boards, hosts, kind) if kind in {"tricks", "all"} else (),
        duration_s=SECONDS,
        about=kind,
    )


def _boards(r: random.Random, *, steady: bool) -> tuple[Board, ...]:
    numbers = r.sample(range(1, 17), r.choice((1, 1, 2, 3)))
    if r.random() < 0.7:
        numbers[0] = 1
    return tuple(_board(r, number, steady=steady) for number in dict.fromkeys(numbers))


def _board(r: random.Random, number: int, *, steady: bool) -> Board:
    dialects: tuple[tuple[Dialect, ...], ...] = (("a5",), ("a5",), ("a5", "d2"), ("a5", "81"), ("a5", "d2", "81"))
    load = (Phase(-20, 3600),) if steady else (Phase(-60, 4.7), Phase(0, 3.1), Phase(30, 5.3))
    pack = Pack(
        cells=r.choice((4, 7, 8, 13, 14, 16, 16, 24, 48)),
        sensors=r.choice((1, 2, 3, 4, 8, 21)),
        start_soc=r.uniform(20, 90),
        profile=load,
        chemistry=r.choice(("lfp", "nmc", "lto")),
        ripple=0.0 if steady else 0.04,
    )
    habits = Habits(
        frame_base=r.choice((1, 1, 1, 0)),
        reserved=r.choice(("stale", "zero", "ff")),
        sensor_frames=r.choice((1, 1, 2)),
        discharge_high=r.random() < 0.5,
        reply_ms=r.choice((20.0, 37.0, 90.0)),
        writes=r.choice(("accept", "accept", "ignore", "pretend", "silent")),
        unanswered=r.choice(((), (), (0x97,), (0xD8,))),
    )
    return Board(
        number, pack, habits, dialects=r.choice(dialects), faults=tuple(r.sample(list(FAULT_BITS), r.choice((0, 0, 2))))
    )


def _hosts(r: random.Random, kind: str, boards: tuple[Board, ...]) -> tuple[Host, ...]:
    gap = r.choice((60.0, 100.0, 250.0))
    hosts = [
        Host(
            plan=r.choice((PC_SOFTWARE_PLAN, (0x90, 0x94, 0x95, 0x98), (0x93, 0x90, 0x91, 0x94, 0x95, 0x96, 0x98))),
            gap_ms=gap,
        )
    ]
    spoken = {dialect for board in boards for dialect in board.dialects}
    if "d2" in spoken and sum("d2" in board.dialects for board in boards) == 1 and r.random() < 0.7:
        hosts.append(Host(name="app", dialect="d2", reads=(r.choice(_READS),), gap_ms=900))
    if "81" in spoken and r.random() < 0.7:
        speak = tuple(board.number for board in boards if "81" in board.dialects)
        hosts.append(Host(name="driver", dialect="81", boards=speak, gap_ms=900))
    if kind in {"masters", "all"}:
        asks = r.choice((0x80, 0x20, 0x3F + r.randrange(1, 17)))
        hosts.append(
            Host(
                name="monitor",
                address=asks,
                plan=r.choice(((0x90, 0x93), (0x95, 0x98), (0x90,))),
                gap_ms=r.uniform(200, 900),
                listens=kind == "all" or r.random() < 0.3,
                start_s=0.4,
                retries=r.choice((0, 2)),
            )
        )
    return tuple(hosts)


def _events(r: random.Random, boards: tuple[Board, ...], hosts: tuple[Host, ...], kind: str) -> tuple[Event, ...]:
    events: list[Event] = []
    asked = set(hosts[0].plan)
    at = 6.0
    while at < SECONDS - 25:
        board = r.choice(boards)
        number = board.number
        data_id = r.choice((None, r.choice(sorted(asked))))
        match r.choice(
            ("silent", "late", "burst", "burst", "lie", "lie", "damage", "fault", "write", "write", "stranger", "sleep")
        ):
            case "silent":
                events.append(Event(at, "silent", number, times=r.choice((1, 2, 4)), data_id=data_id))
            case "late":
                events.append(Event(at, "late", number, data_id=data_id, delay_ms=r.uniform(600, 3000)))
            case "burst":
                what = r.choice(("cut_burst", "skip_frame", "repeat_frame"))
                events.append(Event(at, what, number, frames=r.choice((1, 2, 3, 4)), data_id=r.choice((None, 0x95))))
            case "lie":
                lies = [name for name, needs in _LIES.items() if needs <= asked]
                if lies:
                    name = r.choice(lies)
                    events.append(Event(at, "contradict", number, name=name, data_id=LIE_IDS[name]))
            case "damage":
                name = r.choice(get_args(Harm))
                events.append(Event(at, "damage", number, name=name, frames=r.choice((1, 2, 5)), data_id=data_id))
            case "fault":
                for name in r.sample(list(FAULT_BITS), r.choice((1, 2))):
                    events.append(Event(at, "fault", number, name=name))
                    if r.random() < 0.8:
                        events.append(Event(at + r.uniform(1, 12), "clear", number, name=name))
            case "write":
                events.append(Event(at, "send", number, data=_write(r, board), sender="vendor tool"))
            case "stranger" if len(boards) > 1:
                events.append(Event(at, "other_board", number, times=r.choice((1, 2)), data_id=data_id))
            case _ if kind == "tricks" and r.random() < 0.4:
                events.append(Event(at, "sleep", number, name=r.choice(("echo", "silence"))))
                at += r.uniform(5, 12)
                events.append(Event(at, "wake", number))
                at += 8
            case _:
                pass
        at += r.uniform(2, 5)
    return tuple(events)


def _write(r: random.Random, board: Board) -> bytes:
    address = 0x3F + board.number
    ways = [
        frame(address, r.choice((0xD9, 0xDA)), bytes((r.choice((0, 1)),)) + bytes(7)),
        frame(address, 0x21, bytes(6) + r.randrange(200, 900).to_bytes(2)),
        frame(address, r.choice((0x19, 0x1A, 0x1E)), bytes.fromhex("0E420E2E0AF00A8C")),
    ]
    if "d2" in board.dialects:
        ways.append(write_request(0xD2, r.choice((0xA5, 0xA6)), [r.choice((0, 1))]))
    if "81" in board.dialects:
        ways.append(write_request(0x80 + board.number, r.choice((0x121, 0x122)), [r.choice((0, 1))]))
    return r.choice(ways)
