# SPDX-License-Identifier: GPL-2.0-or-later
"""Scenarios as TOML files: read, with every mistake told in one line, and the ready-made ones of the package.

The keys, each with a comment: example.toml beside the ready-made ones (``dalyshark simulate --example``), and
docs/scenarios.md. Units are in the names of keys (``gap_ms``) or seconds, amperes, degrees C, percent.
"""

from __future__ import annotations

import difflib
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar, cast, get_args

from dalytools.problem import Problem
from dalytools.simulator import modbus
from dalytools.simulator.board import frame
from dalytools.simulator.chemistry import CHEMISTRIES
from dalytools.simulator.faults import FAULT_BITS
from dalytools.simulator.scenario import (
    HOST_BASE,
    MAX_BOARDS,
    MAX_CELLS,
    MAX_SENSORS,
    Board,
    Damage,
    Dialect,
    Event,
    Foreign,
    Habits,
    Harm,
    Host,
    Lie,
    Pack,
    Phase,
    Scenario,
)
from dalytools.simulator.texts import Texts
from dalytools.simulator.toml_table import Table

if TYPE_CHECKING:
    from importlib.resources.abc import Traversable

WIRES: Final = ("uart", "can", "ble", "tcp")
DIALECTS: Final = get_args(Dialect)
MAX_FILE: Final = 1 << 20
DAY_S: Final = 86400.0
EXAMPLE: Final = "example"
_Made = TypeVar("_Made")
_DATA_IDS: Final = "a list of data IDs from 0x00 to 0xff, such as [0x90, 0x98]"


def _folder() -> Traversable:
    return files("dalytools") / "scenarios"


def ready_made() -> dict[str, Scenario]:
    """Read all scenarios that come with the package, by name."""
    names = sorted(entry.name for entry in _folder().iterdir() if entry.name.endswith(".toml"))
    return {
        name.removesuffix(".toml"): read_scenario(name.removesuffix(".toml"))
        for name in names
        if name != f"{EXAMPLE}.toml"
    }


def example_text() -> str:
    """Return the commented example."""
    return (_folder() / f"{EXAMPLE}.toml").read_text(encoding="utf-8")


def read_scenario(name: str) -> Scenario:
    """Read a scenario: a file, or the name of a ready-made one. Raises Problem."""
    ready = _folder() / f"{name}.toml"
    if "/" not in name and not name.endswith(".toml") and ready.is_file():
        return parsed(ready.read_text(encoding="utf-8"), name)
    path = Path(name)
    if not path.exists():
        names = [entry.name.removesuffix(".toml") for entry in _folder().iterdir() if entry.name.endswith(".toml")]
        near = difflib.get_close_matches(name, names, 1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise Problem(f"{name}: no such file, and no ready-made scenario; {hint}dalyshark simulate --list shows them")
    try:
        with path.open("rb") as file:
            content = file.read(MAX_FILE + 1)
        text = content.decode("utf-8")
    except OSError as error:
        raise Problem(f"{name}: can not be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise Problem(f"{name}: is no text in UTF-8, so no scenario; --example prints one") from None
    if len(content) > MAX_FILE:
        raise Problem(f"{name}: is larger than {MAX_FILE >> 20} MiB, so no scenario; --example prints one")
    return parsed(text, name)


def parsed(text: str, file: str) -> Scenario:
    """Make the scenario that a text describes; ``file`` is named in messages. Raises Problem."""
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise Problem(f"{file}: is not TOML: {error}") from None
    except RecursionError:
        raise Problem(f"{file}: is not TOML that means anything: nested too deep") from None
    top = Table(file, "", cast("dict[str, object]", values))
    boards = tuple(map(_board, top.tables("board"))) or (Board(),)
    hosts = tuple(map(_host, top.tables("host"))) if top.has("host") else (Host(),)
    fields: dict[str, object] = {
        "about": top.text("about", "", 200),
        "story": top.text("story", "", 20),
        "seed": top.integer("seed", 1, 0, 2**63 - 1),
        "baud": top.integer("baud", 9600, 300, 4_000_000),
        "duration_s": top.number("seconds", 60.0, 0.001, 366 * DAY_S),
        "start_ns": top.moment("start", Scenario().start_ns),
        "wire": top.word("wire", "uart", WIRES),
        "boards": boards,
        "host": hosts[0] if hosts else Host(polls=False),
        "other_hosts": hosts[1:],
        "damage": _damage(top.table("damage")),
        "foreign": tuple(map(_foreign, top.tables("foreign"))),
        "events": tuple(_event(table, [board.number for board in boards]) for table in top.tables("event")),
    }
    top.end()
    try:
        return Scenario(**fields)  # pyright: ignore[reportArgumentType] - each was read as what it is
    except ValueError as error:
        raise Problem(f"{file}: {error}") from None


def _checked(table: Table, made: type[_Made], **fields: object) -> _Made:
    """Make one of scenario.py's, and tell what it does not like by the table's name."""
    table.end()
    try:
        return made(**fields)
    except ValueError as error:
        raise Problem(f"{table.file}: {table.where}: {error}") from None


def _board(table: Table) -> Board:
    capacity = table.number("capacity_ah", 100.0, 0.1, 4_000_000)
    pack: dict[str, object] = {
        "cells": table.integer("cells", 16, 1, MAX_CELLS),
        "sensors": table.integer("sensors", 2, 1, MAX_SENSORS),
        "capacity_mah": round(capacity * 1000),
        "chemistry": table.word("chemistry", "lfp", CHEMISTRIES),
        "start_soc": table.number("soc", 62.5, 0, 100),
        "ambient_c": table.number("ambient", 21.0, -40, 120),
        "cycles": table.integer("cycles", 37, 0, 65535),
        "ripple": table.number("ripple", 0.04, 0, 1),
        "spread": table.number("spread", 0.01, 0, 0.2),
        "speed": table.number("speed", 1.0, 0, 3600),
        "production_date": table.day("production_date", (2024, 3, 15)),
    }
    if table.has("load"):
        pack["profile"] = tuple(map(_phase, table.tables("load")))
    default = Habits()
    sign = table.word("current_above_30000", "discharge", ("discharge", "charge"))
    habits = Habits(
        frame_base=table.integer("frame_base", 1, 0, 1),
        reserved=table.word("reserved", "stale", ("stale", "zero", "ff")),  # pyright: ignore[reportArgumentType]
        sensor_frames=table.integer("sensor_frames", 1, 1, 3),
        discharge_high=sign == "discharge",
        reply_ms=table.number("reply_ms", default.reply_ms, 0, 60_000),
        jitter_ms=table.number("jitter_ms", default.jitter_ms, 0, 60_000),
        echo_ms=table.number("echo_ms", default.echo_ms, 0, 60_000),
        zero_replies=table.integer("zero_replies", 10, 0, 1000),
        writes=table.word("writes", "accept", ("accept", "ignore", "pretend", "silent")),  # pyright: ignore[reportArgumentType]
        unanswered=table.integers("unanswered", (), 0, 255, shown=_DATA_IDS),
        alarm_grid=table.flag("alarm_grid", default=False),
        undocumented=table.flag("undocumented", default=False),
    )
    texts = table.table("texts")
    longest = {"manufacturer": 16, "battery_name": 32, "battery_code": 32, "serial_number": 24}
    longest |= {"software_version": 14, "hardware_version": 14, "firmware_index": 8, "password": 6}
    said = {name: texts.text(name, getattr(Texts(), name), most) for name, most in longest.items()}
    return _checked(
        table,
        Board,
        number=table.integer("number", 1, 1, MAX_BOARDS),
        asleep=table.word("asleep", "", ("echo", "silence")),
        faults=table.words("faults", (), FAULT_BITS),
        dialects=table.words("dialects", ("a5",), DIALECTS),
        pack=_checked(Table(table.file, table.where, {}), Pack, **pack),
        habits=habits,
        texts=_checked(texts, Texts, **said),
    )


def _phase(table: Table) -> Phase:
    return _checked(
        table,
        Phase,
        current_a=table.number("amperes", 0.0, -3000, 3000),
        seconds=table.number("seconds", 60.0, 0.1, 366 * DAY_S),
    )


def _host(table: Table) -> Host:
    default = Host()
    reads: list[tuple[int, int]] = []
    for read in table.tables("reads"):
        reads.append((read.integer("register", 0, 0, 0xFFFF), read.integer("count", 1, 1, modbus.MAX_READ)))
        read.end()
    address = table.integer("address", 0, 0x20, 0xFF, shown="an address of a host, 0x20 to 0xff (0x41 asks board 2)")
    return _checked(
        table,
        Host,
        name=table.text("name", "host", 40),
        dialect=table.word("dialect", "a5", DIALECTS),
        address=address or None,
        boards=table.integers("boards", (), 1, MAX_BOARDS, shown=f"a list of board numbers, 1 to {MAX_BOARDS}"),
        plan=table.integers("plan", default.plan, 0, 255, shown=_DATA_IDS),
        reads=tuple(reads),
        filler=table.integer("filler", 0, 0, 255),
        gap_ms=table.number("gap_ms", default.gap_ms, 0.1, 3_600_000),
        pause_ms=table.number("pause_ms", 0.0, 0, 3_600_000),
        timeout_ms=table.number("timeout_ms", default.timeout_ms, 0.1, 60_000),
        retries=table.integer("retries", default.retries, 0, 100),
        listens=table.flag("listens", default=True),
        start_s=table.number("from", 0.0, 0, 366 * DAY_S),
        stop_s=table.number("until", 0.0, 0, 366 * DAY_S),
    )


def _damage(table: Table) -> Damage:
    shares = {how: table.number(how, 0.0, 0, 1) for how in get_args(Harm)}
    return _checked(table, Damage, **shares)


def _foreign(table: Table) -> Foreign:
    return _checked(
        table,
        Foreign,
        name=table.text("name", "foreign", 40),
        data=table.data("data", 256),
        answer=table.data("answer", 256),
        answer_ms=table.number("answer_ms", 20.0, 0, 60_000),
        period_s=table.number("period", 1.0, 0.001, 366 * DAY_S),
        start_s=table.number("from", 0.0, 0, 366 * DAY_S),
        can_id=table.integer("can_id", 0, 0, (1 << 29) - 1, shown="a CAN identifier, 0 to 0x1fffffff")
        if table.has("can_id")
        else None,
    )


_ON_ANSWERS: Final = (
    "silent",
    "late",
    "cut_burst",
    "skip_frame",
    "repeat_frame",
    "other_board",
    "contradict",
    "damage",
)
_EVENTS: Final = ("sleep", "wake", "fault", "clear", "send", "write", *_ON_ANSWERS)


def _event(table: Table, boards: list[int]) -> Event:
    if not table.has("do"):
        raise table.missing("do", f"what happens, one of {', '.join(_EVENTS)}")
    what = table.word("do", "", _EVENTS)
    fields: dict[str, object] = {"at_s": table.number("at", 0.0, 0, 366 * DAY_S), "what": what}
    board = table.integer("board", boards[0], 1, MAX_BOARDS)
    if board not in boards:
        raise table.problem("board", f"one of the boards of this file: {', '.join(map(str, boards))}")
    fields["board"] = board
    match what:
        case "sleep":
            fields["name"] = table.word("name", "echo", ("echo", "silence"))
        case "fault":
            fields["name"] = table.word("name", "", FAULT_BITS)
        case "clear" if table.has("name"):
            fields["name"] = table.word("name", "", FAULT_BITS)
        case "contradict":
            fields["name"] = table.word("name", "", get_args(Lie))
        case "damage":
            fields["name"] = table.word("name", "", get_args(Harm))
        case "late":
            fields["delay_ms"] = table.number("delay_ms", 1500.0, 0.1, 3_600_000)
        case "send":
            fields["data"] = table.data("data", 256)
        case "write":
            fields |= {"what": "send", "data": _write(table, board)}
        case _:
            pass
    if what in {"fault", "contradict", "damage"} and not fields.get("name"):
        raise table.missing("name", f"which one; dalyshark simulate --example names them all")  # noqa: F541
    if what in {"send", "write"}:
        fields["sender"] = table.text("host", "host", 40)
        fields["times"] = table.integer("times", 1, 1, 1_000_000)
    if what in _ON_ANSWERS:
        fields["times"] = table.integer("times", 1, 1, 1_000_000)
        if table.has("id"):
            fields["data_id"] = table.integer("id", 0, 0, 255)
    if what in {"cut_burst", "skip_frame", "repeat_frame", "damage"}:
        fields["frames"] = table.integer("frame", 1, 1, 16)
    return _checked(table, Event, **fields)


def _write(table: Table, board: int) -> bytes:
    """Build the request of a ``write``: an ID and eight data bytes, or a register and its values."""
    dialect = table.word("dialect", "a5", DIALECTS)
    if dialect == "a5":
        if not table.has("id"):
            raise table.missing("id", "the data ID of the write, such as 0xD9")
        data_id = table.integer("id", 0, 0, 255)
        address = table.integer("address", HOST_BASE + board, 0x20, 0xFF, shown="an address of a host, 0x20 to 0xff")
        return frame(address, data_id, table.data("data", 8).ljust(8, b"\0"))
    if not table.has("register"):
        raise table.missing("register", "the first register of the write, such as 0xA5")
    register = table.integer("register", 0, 0, 0xFFFF)
    values = table.integers("values", (), 0, 0xFFFF, shown="a list of 1 to 120 values, 0 to 65535")
    if not 1 <= len(values) <= 120:
        raise table.problem("values", "a list of 1 to 120 values, 0 to 65535")
    address = modbus.D2 if dialect == "d2" else modbus.ASKS_81 + board
    return modbus.write_request(address, register, list(values))
