# SPDX-License-Identifier: GPL-2.0-or-later
"""What hides a fault, and what does not: each reason has its bytes, and a real miss gets none. Frames by hand."""

from __future__ import annotations

from tests.tools.dalytools.findings.visible import Frame, explained, hidden


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


def test_a_frame_left_out_and_doubled_comes_once() -> None:
    repeated = {"what": "repeated_frame", "time": 1.0, "board": 1, "data_id": 0x95, "frame": 1}
    skipped = {**repeated, "what": "skipped_frame"}
    once, again = heard(1.0, 1, 0x95, "01"), heard(1.0136, 1, 0x95, "01")
    assert hidden(repeated, [once], [repeated, skipped])
    assert hidden(skipped, [once], [repeated, skipped])
    assert not hidden(repeated, [once], [repeated])
    assert not hidden(repeated, [once, again], [repeated, skipped])


def test_damage_explains_only_where_it_is_a_good_frame() -> None:
    note = {"what": "damaged", "time": 1.5}
    assert explained("late", 1, 2.0, [heard(1.5, 1, 0x90)], [note], 1.5)
    assert not explained("late", 1, 2.0, [Frame(1.5, 13), heard(1.9, 1, 0x90)], [note], 1.5)
    before = heard(1.5 - 13 / 960 + 1e-6, 1, 0x90)
    assert not explained("late", 1, 2.0, [before, Frame(1.5, 13)], [note], 1.5)


def test_cells_that_came_by_accident_explain_until_there_is_a_newer_table() -> None:
    note = {"what": "damaged", "time": 2.0136}
    count, first, accident = heard(1, 1, 0x94, "0601"), heard(2, 1, 0x95, "010ce4"), heard(2.0136, 1, 0x95, "02ffff")
    part, rest = heard(3, 1, 0x95, "010ce4"), heard(3.0136, 1, 0x95, "020ce4")
    told = [count, first, accident, heard(2.5, 1, 0x96, "01"), part]

    def tells(frames: list[Frame], detail: str, board: int = 1) -> bool:
        says = [heard(4, 1, 0x91, "0d0d"), heard(4, 1, 0x92, "3c")]
        return explained("contradiction", board, 4.0, [*frames, *says], [note], 11.0, detail)

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
    assert explained("echo", 4, 1.03, both, [note], 1.5)
    assert not explained("echo", 4, 1.03, both[1:], [note], 1.5)
    assert not explained("echo", 4, 1.03, both, [{**note, "why": "silent"}], 1.5)
