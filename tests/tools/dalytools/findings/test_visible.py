# SPDX-License-Identifier: GPL-2.0-or-later
"""What hides a fault, and what does not: each reason has its bytes, and a real miss gets none. Frames by hand."""

from __future__ import annotations

from tests.tools.dalytools.findings.heard import Frame
from tests.tools.dalytools.findings.visible import hidden


def heard(seconds: float, address: int, data_id: int, payload: str = "") -> Frame:
    return Frame(seconds, 13, address, data_id, bytes.fromhex(payload.ljust(16, "0")))


def test_a_retry_takes_one_answer_and_leaves_the_next() -> None:
    note = {"what": "unanswered", "time": 1.0, "address": 0x45, "data_id": 0x94, "board": 6}
    frames = [heard(1.0, 0x45, 0x94), heard(1.6, 0x45, 0x94), heard(1.63, 6, 0x94)]
    assert not hidden(note, frames, [note])
    assert hidden(note, [*frames, heard(1.8, 6, 0x94)], [note])
    assert not hidden(note, [*frames, heard(1.8, 7, 0x94)], [note])


def test_40_takes_any_boards_reply() -> None:
    note = {"what": "unanswered", "time": 1.0, "address": 0x40, "data_id": 0x90, "board": 1}
    assert hidden(note, [heard(1.0, 0x40, 0x90), heard(1.5, 12, 0x90)], [note])


def test_the_frames_of_a_burst_are_one_answer() -> None:
    note = {"what": "unanswered", "time": 1.0, "address": 0x45, "data_id": 0x95, "board": 6}
    burst = [heard(1.63 + 0.0136 * number, 6, 0x95, f"{number:02x}") for number in range(1, 5)]
    assert not hidden(note, [heard(1.0, 0x45, 0x95), heard(1.6, 0x45, 0x95), *burst], [note])


def test_a_contradiction_needs_a_whole_table_that_is_near() -> None:
    note = {"what": "contradiction", "time": 5.0, "board": 1, "name": "cell_max", "data_id": 0x91}
    count, first, second = heard(1, 1, 0x94, "0601"), heard(2, 1, 0x95, "010ce4"), heard(2.0136, 1, 0x95, "020ce4")
    says = heard(5, 1, 0x91, "0d0d")
    assert not hidden(note, [count, first, second, says], [note])
    assert hidden(note, [count, first, says], [note])
    assert hidden({**note, "time": 15.0}, [count, first, second, says], [note])


def test_an_echo_of_another_host_is_no_request() -> None:
    note = {"what": "unanswered", "time": 1.03, "why": "busy", "address": 0x43, "data_id": 0x90, "board": 4}
    both = [heard(1.0, 0x43, 0x90), heard(1.03, 0x43, 0x90)]
    assert hidden(note, both, [note])
    assert not hidden(note, both[1:], [note])
    assert not hidden({**note, "why": "silent"}, both, [note])
    silent = {**note, "why": "silent", "host": "monitor"}
    assert hidden(silent, both, [{**silent, "time": 1.0, "host": "host"}, silent])
    assert not hidden(silent, both, [{**silent, "time": 1.0}, silent])  # its own
    assert not hidden(note, [frame._replace(size=16) for frame in both], [note])


def test_a_late_reply_that_a_newer_request_takes_is_not_late() -> None:
    note = {"what": "late", "time": 5.0, "board": 1, "data_id": 0x90, "delay_s": 1.5}
    newer, comes = heard(4.8, 0x40, 0x90), heard(5.0, 1, 0x90)
    assert hidden(note, [newer, comes], [note])
    assert not hidden(note, [comes], [note])
    assert not hidden(note, [newer, heard(4.85, 1, 0x90), comes], [note])
    assert not hidden(note, [heard(4.3, 0x40, 0x90), comes], [note])  # late for this one too
    assert not hidden(note, [heard(4.8, 0x41, 0x90), comes], [note])


def test_what_was_damaged_is_hidden_only_where_nothing_of_it_was_heard() -> None:
    note = {"what": "other_board", "time": 5.0, "board": 2, "data_id": 0x90}
    damaged = {"what": "damaged", "time": 5.0, "sender": "board 2"}
    assert hidden(note, [Frame(5.0, 13)], [note, damaged])
    assert not hidden(note, [Frame(5.0, 13)], [note, {**damaged, "sender": "board 1"}])
    assert not hidden(note, [Frame(5.0, 13)], [note, {**damaged, "time": 4.9}])
    assert not hidden(note, [heard(5.0, 2, 0x90)], [note, damaged])
    assert hidden(note, [Frame(5.0, 13), heard(5.25, 2, 0x90)], [note, damaged])  # the answer to a newer request
    repeated = {"what": "repeated_frame", "time": 5.0, "board": 2, "data_id": 0x95, "frame": 1}
    assert hidden(repeated, [heard(5.0, 2, 0x95, "01"), Frame(5.0136, 13)], [repeated, damaged])
    assert not hidden(repeated, [heard(5.0, 2, 0x95, "01"), heard(5.0136, 2, 0x95, "01")], [repeated, damaged])


def test_a_foreign_device_is_not_told_from_damage_in_the_same_gap() -> None:
    note, damaged = {"what": "foreign", "time": 5.0}, {"what": "damaged", "time": 5.1}
    theirs, harmed = Frame(5.0, 8), Frame(5.1, 9)
    assert hidden(note, [theirs, harmed], [note, damaged])
    assert not hidden(note, [theirs], [note])
    assert not hidden(note, [theirs, heard(5.05, 1, 0x90), harmed], [note, damaged])
    assert not hidden(note, [theirs, Frame(5.05, 8, modbus=True), harmed], [note, damaged])
    assert not hidden(note, [theirs, Frame(5.3, 9)], [note, {**damaged, "time": 5.3}])  # silence between
    before = [Frame(4.9, 9), theirs]
    assert hidden(note, before, [{**damaged, "time": 4.9}, note])
    assert not hidden(note, before, [{**damaged, "time": 4.9, "harmed": False}, note])


def test_damage_that_left_nothing_is_no_good_frame() -> None:
    note = {"what": "damaged", "time": 5.0, "heard": "a501"}
    assert hidden(note, [heard(5.0, 1, 0x90)], [note])
    assert not hidden(note, [heard(6.0, 1, 0x90)], [note])
    collision = {**note, "what": "collision"}
    assert hidden(collision, [Frame(4.97, 87, first=0xD2, modbus=True)], [collision])
    assert not hidden(collision, [Frame(4.97, 87, first=0xD2)], [collision])


def test_a_reply_that_two_speaking_at_once_left_whole_is_one() -> None:
    note = {"what": "unanswered", "time": 1.0, "address": 3, "register": 0, "why": "damaged"}
    collision = {"what": "collision", "time": 1.02, "heard": "a5209008" + "00" * 8 + "51" * 20}
    asked, reply = Frame(1.0, 8, first=0x81, modbus=True), Frame(1.0325, 20, first=0x51, modbus=True)
    assert hidden(note, [asked, Frame(1.02, 12, first=0xA5), reply], [note, collision])
    assert not hidden(note, [asked, Frame(1.02, 32, first=0xA5)], [note, collision])
    assert not hidden(note, [asked, reply._replace(modbus=False)], [note, collision])
    assert not hidden(note, [asked, reply._replace(first=0x52)], [note, collision])
    assert not hidden(note, [asked, reply._replace(seconds=1.1)], [note, collision])
    assert not hidden(note, [asked, reply], [note])
    later = [{**collision, "time": 1.04}]
    assert hidden(note, [asked, reply], [note, *later])  # the other began in its midst
    assert not hidden(note, [asked, reply._replace(modbus=False)], [note, *later])


def test_a_request_whose_first_bytes_are_of_a_frame_by_accident_is_none() -> None:
    note = {"what": "unanswered", "time": 1.08, "address": 3, "register": 0}
    damaged = {"what": "damaged", "time": 1.0}
    accident, rest, asked = heard(1.0, 0x40, 0x95), Frame(1.082, 6, first=0), Frame(1.08, 8, first=0x81, modbus=True)
    assert hidden(note, [accident, rest], [damaged, note])
    assert not hidden(note, [accident, asked], [damaged, note])
    assert not hidden(note, [accident, rest], [note])
    assert not hidden(note, [Frame(1.0, 11, first=0xA5), rest], [damaged, note])
    assert not hidden(note, [accident, Frame(1.03, 5), rest], [damaged, note])


def test_a_late_reply_of_modbus_that_was_damaged_is_hidden() -> None:
    note = {"what": "late", "time": 5.0, "board": 5, "register": 0}
    damaged = {"what": "damaged", "time": 5.0, "sender": "board 5"}
    reply = Frame(5.0, 133, first=0x55, modbus=True)
    assert hidden(note, [reply._replace(modbus=False)], [note, damaged])
    assert not hidden(note, [reply], [note, damaged])
    assert not hidden(note, [reply._replace(modbus=False)], [note])


def test_a_late_reply_of_modbus_answers_the_newer_request() -> None:
    newer = {"what": "unanswered", "time": 4.8, "board": 5, "register": 0, "why": "damaged"}
    late = {"what": "late", "time": 5.0, "board": 5, "register": 0, "delay_s": 1.5}
    reply = Frame(5.0, 133, first=0x55, modbus=True)
    assert hidden(newer, [reply], [newer, late])
    assert hidden(late, [reply], [newer, late])
    assert not hidden(newer, [reply._replace(modbus=False)], [newer, late])
    assert not hidden(newer, [reply], [newer])
    assert not hidden(newer, [reply], [newer, {**late, "register": 40}])
    assert not hidden(newer, [reply], [newer, {**late, "board": 6}])
    assert not hidden(late, [reply], [late])
    assert not hidden(late, [reply], [{**newer, "time": 3.5}, late])
    own = {**newer, "why": "late"}
    assert not hidden(own, [reply], [own, late])


def test_a_late_reply_whose_request_was_given_another() -> None:
    """80 takes any board's: one that comes late for another request takes it."""
    note = {"what": "late", "time": 5.0, "board": 1, "data_id": 0x98, "delay_s": 1.4}
    asked, other, late = heard(3.55, 0x80, 0x98), heard(3.57, 7, 0x98), heard(5.0, 1, 0x98)
    assert hidden(note, [asked, other, late], [note])
    assert not hidden(note, [asked, late], [note])
    assert not hidden(note, [asked._replace(address=0x41), other, late], [note])
    assert not hidden(note, [asked._replace(seconds=3.2), other, late], [note])


def test_a_number_of_a_cell_needs_a_count() -> None:
    note = {"what": "contradiction", "time": 5.0, "board": 1, "name": "sensor_number", "data_id": 0x92}
    says = heard(5, 1, 0x92, "3e043c02")
    assert hidden(note, [says], [note])
    assert hidden(note, [heard(1, 1, 0x94, "1800"), says], [note])
    assert hidden(note, [heard(1, 2, 0x94, "1803"), says], [note])
    assert hidden(note, [says, heard(6, 1, 0x94, "1803")], [note])
    assert not hidden(note, [heard(1, 1, 0x94, "1803"), says], [note])


def test_a_reply_behind_noise_is_an_error_frame_on_can() -> None:
    note = {"what": "fault_raised", "time": 5.0, "board": 1, "name": "eeprom"}
    noise = {"what": "damaged", "time": 4.983, "sender": "board 1", "heard": "5ba501980800"}
    assert hidden(note, [heard(4.9, 0x40, 0x98)], [noise, note])
    assert not hidden(note, [heard(4.9, 0x40, 0x98), heard(4.987, 1, 0x98)], [noise, note])
    assert not hidden(note, [heard(4.9, 0x40, 0x98)], [{**noise, "heard": "a5015b980800"}, note])
    assert not hidden(note, [heard(4.9, 0x40, 0x98)], [{**noise, "time": 4.9}, note])
    assert not hidden(note, [heard(4.9, 0x40, 0x98)], [note])


def test_a_foreign_device_right_behind_damage_may_end_a_frame_by_accident() -> None:
    """Ten bytes of a reply and the meter's first three sum up right."""
    note, damaged = {"what": "foreign", "time": 5.0}, {"what": "damaged", "time": 4.957}
    accident, rest = heard(4.957, 15, 0x95, "030c0000009c0103"), Frame(5.003, 14, first=0)
    assert hidden(note, [accident, rest], [damaged, note])
    assert not hidden(note, [accident, Frame(5.0, 17, first=1)], [damaged, note])
    assert not hidden(note, [accident, rest], [note])


def test_noise_at_the_beginning_may_be_the_end_of_a_frame() -> None:
    note = {"what": "damaged", "time": 0.0, "heard": "70fd8ea549"}
    noise, asked = Frame(0.0, 3, first=0x70), heard(0.003, 0x49, 0x90)
    assert hidden(note, [noise, asked], [note])
    assert not hidden({**note, "heard": "a54990"}, [noise, asked], [note])
    assert not hidden({**note, "time": 1.0}, [asked, noise._replace(seconds=1.0)], [note])


def test_an_echo_behind_another_boards_answer_is_a_request() -> None:
    note = {"what": "echo", "time": 5.12, "address": 0x4B, "data_id": 0x96}
    asked, other, echo = heard(5.0, 0x4B, 0x96), heard(5.1, 1, 0x96), heard(5.12, 0x4B, 0x96)
    assert hidden(note, [asked, other, echo], [note])
    assert not hidden({**note, "time": 5.1}, [asked, echo._replace(seconds=5.1)], [note])
    assert not hidden(note, [echo], [note])


def test_a_burst_of_which_nothing_came_shows_no_hole() -> None:
    note = {"what": "skipped_frame", "time": 5.0, "board": 16, "data_id": 0x95, "frame": 1}
    damaged = {"what": "damaged", "time": 5.09, "sender": "board 16"}
    assert hidden(note, [heard(5.6, 16, 0x95, "01")], [note, damaged])
    assert not hidden(note, [heard(5.09, 16, 0x95, "02")], [note, damaged])
    assert not hidden(note, [heard(5.6, 16, 0x95, "01")], [note])


def test_a_state_that_changed_explains_a_voltage() -> None:
    """0x93 tells charging, discharging or neither (records.md 11)."""
    note = {"what": "contradiction", "time": 5.0, "board": 1, "name": "cell_max", "data_id": 0x91}
    table = [heard(1, 1, 0x94, "0601"), heard(6, 1, 0x95, "010ce4"), heard(6.0136, 1, 0x95, "020ce4")]
    before, after = heard(4, 1, 0x93, "020101"), heard(5.5, 1, 0x93, "000100")
    says = heard(4.98, 1, 0x91, "0d0d")
    assert hidden(note, [table[0], before, says, after, *table[1:]], [note])
    assert not hidden(note, [table[0], before, says, after._replace(payload=before.payload), *table[1:]], [note])
    assert not hidden(note, [table[0], before, says, after._replace(address=2), *table[1:]], [note])


def test_a_request_that_is_an_error_frame() -> None:
    note = {"what": "unanswered", "time": 5.0, "address": 0x4B, "data_id": 0xD8, "why": "damaged"}
    damaged = {"what": "damaged", "time": 5.0, "heard": "a54bd8"}
    assert hidden(note, [], [note, damaged])
    assert hidden(note, [Frame(5.0, 16)], [note, damaged])
    assert not hidden(note, [heard(5.0, 0x4B, 0xD8)], [note, damaged])
    assert not hidden(note, [Frame(5.0, 16)], [note])


def test_damage_right_behind_damage_is_of_the_same_record() -> None:
    """A reply of 153 bytes and, less than 250 ms later, one byte: one packet, 0.4 s from beginning to beginning."""
    first = {"what": "damaged", "time": 5.0, "heard": "51" * 153}
    note = {"what": "damaged", "time": 5.4, "heard": "a5"}
    asked, both = heard(4.9, 0x40, 0x90), Frame(5.0, 154, first=0x51)
    assert hidden(note, [asked, both], [first, note])
    assert not hidden({**note, "time": 5.5}, [asked, both], [first, note])  # silence
    assert not hidden(note, [asked, both._replace(modbus=True)], [first, note])
    assert not hidden(note, [asked, both._replace(size=153), Frame(5.4, 1, first=0xA5)], [first, note])
    assert not hidden(note, [asked, both], [note])
