# SPDX-License-Identifier: GPL-2.0-or-later
"""Requests, echoes, retries and replies: docs/records.md, sections 5 to 7, each rule by example."""

from __future__ import annotations

import pytest
from tests.tools.dalyref.traffic import FRAME_MS, Capture, frame

from dalyref import addresses
from dalyref.decoder import Options

ASK = frame(0x40, 0x90)
ANSWER = frame(0x01, 0x90, 0, 0xF8, 0, 0, 0x75, 0x30, 1, 0x81)
REQUEST, REPLY, ECHO = 1, 2, 3


@pytest.mark.parametrize(
    ("address", "request_", "board"),
    [
        (0x40, True, 1), (0x41, True, 2), (0x4F, True, 16), (0x80, True, 0), (0x20, True, 0), (0x50, True, 0),
        (0xFF, True, 0), (0x3F, True, 0), (0x01, False, 1), (0x10, False, 16), (0x00, False, 0), (0x11, False, 0),
        (0x1F, False, 0),
    ],
)  # fmt: skip
def test_addresses(address: int, *, request_: bool, board: int) -> None:
    assert addresses.is_request(address) is request_
    assert addresses.board(address) == board
    capture = Capture()
    capture.put(0, frame(address, 0xD8))
    assert capture.field("daly.direction") == [REQUEST if request_ else REPLY]
    assert capture.field("daly.board") == [board or None]


def test_request_and_reply_find_each_other() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(50, ANSWER)
    request, reply = capture.read()
    assert request.fields["daly.reply_in"] == 2
    assert reply.fields["daly.request_in"] == 1
    # 50 ms less the request's 13 characters at 9600 baud
    assert reply.fields["daly.response_time"] == pytest.approx(0.050 - 130 / 9600, abs=2e-9)
    assert "daly.response_time" not in request.fields
    assert "daly.retry" not in request.fields


def test_response_time_inside_one_packet_is_from_the_baud_rate() -> None:
    capture = Capture()
    capture.put(0, ASK + b"\x00" + ANSWER)  # one character lies between
    request, _junk, reply = capture.read()
    assert request.fields["daly.reply_in"] == 1
    assert reply.fields["daly.response_time"] == pytest.approx(10 / 9600, abs=2e-9)
    capture = Capture()
    capture.put(0, ASK)
    capture.put(50, ANSWER)
    slow = capture.read(Options(baud=19200))[1]
    assert slow.fields["daly.response_time"] == pytest.approx(0.050 - 130 / 19200, abs=2e-9)


def test_negative_response_time_is_none() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(10, ANSWER)  # the request ends at 13.5
    reply = capture.read()[1]
    assert reply.fields["daly.request_in"] == 1
    assert "daly.response_time" not in reply.fields


@pytest.mark.parametrize(("after", "waits"), [(999, True), (1000, True), (1000.0005, True), (1001, False)])
def test_request_waits_for_a_second(after: float, *, waits: bool) -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(FRAME_MS + after, ANSWER)
    assert capture.field("daly.request_in") == [None, 1 if waits else None]
    assert capture.field("daly.reply_in") == [2 if waits else None, None]


def test_second_reply_has_no_request() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(50, ANSWER)
    capture.put(70, ANSWER)
    assert capture.field("daly.request_in") == [None, 1, None]
    assert capture.field("daly.reply_in") == [2, None, None]


def test_reply_of_another_id_answers_nothing() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(50, frame(1, 0x91))
    assert capture.field("daly.request_in") == [None, None]


def test_newest_request_first() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(50, frame(0x80, 0x90))
    capture.put(100, ANSWER)
    capture.put(120, ANSWER)
    assert capture.field("daly.request_in") == [None, None, 2, 1]
    assert capture.field("daly.reply_in") == [4, 3, None, None]


def test_board_address_takes_its_own_reply_only() -> None:
    capture = Capture()
    capture.put(0, frame(0x40, 0x90))
    capture.put(50, frame(0x41, 0x90))
    capture.put(100, frame(0x03, 0x90))  # any board's for 40
    capture.put(120, frame(0x01, 0x90))  # not for 41
    capture.put(140, frame(0x02, 0x90))
    assert capture.field("daly.request_in") == [None, None, 1, None, 2]
    assert capture.field("daly.board") == [1, 2, 3, 1, 2]


@pytest.mark.parametrize("host", [0x40, 0x80, 0x20, 0x60])
def test_others_take_any_board_s(host: int) -> None:
    capture = Capture()
    capture.put(0, frame(host, 0x90))
    capture.put(50, frame(0x07, 0x90))
    assert capture.field("daly.request_in") == [None, 1]


# -- echo and retry ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("after", "direction"), [(0, ECHO), (40, ECHO), (100, ECHO), (100.5, REQUEST)])
def test_echo_within_100_ms_of_the_end(after: float, direction: int) -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(FRAME_MS + after, ASK)
    assert capture.field("daly.direction") == [REQUEST, direction]
    assert capture.field("daly.retry") == [None, True if direction == REQUEST else None]
    echo = capture.read()[1]
    assert "daly.pack.voltage" not in echo.fields


def test_echo_is_no_reply_and_does_not_wait() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(30, ASK)
    capture.put(80, ANSWER)
    capture.put(100, ANSWER)
    assert capture.field("daly.direction") == [REQUEST, ECHO, REPLY, REPLY]
    assert capture.field("daly.request_in") == [None, None, 1, None]
    assert capture.field("daly.reply_in") == [3, None, None, None]


def test_one_echo_only_then_retries() -> None:
    capture = Capture()
    for ms in (0, 20, 40, 60):
        capture.put(ms, ASK)
    # 1 echo of packet 1 (packet 2); packet 3 is a retry of 1; packet 4 comes soon after 3, which has no echo yet
    assert capture.field("daly.direction") == [REQUEST, ECHO, REQUEST, ECHO]
    assert capture.field("daly.retry") == [None, None, True, None]


def test_retry_waits_in_its_own_right_and_the_first_goes_on() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(500, ASK)
    capture.put(600, ANSWER)
    capture.put(620, ANSWER)
    assert capture.field("daly.retry") == [None, True, None, None]
    assert capture.field("daly.request_in") == [None, None, 2, 1]


def test_next_poll_is_neither_echo_nor_retry() -> None:
    capture = Capture()
    for ms in (0, 70, 140):  # a client that polls every 70 ms
        capture.put(ms, ASK)
        capture.put(ms + 30, ANSWER)
    assert capture.field("daly.direction") == [REQUEST, REPLY] * 3
    assert capture.field("daly.retry") == [None] * 6
    assert capture.field("daly.request_in") == [None, 1, None, 3, None, 5]


def test_repeat_after_a_second_is_a_new_request() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(FRAME_MS + 1001, ASK)
    assert capture.field("daly.direction") == [REQUEST, REQUEST]
    assert capture.field("daly.retry") == [None, None]


def test_other_bytes_are_no_repeat() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(20, frame(0x40, 0x90, 0xAA))
    assert capture.field("daly.direction") == [REQUEST, REQUEST]
    assert capture.field("daly.retry") == [None, None]


def test_the_side_decides() -> None:
    capture = Capture()
    capture.put(0, ASK, side="outbound")
    capture.put(20, ASK, side="outbound")  # the same side: never an echo
    assert capture.field("daly.direction") == [REQUEST, REQUEST]
    assert capture.field("daly.retry") == [None, True]
    capture = Capture()
    capture.put(0, ASK, side="outbound")
    capture.put(900, ASK, side="inbound")  # the other side: an echo at any time while it waits
    capture.put(950, ASK, side="inbound")
    assert capture.field("daly.direction") == [REQUEST, ECHO, ECHO]
    capture = Capture()
    capture.put(0, ASK, side="outbound")
    capture.put(1100, ASK, side="inbound")  # it waits no longer
    assert capture.field("daly.direction") == [REQUEST, REQUEST]
    capture = Capture()
    capture.put(0, ASK, side="outbound")
    capture.put(20, ASK)  # one side is not known: time decides
    assert capture.field("daly.direction") == [REQUEST, ECHO]


# -- buses ------------------------------------------------------------------------------------------------------------


def test_interfaces_are_buses_of_their_own() -> None:
    capture = Capture()
    capture.put(0, ASK, 0)
    capture.put(50, ANSWER, 1)
    assert capture.field("daly.request_in") == [None, None]


@pytest.mark.parametrize(
    ("first", "second", "joined"),
    [
        ("dalyshark bus=garage 9600 8N1", "dalyshark bus=garage", True),
        ("bus=a,tap", "x bus=a;y", True),
        ("bus=a", "bus=b", False),
        ("dalyshark", "dalyshark", False),
        ("bus= a", "bus= a", False),
    ],
)
def test_the_name_of_the_bus_joins_interfaces(first: str, second: str, *, joined: bool) -> None:
    capture = Capture()
    capture.put(0, ASK, 0, first)
    capture.put(50, ANSWER, 1, second)
    assert capture.field("daly.request_in") == [None, 1 if joined else None]


def test_damaged_frames_change_nothing() -> None:
    capture = Capture()
    capture.put(0, ASK)
    capture.put(50, ANSWER[:-1] + b"\x00")
    capture.put(70, ANSWER)
    assert capture.field("daly.kind") == ["frame", "bad_checksum", "frame"]
    assert capture.field("daly.request_in") == [None, None, 1]


def test_a_fault_log_in_several_frames_answers_one_request() -> None:
    """Field notes a.2: 0x64 comes in four frames an entry, which nothing numbers."""
    capture = Capture()
    capture.put(0, frame(0x40, 0x64))
    for ms in (50, 70, 90):
        capture.put(ms, frame(0x01, 0x64, 1))
    capture.put(900, frame(0x01, 0x64, 1))
    request, first, *later, beyond = (record.fields for record in capture.read())
    assert request["daly.reply_in"] == 2
    assert "daly.response_time" in first
    assert [fields["daly.request_in"] for fields in (first, *later)] == [1, 1, 1]
    assert not any("daly.response_time" in fields or "daly.unasked" in fields for fields in later)
    assert beyond["daly.unasked"] is True
    assert "daly.request_in" not in beyond
