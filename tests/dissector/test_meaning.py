# SPDX-License-Identifier: GPL-2.0-or-later
"""The table of tests/meaning.py through the dissector, in the second pass; and what a first pass must not say."""

from __future__ import annotations

from typing import cast

import pytest
from tests.dissector.dissection import Dissect, P, Row, expert, info
from tests.meaning import CASES, WATCHED, Heard

LATER = ("unanswered", "burst.cut_off", "reassembled_in")
"""Known in a second pass only (of records before)."""


def plain(value: str) -> object:
    """A field's text as a value: this tshark writes booleans as 1 or True."""
    try:
        return float(int(value, 0)) if "." not in value else round(float(value), 9)
    except ValueError:
        return value


def as_list(value: object) -> list[object]:
    values = cast("list[object]", value) if isinstance(value, list) else [value]
    return [round(float(each), 9) if isinstance(each, (int, float)) else each for each in values]


def seen(row: Row) -> dict[str, list[object]]:
    truth = {"True": "1", "False": "0"}
    return {name: [plain(truth.get(v, v)) for v in row[name]] for name in WATCHED if name in row}


@pytest.fixture(scope="module")
def sessions(dissect: Dissect) -> dict[str, list[Row]]:
    """All cases in one capture, each on an interface of its own."""
    rows: dict[str, list[Row]] = {}
    for name, heard in CASES.items():
        rows[name] = dissect([P(each.frame, each.at) for each in heard])
    return rows


@pytest.mark.parametrize("name", CASES)
def test_meaning(sessions: dict[str, list[Row]], name: str) -> None:
    for number, (heard, row) in enumerate(zip(CASES[name], sessions[name], strict=True), 1):
        expected = {f"daly.{key}": as_list(value) for key, value in heard.expect.items()}
        assert seen(row) == expected, f"packet {number}"


@pytest.mark.parametrize("name", CASES)
def test_a_first_pass_does_not_know_what_comes(dissect: Dissect, name: str) -> None:
    heard = CASES[name]
    rows = dissect([P(each.frame, each.at) for each in heard], two_pass=False)
    for number, (each, row) in enumerate(zip(heard, rows, strict=True), 1):
        for key in LATER:
            known = key == "reassembled_in" and int(str(each.expect.get(key, number))) < number
            assert (f"daly.{key}" in row) == known, f"packet {number}: {key}"


WORDS: dict[str, dict[int, str]] = {
    "unanswered, found out by the next request": {1: "No reply"},
    "late": {2: "Too late for the request in packet 1"},
    "the same answer twice": {3: "Nobody asked for this reply"},
    "board 2 answers what 40 asked": {2: "Board 1 was asked"},
    "two hosts": {3: "Two hosts"},
    "cut off by time": {2: "Burst is cut off"},
    "state and switches": {3: "state, discharge mos"},
    "faults": {3: "Raised: cell_volt_high_level_2, cell_volt_low_level_2"},
    "MOS switches": {
        1: "WRITE: switches the charge MOS on (01 is on,",
        3: "switches the discharge MOS off",
        4: "denies",
    },
    "clock and SOC": {1: "23-08-23 18:00:00, SOC to 50.0 %"},
    "settings and restart": {
        1: "WRITE: sets rated capacity to 300000 mAh, cell nominal voltage to 3300 mV",
        3: "WRITE: sets what 0x6A reads, to 01 00 00 00 00 00 00 00",
        5: "restarts the board",
    },
    "91 beyond 20 mV of the cells": {3: "Highest cell is 3341 mV here, 3320 mV in the newest table of 0x95 (packet 2)"},
    "pack voltage within 1 % of the cells": {5: "Pack voltage is 10.2 V, the cells sum up to 10.000 V"},
    "cells that the board does not have": {3: "Number 4, and there are 3 by 0x94 (packet 2)"},
    "temperatures": {4: "Lowest temperature is 17 C here, 20 C in the newest table of 0x96 (packet 2)"},
}


@pytest.mark.parametrize("name", WORDS)
def test_it_is_said_in_words(sessions: dict[str, list[Row]], name: str) -> None:
    for number, text in WORDS[name].items():
        assert text in expert(sessions[name][number - 1])


def test_writes_and_unanswered_requests_stand_out_in_the_list(sessions: dict[str, list[Row]]) -> None:
    assert info(sessions["MOS switches"][0]) == "WRITE board 1  0xDA Charge MOS: switches the charge MOS on"
    assert info(sessions["late"][0]).endswith("[unanswered]")
    assert 'all: "DL-BMS-R32-01E"' in info(sessions["a text"][1])


QUIET = ("answered", "replies alone complain of nothing", "all cells, linked both ways", "one host asks two boards")


@pytest.mark.parametrize("name", QUIET)
def test_what_is_normal_is_silent(sessions: dict[str, list[Row]], name: str) -> None:
    assert [expert(row) for row in sessions[name]] == [""] * len(CASES[name])


def test_slow_replies_by_preference(dissect: Dissect) -> None:
    session = [P(CASES["answered"][0].frame, 0), P(CASES["answered"][1].frame, 0.3)]
    assert expert(dissect(session)[1]) == ""
    assert "0.286 s after" in expert(dissect(session, options=["daly.slow:200"])[1])


@pytest.mark.parametrize(
    ("name", "option", "number"),
    [
        ("91 beyond 20 mV of the cells", "daly.cell_tolerance:100", 3),
        ("temperatures", "daly.temperature_tolerance:10", 4),
        ("pack voltage within 1 % of the cells", "daly.sum_tolerance:5", 5),
        ("the cells against the 91 before", "daly.age:0", 3),
        ("late", "daly.late:500", 2),
    ],
)
def test_limits_are_preferences(dissect: Dissect, name: str, option: str, number: int) -> None:
    heard: list[Heard] = CASES[name]
    row = dissect([P(each.frame, each.at) for each in heard], options=[option])[number - 1]
    assert "daly.contradiction" not in row
    assert "daly.late_to" not in row
