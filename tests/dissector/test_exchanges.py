# SPDX-License-Identifier: GPL-2.0-or-later
"""Requests, replies, echoes, retries: docs/records.md 5 to 7, by small examples worked out by hand."""

from __future__ import annotations

import pytest
from tests.dissector.dissection import FRAME_S, Dissect, P, Row, a5, expert, number

ASK = a5(0x40, 0x90)
ANSWER = "a501900802100000753001f4ea"


def directions(rows: list[Row]) -> list[float | None]:
    return [number(row, "direction") for row in rows]


@pytest.mark.parametrize(
    ("address", "direction", "board"),
    [
        (0x40, 1, 1), (0x41, 1, 2), (0x4F, 1, 16), (0x50, 1, None), (0x80, 1, None), (0x20, 1, None),
        (0x3F, 1, None), (0xFF, 1, None), (0x01, 2, 1), (0x10, 2, 16), (0x11, 2, None), (0x1F, 2, None),
        (0x00, 2, None),
    ],
)  # fmt: skip
def test_direction_and_board(dissect: Dissect, address: int, direction: int, board: int | None) -> None:
    row = dissect([P(a5(address, 0x90))])[0]
    assert number(row, "direction") == direction
    assert number(row, "board") == board


def test_reply_and_request_know_each_other(dissect: Dissect) -> None:
    rows = dissect([P(ASK), P(ANSWER, at=0.050)])
    assert number(rows[0], "reply_in") == 2
    assert number(rows[1], "request_in") == 1
    assert number(rows[1], "response_time") == pytest.approx(0.050 - FRAME_S, abs=1e-6)
    assert number(rows[0], "response_time") is None


def test_reply_in_needs_the_second_pass(dissect: Dissect) -> None:
    rows = dissect([P(ASK), P(ANSWER, at=0.050)], two_pass=False)
    assert number(rows[0], "reply_in") is None
    assert number(rows[1], "request_in") == 1


@pytest.mark.parametrize(("wait", "answered"), [(0.999, True), (1.001, False)])
def test_a_request_waits_a_second(dissect: Dissect, wait: float, answered: bool) -> None:
    rows = dissect([P(ASK), P(ANSWER, at=FRAME_S + wait)])
    assert (number(rows[1], "request_in") == 1) is answered


def test_two_replies_to_one_request(dissect: Dissect) -> None:
    """The first takes it; the second was not asked for."""
    rows = dissect([P(ASK), P(ANSWER, 0.05), P(ANSWER, 0.10)])
    assert number(rows[1], "request_in") == 1
    assert number(rows[2], "request_in") is None


def test_the_newest_request_is_answered_first(dissect: Dissect) -> None:
    rows = dissect([P(ASK), P(ASK, 0.3), P(ANSWER, 0.35), P(ANSWER, 0.40)])
    assert number(rows[2], "request_in") == 2
    assert number(rows[3], "request_in") == 1  # it waits still
    assert [number(row, "reply_in") for row in rows[:2]] == [4, 3]


def test_boards_are_told_apart_where_the_request_names_one(dissect: Dissect) -> None:
    """Board 1 answers what board 2 was asked; board 2 answers behind it (field notes b)."""
    second = "a50290" + "0802100000753001f4eb"
    rows = dissect([P(a5(0x41, 0x90)), P(ANSWER, 0.05), P(second, 0.07)])
    assert number(rows[1], "request_in") is None
    assert number(rows[2], "request_in") == 1


@pytest.mark.parametrize("host", [0x40, 0x80, 0x20])
def test_other_hosts_take_any_boards_reply(dissect: Dissect, host: int) -> None:
    rows = dissect([P(a5(host, 0x93)), P(a5(0x03, 0x93), 0.05)])
    assert number(rows[1], "request_in") == 1


@pytest.mark.parametrize(("after", "direction"), [(0.010, 3), (0.099, 3), (0.101, 1)])
def test_echo_within_a_tenth_of_a_second(dissect: Dissect, after: float, direction: int) -> None:
    rows = dissect([P(ASK), P(ASK, at=FRAME_S + after)])
    assert directions(rows) == [1, direction]
    assert (number(rows[1], "retry") == 1) is (direction == 1)
    assert ("Echo" in expert(rows[1])) is (direction == 3)


def test_one_echo_a_request_then_retries(dissect: Dissect) -> None:
    rows = dissect([P(ASK), P(ASK, 0.02), P(ASK, 0.04), P(ASK, 0.30), P(ASK, 0.35)])
    assert directions(rows) == [1, 3, 1, 1, 3]
    assert [number(row, "retry") for row in rows] == [None, None, 1, 1, None]


def test_an_answered_request_that_comes_again_is_the_next_poll(dissect: Dissect) -> None:
    rows = dissect([P(ASK), P(ANSWER, 0.03), P(ASK, 0.06), P(ANSWER, 0.09)])
    assert directions(rows) == [1, 2, 1, 2]
    assert number(rows[2], "retry") is None
    assert number(rows[3], "request_in") == 3


def test_a_request_that_nobody_waits_for_any_more_is_no_retry(dissect: Dissect) -> None:
    rows = dissect([P(ASK), P(ASK, 2.0)])
    assert directions(rows) == [1, 1]
    assert number(rows[1], "retry") is None


def test_an_echo_is_no_reply(dissect: Dissect) -> None:
    rows = dissect([P(ASK), P(ASK, 0.03), P(ANSWER, 0.06)])
    assert number(rows[0], "reply_in") == 3
    assert number(rows[2], "request_in") == 1
    assert "daly.pack.voltage" not in rows[1]


def test_with_two_taps_the_side_decides(dissect: Dissect) -> None:
    """Inbound and outbound of one bus: from the same side it is a retry however soon, from the other an echo."""
    same = dissect([P(ASK, 0, 0, 1), P(ASK, 0.03, 0, 1)])
    assert [number(row, "retry") for row in same] == [None, 1]
    other = dissect([P(ASK, 0, 0, 1), P(ASK, 0.3, 0, 2)])
    assert directions(other) == [1, 3]


@pytest.mark.parametrize(
    ("descriptions", "linked"),
    [
        (("dalyshark bus=one host side", "dalyshark bus=one, bms side"), True),
        (("dalyshark bus=one", "dalyshark bus=two"), False),
        (("dalyshark", "dalyshark"), False),
    ],
)
def test_interfaces_of_one_bus(dissect: Dissect, descriptions: tuple[str, str], linked: bool) -> None:
    rows = dissect([P(ASK, 0, 0), P(ANSWER, 0.05, 1)], descriptions=descriptions)
    assert (number(rows[1], "request_in") == 1) is linked


def test_several_interfaces_in_two_passes_without_a_filter(dissect: Dissect) -> None:
    """Then Lua cannot tell the interface in the first pass; the second must not mix the buses up."""
    packets = [P(ASK, 0, 0), P(ASK, 0.02, 1), P(ANSWER, 0.05, 0), P(ANSWER, 0.07, 1)]
    rows = dissect(packets, descriptions=("dalyshark bus=one", "dalyshark bus=two"), tree=False)
    assert directions(rows) == [1, 1, 2, 2]
    assert [number(row, "request_in") for row in rows[2:]] == [1, 2]


def test_what_a_frame_meant_is_taken_back_when_it_turns_out_to_be_none(dissect: Dissect) -> None:
    """A cut-off reply and the whole one behind it, cut so that the first 13 bytes sum up right by accident.

    When they are all there is, they are the frame, and answer the request. The rest shows that the reply began later.
    """
    whole = bytes.fromhex(ANSWER)
    head = bytes.fromhex("a50190080000") + whole[:6]
    first = (whole[6] - sum(head)) & 0xFF
    window = head[:4] + bytes((first,)) + head[5:] + whole[6:7]
    assert len(window) == 13
    assert sum(window[:12]) & 0xFF == window[12]
    packets = [P(ASK), P(window.hex(), 0.05), P(whole[7:].hex(), 0.05 + FRAME_S), P(a5(0x40, 0x91), 1)]
    alone = dissect(packets[:2])
    assert number(alone[0], "reply_in") == 2
    rows = dissect(packets)
    assert [row["daly.kind"] for row in rows] == [["frame"], ["short"], ["frame"], ["frame"]]
    assert number(rows[0], "reply_in") == 3
    assert number(rows[2], "request_in") == 1
    assert number(rows[2], "soc") == 50.0
    assert number(rows[2], "response_time") == pytest.approx(0.05 + 6 * 10 / 9600 - FRAME_S, abs=1e-6)


def test_response_time_within_one_packet_is_from_positions(dissect: Dissect) -> None:
    rows = dissect([P(ASK + ANSWER)])
    assert number(rows[0], "response_time") == pytest.approx(0.0, abs=1e-9)


def test_no_response_time_where_time_stamps_cannot_tell(dissect: Dissect) -> None:
    """The reply begins before the request has ended, by the clock of the reader."""
    rows = dissect([P(ASK), P(ANSWER, at=0.001)])
    assert number(rows[1], "request_in") == 1
    assert number(rows[1], "response_time") is None


@pytest.mark.parametrize(
    ("option", "packets", "field", "value"),
    [
        ("daly.echo:50", [P(ASK), P(ASK, FRAME_S + 0.06)], "direction", 1),
        ("daly.reply:100", [P(ASK), P(ANSWER, FRAME_S + 0.2)], "request_in", None),
        ("daly.baud:19200", [P(ASK), P(ANSWER, 0.05)], "response_time", 0.05 - 13 * 10 / 19200),
    ],
)
def test_constants_are_preferences(
    dissect: Dissect, option: str, packets: list[P], field: str, value: float | None
) -> None:
    rows = dissect(packets, options=[option])
    got = number(rows[1], field)
    assert got == value if value is None else got == pytest.approx(value, abs=1e-6)
