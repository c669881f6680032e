# SPDX-License-Identifier: GPL-2.0-or-later
"""The table of tests/meaning_modbus.py through the dissector: all of it in one capture, an interface a case."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.dissector.dissection import Dissect, P, Row, expert
from tests.dissector.test_meaning import as_list, plain
from tests.dissector.test_statistics import capture
from tests.meaning_modbus import CASES, brings, many, one, read, watched

if TYPE_CHECKING:
    from dalytools.tshark import Tshark

PACKETS = ("request_in", "late_to", "changed_from", "contradicts")
"""Numbers of packets, which a case counts from its own first."""
BY_THE_END = "unanswered"
"""Depends on how far the capture goes, which here is farther than the case."""
SIDES = {"": 0, "inbound": 1, "outbound": 2}


@pytest.fixture(scope="module")
def sessions(dissect: Dissect) -> dict[str, tuple[int, list[Row]]]:
    """Of each case, the packets before it and its rows."""
    packets = [
        P(heard.frame, heard.at + 100 * case, case, SIDES[heard.side])
        for case, name in enumerate(CASES)
        for heard in CASES[name]
    ]
    rows = dissect(packets, descriptions=[f"dalyshark case {case}" for case in range(len(CASES))])
    taken: dict[str, tuple[int, list[Row]]] = {}
    before = 0
    for name, heard in CASES.items():
        taken[name] = before, rows[before : before + len(heard)]
        before += len(heard)
    return taken


def wanted(key: str, value: object, before: int) -> list[object]:
    """What is expected, counted in packets of the whole capture."""
    return [each + before if key in PACKETS and isinstance(each, float) else each for each in as_list(value)]


def as_expected(value: str, expected: list[object]) -> object:
    """A text where one is expected (a password of digits), else a number where it is one."""
    truth = {"True": "1", "False": "0"}
    return value if any(isinstance(each, str) for each in expected) else plain(truth.get(value, value))


@pytest.mark.parametrize("name", CASES)
def test_meaning(sessions: dict[str, tuple[int, list[Row]]], name: str) -> None:
    before, rows = sessions[name]
    for number, (heard, row) in enumerate(zip(CASES[name], rows, strict=True), 1):
        expected = {
            f"daly.{key}": wanted(key, value, before) for key, value in heard.expect.items() if key != BY_THE_END
        }
        seen = {
            field: [as_expected(value, expected.get(field, [])) for value in row[field]]
            for field in watched(row["daly.dialect"][0])
            if field in row and field != f"daly.{BY_THE_END}"
        }
        assert seen == expected, f"packet {number}"


def test_registers_behind_ffff_have_no_number(tshark: Tshark) -> None:
    path = capture(tshark, [P(read(0xFFFF, 2, 0x81), 0), P(brings(1, 2, address=0x51), 0.05)])
    shown = tshark.run("-r", str(path), "-V").stdout.decode()
    assert "Register FFFF: 1 " in shown
    assert "Register 1000" not in shown


# What the note of a write says. "No list names" is said of registers that docs/protocol.md, d, does not have at all.
NOTES = {
    one(0xA7, 500): "WRITE 00A7: sets SOC to 50.0 %",
    one(0xA7, 0xFFFF): "WRITE 00A7: sets SOC to 6553.5 %",
    many(0x109, 1, 0xFFFF, address=0x81): "WRITE 0109 to 010A: sets rated capacity to 131071 mAh",
    one(0x115, 0xFFFF, 0x81): "WRITE 0115: sets sleep to never",
    one(0xD7, 1): "WRITE 00D7: 1 register, which no list names, to 0001",
    many(0xCE, 1): "WRITE 00CE: 1 register, which no list names, to 0001",
    one(0xC9, 0x3132): "WRITE 00C9: 1 register, no setting that we know, to 3132",  # a third of the password
    one(0x10A, 1, 0x81): "WRITE 010A: 1 register, no setting that we know, to 0001",  # half of the capacity
    many(0xA9, 0x3132, 0x3334): "WRITE 00A9 to 00AA: 2 registers, no setting that we know, to 3132 3334",
    one(0x28, 500): "WRITE 0028: 1 register, no setting that we know, to 01F4",
    one(0x0C, 1): "WRITE 000C: 1 register, no setting that we know, to 0001",
    one(0x20, 60): "WRITE 0020: 1 register, no setting that we know, to 003C",
    one(0x3C, 1): "WRITE 003C: 1 register, no setting that we know, to 0001",  # faults
    one(0x3C, 1, 0x81): "WRITE 003C: 1 register, no setting that we know, to 0001",
    one(0x97, 0xFFFF): "WRITE 0097: 1 register, no setting that we know, to FFFF",
}


def test_what_a_write_sets_is_noted(dissect: Dissect) -> None:
    rows = dissect([P(frame, at) for at, frame in enumerate(NOTES)])
    for row, note in zip(rows, NOTES.values(), strict=True):
        assert note in expert(row)
