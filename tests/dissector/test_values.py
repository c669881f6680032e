# SPDX-License-Identifier: GPL-2.0-or-later
"""The table of tests/values.py through the dissector; and the words for what it says."""

from __future__ import annotations

import pytest
from tests.dissector.dissection import Dissect, P, Row, a5, expert, info
from tests.dissector.test_meaning import as_list, plain
from tests.values import A5_CASES, ELSEWHERE

from dalytools.field_names import FIELD_NAMES

LOOKED_AT = [name for name in FIELD_NAMES if name not in ELSEWHERE]
CASES = A5_CASES


def seen(row: Row) -> dict[str, list[object]]:
    truth = {"True": "1", "False": "0"}
    return {name: [plain(truth.get(v, v)) for v in row[name]] for name in LOOKED_AT if name in row}


@pytest.fixture(scope="module")
def sessions(dissect: Dissect) -> dict[str, list[Row]]:
    """All cases in one capture, each on an interface of its own, one after the other."""
    packets: list[P] = []
    for index, heard in enumerate(CASES.values()):
        packets += [P(each.frame, index * 100 + each.at, index) for each in heard]
    rows = iter(dissect(packets, descriptions=["dalyshark"] * len(CASES)))
    return {name: [next(rows) for _ in heard] for name, heard in CASES.items()}


@pytest.mark.parametrize("name", CASES)
def test_values(sessions: dict[str, list[Row]], name: str) -> None:
    for number, (heard, row) in enumerate(zip(CASES[name], sessions[name], strict=True), 1):
        expected = {f"daly.{key}": [plain_text(each) for each in as_list(value)] for key, value in heard.expect.items()}
        assert seen(row) == expected, f"packet {number}"


def plain_text(value: object) -> object:
    return plain(value) if isinstance(value, str) else value


BEFORE = {
    "a limit": (
        a5(1, 0x59, "0e420e740af009c4"),
        a5(0x40, 0x19, "0e420e100af009c4"),
        (
            "WRITE: sets cell high 1 to 3650 mV, cell high 2 to 3600 mV, cell low 1 to 2800 mV, cell low 2 to 2500 mV"
            "; by packet 1, cell high 2 was 3700 mV"
        ),
    ),
    "a switch": (
        a5(1, 0x93, "000101"),
        a5(0x80, 0xD9, "00"),
        (
            "WRITE: switches the discharge MOS off (01 is on, as every device seen has it; the vendor's article of 2024"
            " says 00); by packet 1, discharge MOS was on"
        ),
    ),
    "SOC": (
        a5(1, 0x90, "0213000075300384"),
        a5(0x40, 0x21, "00000000000003e8"),
        "WRITE: sets SOC to 100.0 %; by packet 1, SOC was 90.0 %",
    ),
    "SOC and clock, the SOC is known and the same": (
        a5(1, 0x90, "0213000075300384"),
        a5(0x40, 0x21, "1a030517320a0384"),
        "WRITE: sets clock to 2026-03-05 23:50:10, SOC to 90.0 %",
    ),
    "the clock that 0x61 told, behind which stand stale bytes": (
        a5(1, 0x61, "1a03051732090000"),
        a5(0x40, 0x21, "1a030517320a03e8"),
        ("WRITE: sets clock to 2026-03-05 23:50:10, SOC to 100.0 %; by packet 1, clock was 2026-03-05 23:50:09"),
    ),
    "no clock, and only 0x61 was heard": (
        a5(1, 0x61, "1a0305173209012c"),
        a5(0x40, 0x21, "00000000000003e8"),
        "WRITE: sets SOC to 100.0 %",
    ),
    "the same clock, and the SOC is not known": (
        a5(1, 0x61, "1a0305173209012c"),
        a5(0x40, 0x21, "1a0305173209012c"),
        "WRITE: sets clock to 2026-03-05 23:50:09, SOC to 30.0 %",
    ),
    "nothing new": (
        a5(1, 0x5F, "0ed80032"),
        a5(0x40, 0x1F, "0ed80032"),
        "WRITE: sets balance start to 3800 mV, balance difference to 50 mV; the same as in packet 1",
    ),
    "another board's": (
        a5(2, 0x5F, "0ed80032"),
        a5(0x40, 0x1F, "0ed80033"),
        "WRITE: sets balance start to 3800 mV, balance difference to 51 mV",
    ),
}


@pytest.mark.parametrize("name", BEFORE)
def test_a_write_says_what_it_would_change(dissect: Dissect, name: str) -> None:
    told, asked, words = BEFORE[name]
    assert expert(dissect([P(told), P(asked, 5)])[1]) == words


def test_a_switch_was_what_the_newest_93_or_answer_to_a_switch_told(dissect: Dissect) -> None:
    """The answer's byte 0 is the new state (field notes a.3). What changed is told of 93 by 93 (records.md 9)."""
    on, off = a5(0x40, 0xD9, "01"), a5(0x40, 0xD9, "00")
    frames = [
        a5(1, 0x93, "000101"),
        off,
        a5(1, 0xD9, "00"),
        on,  # packet 4: it was switched off
        off,  # and unanswered; 5
        a5(0x40, 0xDA, "01"),  # the other switch's answer tells nothing of this one; 6
        a5(1, 0x93, "000101"),
        on,  # packet 8: the 93 is newer
        a5(1, 0xD9, "0055"),  # denied; stale bytes behind the state
        on,  # packet 10
        a5(1, 0x93, "000100"),
    ]
    rows = dissect([P(frame, at) for at, frame in enumerate(frames)])
    notes = {number: expert(rows[number - 1]).partition("\x1f")[0] for number in (2, 4, 5, 6, 8, 10)}
    said = {number: note.partition("says 00)")[2] for number, note in notes.items()}
    assert said == {
        2: "; by packet 1, discharge MOS was on",
        4: "; by packet 3, discharge MOS was off",
        5: "; the same as in packet 3",
        6: "; the same as in packet 1",
        8: "; the same as in packet 7",
        10: "; by packet 9, discharge MOS was off",
    }
    assert [row.get("daly.changed") for row in rows] == [None] * 10 + [["discharge_mos"]]
    assert rows[10]["daly.changed_from"] == ["7"]


def test_writes_stand_out(sessions: dict[str, list[Row]]) -> None:
    assert info(sessions["21 of a real program"][0]) == (
        "WRITE board 1  0x21 Set Clock, SOC: sets clock to 2022-12-13 21:29:39, SOC to 30.0 %  [unanswered]"
    )
    assert info(sessions["what no table names"][0]) == "Reply board 1  0xAB unknown ID  01 00 00 00 00 00 00 00"


def test_bytes_of_the_head_are_hex(dissect: Dissect) -> None:
    """As the paper writes them (V1.2 2.3), and as they can be typed into a filter."""
    (row,) = dissect([P(a5(0x40, 0x90), 0)])
    head = ("start", "address", "data_id", "length", "checksum")
    assert [row[f"daly.{name}"] for name in head] == [["0xa5"], ["0x40"], ["0x90"], ["0x08"], ["0x7d"]]
