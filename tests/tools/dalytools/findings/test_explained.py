# SPDX-License-Identifier: GPL-2.0-or-later
"""What explains a finding that nobody put in, and what does not: frames by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.meaning_modbus import brings, read, rtu
from tests.tools.dalytools.findings.explained import explained
from tests.tools.dalytools.findings.heard import Frame, frames
from tests.tools.dalytools.findings.injected import EPOCH_NS, Heard, capture
from tests.tools.dalytools.findings.moments import Moment

from dalytools.findings.finding import Severity
from dalytools.findings.place import Place

if TYPE_CHECKING:
    from pathlib import Path

    from tests.tools.dalytools.findings.moments import Note


def heard(seconds: float, address: int, data_id: int, payload: str = "") -> Frame:
    return Frame(seconds, 13, address, data_id, bytes.fromhex(payload.ljust(16, "0")))


def counted(rule: str, seconds: float, board: int = 1, data_id: int | None = None, detail: str = "") -> Moment:
    return Moment(rule, Place(board=board, data_id=data_id, detail=detail), Severity.WARNING, seconds)


def test_damage_explains_only_where_it_is_a_good_frame() -> None:
    note = {"what": "damaged", "time": 1.5}
    assert explained(counted("late", 2.0, board=1), [heard(1.5, 1, 0x90)], [note], 1.5)
    assert not explained(counted("late", 2.0, board=1), [Frame(1.5, 13), heard(1.9, 1, 0x90)], [note], 1.5)
    before = heard(1.5 - 13 / 960 + 1e-6, 1, 0x90)
    assert not explained(counted("late", 2.0, board=1), [before, Frame(1.5, 13)], [note], 1.5)


def test_a_good_frame_by_accident_ends_a_burst() -> None:
    note = {"what": "damaged", "time": 1.0136}
    first, accident, third = heard(1.0, 1, 0x95, "01"), heard(1.0136, 1, 0x08), heard(1.0271, 1, 0x95, "03")
    says = counted("unasked", 1.0271, data_id=0x95)
    assert explained(says, [first, accident, third], [note], 1.5)
    assert not explained(says, [first, Frame(1.0136, 13), third], [note], 1.5)
    asked = accident._replace(address=0x40)
    assert not explained(says, [first, asked, third], [note], 1.5)
    fourth = counted("unasked", 1.0407, data_id=0x95)
    assert not explained(fourth, [first, accident, third, heard(1.0407, 1, 0x95, "04")], [note], 1.5)
    single = counted("unasked", 1.0271, data_id=0x90)
    assert not explained(single, [first, accident, heard(1.0271, 1, 0x90)], [note], 1.5)


def test_cells_that_came_by_accident_explain_until_there_is_a_newer_table() -> None:
    note = {"what": "damaged", "time": 2.0136}
    count, first, accident = heard(1, 1, 0x94, "0601"), heard(2, 1, 0x95, "010ce4"), heard(2.0136, 1, 0x95, "02ffff")
    part, rest = heard(3, 1, 0x95, "010ce4"), heard(3.0136, 1, 0x95, "020ce4")
    told = [count, first, accident, heard(2.5, 1, 0x96, "01"), part]

    def tells(frames: list[Frame], detail: str, board: int = 1) -> bool:
        says = [heard(4, 1, 0x91, "0d0d"), heard(4, 1, 0x92, "3c")]
        return explained(counted("contradiction", 4.0, board=board, detail=detail), [*frames, *says], [note], 11.0)

    assert tells(told, "cell_max")
    assert tells(told, "pack_voltage")
    assert not tells(told, "temperature_max")
    assert not tells(told, "cell_max", board=2)
    assert not tells([*told, rest], "cell_max")
    assert not tells([count, accident, part], "cell_max")  # in no table
    assert not tells([count, accident, part, rest], "cell_max")


def test_an_echo_is_explained_by_the_same_request_of_another_host() -> None:
    note = {"what": "unanswered", "time": 1.03, "why": "busy", "address": 0x43, "data_id": 0x90}
    both = [heard(1.0, 0x43, 0x90), heard(1.03, 0x43, 0x90)]
    assert explained(counted("echo", 1.03, board=4), both, [note], 1.5)
    assert not explained(counted("echo", 1.03, board=4), both[1:], [note], 1.5)
    assert not explained(counted("echo", 1.03, board=4), both, [{**note, "why": "silent"}], 1.5)


def test_an_echo_is_explained_by_the_same_request_said_into_another_frame() -> None:
    note = {"what": "collision", "time": 1.0, "heard": "ff" * 20, "harmed": True}
    both = [heard(1.0, 0x47, 0x90), heard(1.05, 0x47, 0x90)]
    assert explained(counted("echo", 1.05, board=8), both, [note], 1.5)
    assert not explained(counted("echo", 1.05, board=8), both, [{**note, "time": 1.05}], 1.5)
    assert not explained(counted("echo", 1.05, board=8), both, [], 1.5)
    assert not explained(counted("echo", 1.05, board=8), [heard(1.0, 0x47, 0x91), both[1]], [note], 1.5)


def test_harm_to_a_request_of_modbus_that_was_left_whole_explains_it_too() -> None:
    asked = Frame(1.0, 8, first=0x8C, modbus=True)
    note = {"what": "collision", "time": 1.0, "heard": "8c030178004a5b05209308", "harmed": True}
    says = Moment("unanswered", Place(board=12, register=0x178), Severity.WARNING, 1.0)
    assert explained(says, [asked], [note], 1.5)
    assert not explained(says, [asked], [{**note, "heard": "8c030000004a5b05209308"}], 1.5)
    assert not explained(says, [asked], [{**note, "harmed": False}], 1.5)


def test_an_exception_that_fits_another_request_too_leaves_both_unanswered() -> None:
    first, second = (Frame(seconds, 8, first=0xD2, modbus=True) for seconds in (0.6, 1.0))
    waits = {"what": "unanswered", "time": 0.6, "address": 3, "register": 0, "why": "damaged"}
    exception = {"what": "modbus_exception", "time": 1.0}
    says = Moment("unanswered", Place(address=0xD2, register=0xF0F0), Severity.WARNING, 1.0)
    assert explained(says, [first, second], [waits, exception], 1.5)
    assert not explained(says, [first, second], [exception], 1.5)
    assert not explained(says, [first, second], [waits], 1.5)
    assert not explained(says, [first._replace(first=0x81), second], [waits, exception], 1.5)


def test_a_sleep_is_explained_by_harm_to_the_request_that_it_counts() -> None:
    note = {"what": "damaged", "time": 1.05, "sent": "a504980800000000", "heard": "80a504980800000000"}
    says = counted("asleep", 1.0, board=4)
    assert explained(says, [heard(1.0, 0x43, 0x98)], [note], 1.5)
    assert not explained(says, [heard(1.0, 0x43, 0x90)], [note], 1.5)


def test_an_unanswered_request_is_explained_by_a_newer_one_that_took_its_reply() -> None:
    older, newer, reply = heard(1.0, 0x40, 0x90), heard(1.03, 0x20, 0x90), heard(1.08, 1, 0x90)
    note = {"what": "unanswered", "time": 1.03, "why": "busy", "address": 0x20, "data_id": 0x90}
    says = counted("unanswered", 1.0, data_id=0x90)
    assert explained(says, [older, newer, reply], [note], 1.5)
    assert not explained(says, [older, newer], [note], 1.5)
    assert not explained(says, [older, newer, reply, heard(1.1, 1, 0x90)], [note], 1.5)
    assert not explained(says, [older, newer, reply], [{**note, "why": "silent"}], 1.5)
    assert not explained(counted("unanswered", 1.0, data_id=0x93), [older, newer, reply], [note], 1.5)


def test_an_unanswered_request_is_explained_by_harm_to_its_exchange() -> None:
    asked, harmed = heard(1.0, 0x40, 0x90), "ff" + "a501900800c600007530018100"
    note = {"what": "damaged", "time": 1.05, "sent": harmed, "heard": harmed}
    says = counted("unanswered", 1.0, data_id=0x90)
    assert explained(says, [asked, Frame(1.05, 14)], [note], 1.5)
    assert not explained(says, [asked, Frame(1.05, 14)], [{**note, "time": 0.9}], 1.5)
    assert not explained(says, [asked, Frame(1.05, 14)], [{**note, "sent": harmed.replace("90", "93")}], 1.5)
    assert not explained(says, [asked, Frame(1.05, 14)], [{**note, "harmed": False}], 1.5)
    assert not explained(counted("late", 1.0, data_id=0x90), [asked, Frame(1.05, 14)], [note], 1.5)


def test_an_answer_to_a_write_to_d2_that_is_not_the_same_or_comes_twice_is_a_request() -> None:
    note = {"what": "write", "time": 1.0, "dialect": "d2", "register": 0xA5, "result": "denied"}
    asked, answer, again = (Frame(seconds, 8, modbus=True) for seconds in (1.0, 1.05, 1.1))
    says = Moment("unanswered", Place(address=0xD2, register=0xA5), Severity.WARNING, 1.1)
    assert explained(says, [asked, again], [note], 1.5)
    assert explained(says._replace(seconds=1.0), [asked, again], [note], 1.5)
    assert not explained(says._replace(seconds=1.4), [], [note], 1.5)
    assert not explained(says, [asked, again], [{**note, "register": 0xA6}], 1.5)
    confirmed = {**note, "result": "confirmed"}
    assert explained(says, [asked, answer, again], [confirmed], 1.5)
    assert not explained(says, [asked, again], [confirmed], 1.5)
    assert not explained(says._replace(seconds=1.0), [asked, answer, again], [confirmed], 1.5)


def test_zeros_right_behind_zeros_of_waking_up_are_not_told_from_them() -> None:
    note = {"what": "zero_reply", "time": 1.0, "board": 1, "data_id": 0x98}
    woke, other, true = heard(1.0, 1, 0x98), heard(1.2, 2, 0x90, "02"), heard(1.4, 1, 0xD8)
    says = counted("zero-reply", 1.4)
    assert explained(says, [woke, other, true], [note], 1.5)
    assert explained(says, [woke, heard(1.2, 1, 0x95, "01"), true], [note], 1.5)
    assert not explained(says, [woke, heard(1.2, 1, 0x90, "02"), true], [note], 1.5)
    assert not explained(says, [woke, true], [{**note, "board": 2}], 1.5)
    assert not explained(says, [woke, heard(1.4, 1, 0xD8, "01")], [note], 1.5)
    assert not explained(says, [true], [note], 1.5)


def test_an_answer_without_its_number_0_counts_from_1() -> None:
    note = {"what": "skipped_frame", "time": 3.0, "board": 1, "data_id": 0x95, "frame": 1}
    count = heard(1, 1, 0x94, "0601")
    usual = [heard(2, 1, 0x95, "000ce4"), heard(2.0136, 1, 0x95, "010ce4")]
    shifted = [heard(3.05, 1, 0x95, "010ce4"), heard(3.0636, 1, 0x95, "02")]
    says = counted("contradiction", 4.0, detail="cell_min")
    assert explained(says, [count, *usual, *shifted], [note], 11.0)
    assert not explained(says, [count, *shifted], [note], 11.0)  # no board that counts from 0
    assert not explained(says, [count, *usual, *shifted], [{**note, "board": 2}], 11.0)
    assert not explained(says, [count, *usual, heard(3.05, 1, 0x95, "000ce4"), *shifted], [note], 11.0)
    assert not explained(
        says._replace(place=Place(board=1, detail="temperature_min")), [count, *usual, *shifted], [note], 11
    )
    newer = [frame._replace(seconds=frame.seconds + 1.5) for frame in usual]
    assert not explained(says, [count, *usual, *shifted, *newer], [note], 11.0)
    lost = {"what": "damaged", "time": 3.04, "sent": "a5019508000ea80eab0eb60076", "heard": "a5011508"}
    assert explained(says, [count, *usual, *shifted], [lost], 11.0)  # an error frame on CAN
    assert not explained(says, [count, *usual, *shifted], [{**lost, "sent": "a5019508010ea80eab0eb60077"}], 11.0)


def test_a_reply_of_modbus_with_an_a5_frame_inside_falls_apart(tmp_path: Path) -> None:
    """Cells of 2.213 V: a5 08 a5 08, and with one of 2.214 V and no more cells the sum is right (records.md 3)."""
    reply = brings(*[0x08A1] * 8, 0x08A5, 0x08A5, 0x08A6, *[0] * 11)
    at, pieces = 1.05, (reply[: 2 * 20], reply[2 * 20 : 2 * 33], reply[2 * 33 :])
    packets = [Heard(1.0, read(0, 22))]
    for piece in pieces:
        packets.append(Heard(at, piece))
        at += len(piece) / 2 / 960
    apart = frames(
        capture(tmp_path / "apart.pcapng", [*packets, Heard(3.0, pieces[0]), Heard(3.1, pieces[1])]), EPOCH_NS
    )
    assert [frame.falls_apart for frame in apart] == [False, True, True, True, False, False]
    assert apart[2].good
    for rule, seconds, told in (("damaged", 1.05, True), ("unasked", 1.07, True), ("damaged", 3.0, False)):
        moment = Moment(rule, Place(), Severity.WARNING, seconds)
        assert explained(moment, apart, [], 1.5) is told
    asked = Moment("unanswered", Place(address=0xD2, register=0), Severity.WARNING, 1.0)
    assert explained(asked, apart, [], 1.5)
    assert not explained(asked._replace(place=Place(board=4, register=0)), apart, [], 1.5)
    assert not explained(asked._replace(seconds=2.5), apart, [], 1.5)


def test_a_reply_of_modbus_whose_first_bytes_are_a_request_falls_apart(tmp_path: Path) -> None:
    """Cells of a reply that are the CRC of the bytes before them (records.md 3: the window that ends first)."""
    first = bytes.fromhex(rtu("d2037c0e4c0e"))  # byte count 124, cells of 0E4C and of 0Exx
    reply = rtu((first + bytes(3 + 124 - len(first))).hex())
    assert len(reply) == 2 * (5 + 124)
    packets = [Heard(1.0, read(0, 62)), Heard(1.05, first.hex()), Heard(1.05 + 8 / 960, reply[16:])]
    apart = frames(capture(tmp_path / "apart.pcapng", packets), EPOCH_NS)
    assert [frame.falls_apart for frame in apart] == [False, True, True]


def test_a_request_that_another_host_repeats_within_100_ms_is_an_echo() -> None:
    note = {"what": "unanswered", "time": 1.0, "address": 0x40, "data_id": 0x93, "why": "busy"}
    both = [heard(1.0, 0x40, 0x93), heard(1.094, 0x40, 0x93)]
    assert explained(counted("echo", 1.094), both, [note], 1.5)
    assert not explained(counted("echo", 1.094), both, [{**note, "why": "silent"}], 1.5)
    two: list[Note] = [
        {**note, "why": "silent", "host": "host"},
        {**note, "why": "silent", "host": "monitor", "time": 1.094},
    ]
    assert explained(counted("echo", 1.094), both, two, 1.5)
    assert not explained(counted("echo", 1.2), [both[0], heard(1.2, 0x40, 0x93)], [note], 1.5)


def test_a_board_that_slept_tells_late_what_became_of_a_switch() -> None:
    written = {"what": "write", "time": 5.0, "data_id": 0xDA, "result": "confirmed"}
    says = counted("write-no-effect", 28.0, data_id=0xDA)
    before, soon, late = heard(4.0, 1, 0x93, "0201"), heard(6.8, 1, 0x93, "0201"), heard(28.0, 1, 0x93, "0201")
    assert explained(says, [before, soon, late], [written], 20.0)
    assert not explained(says, [before, soon, heard(9.0, 1, 0x93, "0201"), late], [written], 20.0)
    assert not explained(says, [before, soon, late], [{**written, "data_id": 0xD9}], 20.0)
    assert not explained(says, [before, soon, late], [{**written, "result": "denied"}], 20.0)
