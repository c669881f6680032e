# SPDX-License-Identifier: GPL-2.0-or-later
"""What the screen knows, and since when."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.tools.dalytools.dashboard.heard import ALL, CELLS, FAULTS, PACK, STATUS, SWITCH_OFF, heard
from tests.tools.dalytools.made import a5

from dalytools.dashboard.told import BoardTold

if TYPE_CHECKING:
    from pathlib import Path


def test_values_of_a_board(tmp_path: Path) -> None:
    state = heard(tmp_path, [(10.0, frame) for frame in ALL])
    assert state.names() == ["1"]
    told = state.boards["1"].told
    assert {name: told[f"daly.{name}"].value for name in ("pack.voltage", "pack.current", "soc", "state")} == {
        "pack.voltage": 13.2,
        "pack.current": -15.4,
        "soc": 62.5,
        "state": 1,
    }
    assert told["daly.cells.voltage"].all == [3300, 3310, 3290, 3280]
    assert told["daly.sensors.temperature"].all == [21, 19]
    assert told["daly.balance.cell"].all == [1, 3]
    assert told["daly.remaining_capacity"].number == 156_250
    assert state.boards["1"].faults() == ["cell_volt_high_level_1", "cell_volt_high_level_2", "short_circuit_protect"]
    assert (state.kinds.good, state.kinds.bad, state.kinds.junk, state.unasked) == (8, 0, 0, 0)


def test_a_value_is_as_old_as_its_reply(tmp_path: Path) -> None:
    told = heard(tmp_path, [(10.0, PACK), (14.0, STATUS), (20.0, PACK)]).boards["1"].told
    assert (told["daly.pack.voltage"].at, told["daly.charger"].at) == (20.0, 14.0)


def test_no_cell_balances_any_more(tmp_path: Path) -> None:
    state = heard(tmp_path, [(1.0, a5(1, 0x97, b"\x05")), (2.0, a5(1, 0x97))])
    assert "daly.balance.cell" not in state.boards["1"].told


def test_a_fault_that_went(tmp_path: Path) -> None:
    board = heard(tmp_path, [(1.0, FAULTS), (2.0, a5(1, 0x98))]).boards["1"]
    assert board.faults() == []
    assert board.faults_at() == 2.0


def test_cells_without_a_count_come_when_their_burst_ends(tmp_path: Path) -> None:
    """Nobody said how many cells there are: the table is known by what follows, but as old as its last frame."""
    state = heard(tmp_path, [(1.0, CELLS[0]), (1.0, CELLS[1]), (9.0, PACK)])
    told = state.boards["1"].told["daly.cells.voltage"]
    assert (told.all, told.at) == ([3300, 3310, 3290, 3280, 0, 0], 1.0)


def test_what_is_known_late_is_not_newer() -> None:
    """Records wait behind an unanswered request: what they tell is told already, or even told anew."""
    board = BoardTold("1")
    board.take({"daly.soc": 50.0}, 2.0)
    board.late({"daly.soc": 40.0, "daly.cells.min": 3300}, 1.0)
    assert (board.told["daly.soc"].value, board.told["daly.cells.min"].at) == (50.0, 1.0)


def test_unanswered_on_a_silent_bus(tmp_path: Path) -> None:
    """A request waits for a second; that it is over must be known though nothing more is heard."""
    state = heard(tmp_path, [(0.0, a5(0x40, 0x90)), (5.0, a5(0x41, 0x91)), (5.2, a5(2, 0x91)), (6.0, a5(0x41, 0x93))])
    assert state.unanswered(6.5) == {"1": 1}
    assert state.unanswered(7.1) == {"1": 1, "2": 1}
    assert [heard.unanswered(6.5, 1.0) for heard in state.last] == [True, False, False, False]


def test_writes_retries_junk(tmp_path: Path) -> None:
    ask = a5(0x40, 0x90)
    state = heard(
        tmp_path,
        [(0.0, SWITCH_OFF), (0.1, ask), (0.7, ask), (1.0, ask[:12] + b"\0"), (2.0, b"\1\2\3"), (3, b""), (4, PACK)],
    )
    assert (state.writes, state.retries, state.kinds.bad, state.kinds.junk, state.events) == (1, 1, 1, 1, 1)
    assert state.last_write
    assert state.last_write.data == SWITCH_OFF
    assert state.records == 6


def test_records_a_second(tmp_path: Path) -> None:
    """Thirty in three seconds, over the last five whole seconds: 6 a second; later none."""
    state = heard(tmp_path, [(100 + number / 10, PACK) for number in range(30)])
    assert state.rate(103.0) == 6.0
    assert state.rate(110.0) == 0.0


def test_memory_does_not_grow(tmp_path: Path) -> None:
    frames = [a5(address, 0x90) for address in range(1, 32)]
    state = heard(tmp_path, [(number / 50, frames[number % 31]) for number in range(2000)])
    assert len(state.last) == 100
    assert len(state.boards) == 31
    assert len(state._seconds) < 10  # pyright: ignore[reportPrivateUsage]
    assert len(state._open) <= 2  # pyright: ignore[reportPrivateUsage]
