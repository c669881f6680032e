# SPDX-License-Identifier: GPL-2.0-or-later
"""0x95 and 0x96 over several frames: docs/records.md 8, by small examples worked out by hand."""

from __future__ import annotations

import pytest
from tests.dissector.dissection import Dissect, P, Row, a5, expert, in_a_row, info, number, numbers


def cells(number: int, *voltages: int, address: int = 1) -> str:
    """A 0x95 frame of up to three cells (mV); the last byte is stale."""
    return a5(address, 0x95, f"{number:02x}" + "".join(f"{v:04x}" for v in voltages).ljust(12, "0") + "32")


def status(count: int, sensors: int, address: int = 1) -> str:
    return a5(address, 0x94, f"{count:02x}{sensors:02x}")


def sensors(number: int, *celsius: int, address: int = 1) -> str:
    return a5(address, 0x96, f"{number:02x}" + "".join(f"{c + 40:02x}" for c in celsius))


FIVE = (cells(1, 3301, 3302, 3303), cells(2, 3304, 3305, 3333))


def test_the_record_with_the_last_cell_has_the_table_in_one_pass(dissect: Dissect) -> None:
    rows = dissect(in_a_row(status(5, 1), *FIVE), two_pass=False)
    assert numbers(rows[1], "cell.voltage") == [3301, 3302, 3303]
    assert "daly.cells.voltage" not in rows[1]
    assert numbers(rows[2], "cell.voltage") == [3304, 3305]
    assert numbers(rows[2], "cells.voltage") == [3301, 3302, 3303, 3304, 3305]
    assert [number(rows[2], f"cells.{name}") for name in ("count", "min", "max", "average", "spread")] == [
        5, 3301, 3305, 3303.0, 4,
    ]  # fmt: skip
    assert rows[2]["daly.reserved"] == [f"{3333:04x}32"]  # the stale slot is no cell
    assert "all 5: min 3301 (cell 1)  max 3305 (cell 5)  average 3303  spread 4 mV" in info(rows[2])


def test_without_a_count_the_last_record_has_it_in_the_second_pass(dissect: Dissect) -> None:
    packets = in_a_row(*FIVE)
    once = dissect(packets, two_pass=False)
    assert all("daly.cells.voltage" not in row for row in once)
    twice = dissect(packets)
    assert "daly.cells.voltage" not in twice[0]
    assert numbers(twice[1], "cells.voltage") == [3301, 3302, 3303, 3304, 3305, 3333]


@pytest.mark.parametrize("count", [0, 49, 255])
def test_a_count_that_cannot_be_is_ignored(dissect: Dissect, count: int) -> None:
    """Replies after wake-up are all zero: what was known stays."""
    rows = dissect(in_a_row(status(5, 1), status(count, 0), *FIVE))
    assert number(rows[3], "cells.count") == 5


def test_counts_are_each_boards_own(dissect: Dissect) -> None:
    rows = dissect(in_a_row(status(5, 1), status(3, 1, address=2), *FIVE, cells(1, 3401, 3402, 3403, address=2)))
    assert number(rows[3], "cells.count") == 5
    assert number(rows[4], "cells.count") == 3


def test_base_zero(dissect: Dissect) -> None:
    """As the paper has it: frame 0 is cells 1 to 3."""
    rows = dissect(in_a_row(status(5, 1), cells(0, 3301, 3302, 3303), cells(1, 3304, 3305)))
    assert numbers(rows[2], "cells.voltage") == [3301, 3302, 3303, 3304, 3305]
    assert "cells 4-5" in info(rows[2])


def test_the_base_is_the_bursts_own(dissect: Dissect) -> None:
    """A burst from 0, then one from 1: the second has base 1 again."""
    rows = dissect(in_a_row(cells(0, 3301, 3302, 3303), cells(1, 3304), a5(1, 0x91), *FIVE))
    assert "cells 1-3" in info(rows[0])
    assert "cells 4-6" in info(rows[1])
    assert "cells 1-3" in info(rows[3])


def test_sixteen_zero_filled_frames_of_five_cells(dissect: Dissect) -> None:
    """Asked by the app (0x80) a board sends all 16 frames (field notes, fact 6)."""
    frames = [*FIVE, *(cells(n) for n in range(3, 17))]
    rows = dissect(in_a_row(a5(0x80, 0x94), status(5, 1), a5(0x80, 0x95), *frames))
    assert number(rows[4], "cells.count") == 5
    for row in rows[5:]:
        assert "daly.cell.voltage" not in row
        assert number(row, "request_in") == 3
        assert expert(row) == ""


def test_forty_eight_cells(dissect: Dissect) -> None:
    frames = [cells(n, 3000 + 3 * n, 3001 + 3 * n, 3002 + 3 * n) for n in range(1, 17)]
    rows = dissect(in_a_row(status(48, 16), *frames))
    assert numbers(rows[-1], "cells.voltage") == list(range(3003, 3051))


def test_a_missing_frame_is_named_and_there_is_no_table(dissect: Dissect) -> None:
    rows = dissect(in_a_row(status(9, 1), cells(1, 1, 2, 3), cells(3, 7, 8, 9)))
    assert numbers(rows[2], "burst.missing") == [2]
    assert "missing" in expert(rows[2])
    assert "daly.cells.voltage" not in rows[2]
    assert numbers(rows[2], "cell.voltage") == [7, 8, 9]


def test_a_reader_that_joins_late(dissect: Dissect) -> None:
    rows = dissect(in_a_row(status(9, 1), cells(3, 7, 8, 9)))
    assert numbers(rows[1], "burst.missing") == [1, 2]


def test_a_repeat_is_marked_and_replaces(dissect: Dissect) -> None:
    rows = dissect(in_a_row(status(5, 1), cells(1, 1, 1, 1), cells(1, 3301, 3302, 3303), cells(2, 3304, 3305)))
    assert number(rows[2], "burst.repeat") == 1
    assert "before" in expert(rows[2])
    assert numbers(rows[3], "cells.voltage") == [3301, 3302, 3303, 3304, 3305]


def test_a_repeat_of_the_last_frame_shows_the_table_again(dissect: Dissect) -> None:
    rows = dissect(in_a_row(status(5, 1), *FIVE, cells(2, 3310, 3311)))
    assert numbers(rows[2], "cells.voltage")[3:] == [3304, 3305]
    assert numbers(rows[3], "cells.voltage")[3:] == [3310, 3311]


def test_a_lower_number_begins_a_new_burst(dissect: Dissect) -> None:
    rows = dissect(in_a_row(status(5, 1), *FIVE, cells(1, 1, 2, 3), cells(2, 4, 5)))
    assert numbers(rows[4], "cells.voltage") == [1, 2, 3, 4, 5]
    assert all("daly.burst.repeat" not in row for row in rows)


def test_one_frame_polled_twice_is_no_repeat(dissect: Dissect) -> None:
    ask = a5(0x40, 0x96)
    rows = dissect([P(ask), P(sensors(1, 20), 0.05), P(ask, 0.3), P(sensors(1, 21), 0.35)])
    assert "daly.burst.repeat" not in rows[3]
    assert number(rows[3], "request_in") == 3


@pytest.mark.parametrize(("quiet", "whole"), [(0.49, True), (0.51, False)])
def test_quiet_ends_a_burst(dissect: Dissect, quiet: float, whole: bool) -> None:
    first = 13 * 10 / 9600
    rows = dissect([P(status(5, 1)), P(FIVE[0], 1.0), P(FIVE[1], 1.0 + first + quiet)])
    assert ("daly.cells.voltage" in rows[2]) is whole
    assert (numbers(rows[2], "burst.missing") == [1]) is not whole


@pytest.mark.parametrize("between", [a5(1, 0x91), cells(2, 1, 2, 3, address=2)])
def test_another_reply_ends_a_burst(dissect: Dissect, between: str) -> None:
    rows = dissect(in_a_row(status(5, 1), FIVE[0], between, FIVE[1]))
    assert numbers(rows[3], "burst.missing") == [1]
    assert "daly.cells.voltage" not in rows[3]


@pytest.mark.parametrize("between", [a5(0x40, 0x95), a5(0x40, 0x91), "a501950802ffffffffffffffff", "0000"])
def test_requests_and_damage_do_not_end_a_burst(dissect: Dissect, between: str) -> None:
    rows = dissect(in_a_row(status(5, 1), FIVE[0], between, FIVE[1]))
    assert number(rows[3], "cells.count") == 5


@pytest.mark.parametrize("number_sent", [0xFF, 0x11, 0x80])
def test_numbers_that_cannot_be_give_no_values(dissect: Dissect, number_sent: int) -> None:
    rows = dissect(in_a_row(status(5, 1), FIVE[0], cells(number_sent, 1, 2, 3), FIVE[1]))
    assert number(rows[2], "frame_number") == number_sent
    assert "daly.cell.voltage" not in rows[2]
    assert rows[2]["daly.reserved"] == ["00010002000332"]
    assert number(rows[3], "cells.count") == 5


def test_the_frames_of_a_burst_belong_to_its_request(dissect: Dissect) -> None:
    rows = dissect([P(a5(0x40, 0x95)), P(FIVE[0], 0.05), P(FIVE[1], 0.0636)])
    assert [number(row, "request_in") for row in rows] == [None, 1, 1]
    assert number(rows[0], "reply_in") == 2
    assert number(rows[1], "response_time") is not None
    assert number(rows[2], "response_time") is None


def test_a_fault_log_in_several_frames_answers_one_request(dissect: Dissect) -> None:
    """Field notes a.2: 0x64 comes in four frames an entry, which nothing numbers."""
    at = (0, 0.05, 0.07, 0.09, 0.9)
    rows = dissect([P(a5(0x40, 0x64), at[0]), *(P(a5(0x01, 0x64, "01"), seconds) for seconds in at[1:])])
    assert numbers(rows[0], "reply_in") == [2]
    assert [number(row, "request_in") for row in rows[1:]] == [1, 1, 1, None]
    assert ["daly.response_time" in row for row in rows[1:]] == [True, False, False, False]
    assert [number(row, "unasked") for row in rows[1:]] == [None, None, None, 1]


def test_temperatures_of_real_sensors_only(dissect: Dissect) -> None:
    rows = dissect(in_a_row(status(5, 2), sensors(1, 21, -3, 99), sensors(2, 1, 2)))
    assert numbers(rows[1], "temperature") == [21, -3]
    assert rows[1]["daly.reserved"] == [f"{99 + 40:02x}00000000"]
    assert "daly.temperature" not in rows[2]


def test_temperatures_without_a_count_are_all_seven(dissect: Dissect) -> None:
    row: Row = dissect([P(sensors(1, 21, -3))])[0]
    assert numbers(row, "temperature") == [21, -3, -40, -40, -40, -40, -40]


def test_eight_sensors_in_two_frames(dissect: Dissect) -> None:
    rows = dissect(in_a_row(status(5, 8), sensors(1, 1, 2, 3, 4, 5, 6, 7), sensors(2, 8, 9)))
    assert numbers(rows[1], "temperature") == [1, 2, 3, 4, 5, 6, 7]
    assert numbers(rows[2], "temperature") == [8]


def test_texts_are_numbered_frames(dissect: Dissect) -> None:
    frames = [a5(1, 0x62, f"{n:02x}" + "41" * 7) for n in (1, 3)]
    rows = dissect(in_a_row(a5(0x40, 0x62), *frames))
    assert numbers(rows[2], "frame_number") == [3]
    assert numbers(rows[2], "burst.missing") == [2]
    assert number(rows[2], "request_in") == 1
