# SPDX-License-Identifier: GPL-2.0-or-later
"""What a scenario asks for is on the wire, when it was asked for, and the truth tells it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

from dalytools.simulator.bus import Bus
from dalytools.simulator.capture_file import heard
from dalytools.simulator.harm import overlaid
from dalytools.simulator.scenario import Event
from dalytools.simulator.scenario_file import parsed, read_scenario, ready_made
from dalytools.simulator.truth import KINDS, Truth

if TYPE_CHECKING:
    from dalytools.simulator.scenario import Scenario
    from dalytools.simulator.sent import Sent

Notes = list[dict[str, object]]


def run(scenario: Scenario | str, seconds: float = 20.0) -> tuple[list[Sent], Notes]:
    made = parsed(scenario, "test") if isinstance(scenario, str) else scenario
    bus = Bus(made, truth=Truth(on=True))
    sent = list(heard(bus, int(seconds * 1e9)))
    notes: Notes = [dict(note) for note in bus.truth.notes]
    assert {note["what"] for note in notes} <= set(KINDS)
    return sent, notes


def of(notes: Notes, what: str) -> Notes:
    return [note for note in notes if note["what"] == what]


def good(data: bytes) -> bool:
    return len(data) == 13 and data[0] == 0xA5 and data[3] == 8 and sum(data[:12]) & 0xFF == data[12]


def replies(sent: list[Sent], data_id: int) -> list[Sent]:
    return [piece for piece in sent if piece.sender.startswith("board") and piece.data[2] == data_id]


def test_every_scenario_is_the_same_twice_and_one_at_a_time() -> None:
    for name, scenario in ready_made().items():
        sent, notes = run(scenario, 12)
        assert (sent, notes) == run(scenario, 12), name
        for before, after in pairwise(sent):
            assert after.time_ns >= before.time_ns + len(before.data) * 10**10 / 9600 - 2e6, name


def test_clean_scenarios_are_clean() -> None:
    for name, scenario in ready_made().items():
        if name.startswith("clean-"):
            sent, notes = run(scenario, 30)
            assert not notes, name
            assert len(sent) > 100


def test_faults_are_set_and_seen() -> None:
    sent, notes = run(read_scenario("faults"), 60)
    assert [(round(float(str(n["time"]))), n["name"]) for n in of(notes, "fault_set")] == [
        (10, "cell_volt_high_level_1"),
        (20, "cell_volt_high_level_2"),
        (40, "cell_temp_sensor"),
        (40, "short_circuit_protect"),
    ]
    bits: list[tuple[float, bytes]] = []
    for piece in replies(sent, 0x98):
        if not bits or bits[-1][1] != piece.data[4:12]:
            bits.append((piece.time_ns / 1e9, piece.data[4:12]))
    assert [data.hex() for _, data in bits] == [  # paper, section 3: byte 0 bits 0, 1; byte 5 bit 2, byte 6 bit 2
        "0000000000000000",
        "0100000000000000",
        "0300000000000000",
        "0100000000000000",
        "0100000000040400",
        "0000000000000000",
    ]
    raised = of(notes, "fault_raised") + of(notes, "fault_cleared")
    assert len(raised) == 8
    for note in raised:
        assert any(0 <= float(str(note["time"])) - at < 0.1 for at, _ in bits[1:])
    assert not of(notes, "fault_present")


def test_wrong_address_is_never_answered() -> None:
    sent, notes = run(read_scenario("no-reply-wrong-address"), 60)
    lost = [piece for piece in sent if piece.sender == "inverter"]
    assert {piece.data[1] for piece in lost} == {0x40}
    assert len(lost) == len(of(notes, "unanswered")) > 30
    assert {note["why"] for note in of(notes, "unanswered")} == {"no such board"}
    assert min(piece.time_ns for piece in sent if piece.sender == "board 2") > 41e9


def test_sleeping_echo_silence_zero_replies() -> None:
    sent, notes = run(read_scenario("sleeping"), 60)
    for before, after in pairwise(sent):
        second = before.time_ns / 1e9
        if before.sender == "host" and 10 < second < 24.5:
            assert (after.sender, after.data) == ("board 1", before.data)
        if 25.1 < second < 39:
            assert before.sender == "host"
    assert len(of(notes, "zero_reply")) == 10
    awake = [piece for piece in sent if piece.sender == "board 1" and piece.time_ns > 40e9]
    assert not any(awake[0].data[4:12])
    assert any(piece.data[4:12] != bytes(8) for piece in awake[-10:])
    why = [note["why"] for note in of(notes, "unanswered")]
    assert set(why) == {"echo", "asleep"}
    assert why.count("echo") == len(of(notes, "echo"))


def test_bursts_cut_skipped_repeated() -> None:
    sent, notes = run(read_scenario("burst-cut"), 60)
    bursts: list[list[int]] = []
    for before, after in pairwise(sent):
        if after.sender == "board 1" and after.data[2] == 0x95:
            if before.sender == "host":
                bursts.append([])
            bursts[-1].append(after.data[4])
    odd = [burst for burst in bursts if burst != [1, 2, 3, 4, 5, 6]]
    assert odd == [[1, 2, 3], [1, 2, 3, 5, 6], [1, 2, 2, 3, 4, 5, 6]]
    assert [note["what"] for note in notes] == ["cut_burst", "skipped_frame", "repeated_frame"]


def test_tampering_is_by_the_place_in_the_whole_burst() -> None:
    """One that was left out does not come twice, and none behind the cut; a late answer's notes are with it."""
    made = read_scenario("burst-cut")
    events = (
        Event(5, "repeat_frame", 1, frames=3, data_id=0x95),
        Event(5, "skip_frame", 1, frames=4, data_id=0x95),
        Event(5, "cut_burst", 1, frames=5, data_id=0x95),
        Event(5, "repeat_frame", 1, frames=4, data_id=0x95),
        Event(5, "repeat_frame", 1, frames=6, data_id=0x95),
        Event(5, "late", 1, data_id=0x95, delay_ms=1500),
    )
    sent, notes = run(replace(made, events=events), 10)
    (late,) = of(notes, "late")
    done = [
        (note["what"], note.get("frame", note.get("sent")), note["time"])
        for note in notes
        if "of" in note or "frame" in note
    ]
    time = late["time"]
    assert done == [("skipped_frame", 4, time), ("cut_burst", 4, time), ("repeated_frame", 3, time)]
    said = [piece.data[4] for piece in replies(sent, 0x95) if 0 <= piece.time_ns / 1e9 - float(str(time)) < 0.1]
    assert said == [1, 2, 3, 3, 5]


def test_late_replies_come_in_between() -> None:
    sent, notes = run(read_scenario("late-replies"), 60)
    late = of(notes, "late")
    assert [n["data_id"] for n in late] == [0x90, 0x93]
    assert all(1.5 <= float(str(n["delay_s"])) < 1.7 for n in late)  # it waits until the line is free
    assert [(n["data_id"], n["why"]) for n in of(notes, "unanswered")] == [(0x90, "late"), (0x93, "late")]
    for note, asked in zip(late, of(notes, "unanswered"), strict=True):
        begins, began = float(str(note["time"])), float(str(asked["time"]))
        assert 1.5 < begins - began < 1.8
        (piece,) = [p for p in replies(sent, int(str(note["data_id"]))) if p.time_ns == round(begins * 1e9)]
        before = [p for p in sent if began * 1e9 < p.time_ns < piece.time_ns]
        assert before  # something else was asked meanwhile
        assert before[-1].data[2] != piece.data[2]


def test_another_board_answers_first() -> None:
    sent, notes = run(read_scenario("wrong-board-answers"), 60)
    assert [(n["board"], n["asked"]) for n in of(notes, "other_board")] == [(1, 2), (1, 2)]
    runs = [
        (asked.data[1], one.sender, two.sender)
        for asked, one, two in zip(sent, sent[1:], sent[2:], strict=False)
        if asked.sender == "host" and two.sender != "host"
    ]
    assert runs == [(0x41, "board 1", "board 2")] * 2
    assert all(good(piece.data) for piece in sent)


def test_another_board_that_just_woke_answers_with_zeros() -> None:
    """It is both: of zeros, and not from the board that was asked."""
    made = read_scenario("wrong-board-answers")
    woken = (Event(8, "sleep", 1, name="silence"), Event(9.9, "wake", 1))
    _, notes = run(replace(made, events=(*woken, *made.events)), 20)
    other = of(notes, "other_board")
    assert [(note["board"], note["asked"]) for note in other] == [(1, 2), (1, 2)]
    zeros = [note["time"] for note in of(notes, "zero_reply")]
    assert all(note["time"] in zeros for note in other)


def test_a_late_reply_may_say_what_others_do_not() -> None:
    made = read_scenario("late-replies")
    events = (
        Event(8, "late", 1, data_id=0x90, delay_ms=1500),
        Event(8, "contradict", 1, name="pack_voltage", data_id=0x90),
    )
    sent, notes = run(replace(made, events=events), 20)
    (late,), (said,) = of(notes, "late"), of(notes, "contradiction")
    assert (said["board"], said["name"], said["data_id"]) == (1, "pack_voltage", 0x90)
    assert 0 < float(str(said["time"])) - float(str(late["time"])) < 0.5
    lies = [piece for piece in replies(sent, 0x90) if piece.time_ns / 1e9 < float(str(said["time"]))][-2:]
    assert int.from_bytes(lies[1].data[4:6]) > int.from_bytes(lies[0].data[4:6]) * 1.04


def test_zeros_of_waking_up_contradict_nothing() -> None:
    made = read_scenario("contradictions")
    events = (
        Event(6, "sleep", 1, name="silence"),
        Event(9.9, "wake", 1),
        Event(9.9, "contradict", 1, name="cell_min", data_id=0x91),
    )
    _, notes = run(replace(made, events=events), 14)
    assert 0x91 in [note.get("data_id") for note in of(notes, "zero_reply")]
    assert not of(notes, "contradiction")


def test_who_was_asked_in_modbus_is_told_by_its_address() -> None:
    made = read_scenario("clean-all-dialects")
    _, notes = run(replace(made, events=(Event(5, "silent", 1, times=30),)), 20)
    asked = {(note["address"], note.get("board")) for note in of(notes, "unanswered") if "register" in note}
    assert asked == {(0xD2, None), (0x81, 1)}


def test_faults_that_a_late_reply_tells_are_noted_with_it() -> None:
    events = (
        Event(6, "fault", 1, name="eeprom"),
        Event(6, "late", 1, data_id=0x98, delay_ms=1500),
        Event(6.5, "clear", 1, name="eeprom"),
    )
    _, notes = run(replace(read_scenario("faults"), events=events), 30)
    (late,), (raised,) = of(notes, "late"), of(notes, "fault_raised")
    assert raised["name"] == "eeprom"
    assert 0 < float(str(raised["time"])) - float(str(late["time"])) < 0.5


def test_faults_are_told_by_a_good_reply_behind_noise() -> None:
    """Bytes that nobody sent harm none of the reply when they come before it; in the middle of it they do."""
    events = (Event(4, "fault", 1, name="eeprom"), Event(4, "damage", 1, name="insert", data_id=0x98))
    whole = 0
    for seed in range(60):
        _, notes = run(replace(read_scenario("faults"), events=events, seed=seed), 5.5)
        (harmed,) = of(notes, "damaged")
        left_whole = str(harmed["sent"]) in str(harmed["heard"])
        until = float(str(harmed["time"])) + 0.1
        at_once = [note for note in of(notes, "fault_raised") if float(str(note["time"])) < until]
        assert len(at_once) == left_whole
        whole += left_whole
    assert 0 < whole < 60


def test_a_late_reply_may_be_one_of_waking_up() -> None:
    events = (
        Event(5, "sleep", 1, name="silence"),
        Event(7, "wake", 1),
        Event(7, "late", 1, data_id=0x90, delay_ms=900),
    )
    _, notes = run(replace(read_scenario("late-replies"), events=events), 12)
    (late,) = of(notes, "late")
    assert late["time"] in [note["time"] for note in of(notes, "zero_reply") if note["data_id"] == 0x90]


def test_an_echo_does_not_come_late() -> None:
    made = read_scenario("late-replies")
    events = (Event(5, "sleep", 1, name="echo"), Event(5, "late", 1, delay_ms=900))
    _, notes = run(replace(made, events=events), 10)
    assert of(notes, "echo")
    assert not of(notes, "late")


def test_contradictions_are_in_single_replies() -> None:
    sent, notes = run(read_scenario("contradictions"), 90)
    said = of(notes, "contradiction")
    assert [n["name"] for n in said] == [
        "pack_voltage",
        "cell_max",
        "cell_min",
        "cell_number",
        "temperature_max",
        "sensor_number",
        "soc",
    ]

    def at(note: dict[str, object]) -> tuple[bytes, bytes]:
        """The reply that lies, and the one of its ID before it."""
        mine = [p for p in replies(sent, int(str(note["data_id"]))) if p.time_ns / 1e9 < float(str(note["time"]))]
        return mine[-1].data[4:12], mine[-2].data[4:12]

    def u16(data: bytes, place: int) -> int:
        return int.from_bytes(data[place : place + 2])

    lies = [at(note) for note in said]
    assert u16(lies[0][0], 0) > u16(lies[0][1], 0) * 1.04
    assert u16(lies[1][0], 0) - u16(lies[1][1], 0) > 90
    assert u16(lies[2][1], 3) - u16(lies[2][0], 3) > 90
    assert lies[3][0][2] == 17
    assert lies[4][0][0] - lies[4][1][0] == 10
    assert lies[5][0][1] == 4
    assert u16(lies[6][1], 6) - u16(lies[6][0], 6) in {50, 51}


def test_writes_and_what_became_of_them() -> None:
    _, notes = run(read_scenario("switching"), 60)
    assert [(n["dialect"], n.get("data_id", n.get("register")), n["result"]) for n in of(notes, "write")] == [
        ("a5", 0xD9, "confirmed"),
        ("a5", 0xD9, "confirmed"),
        ("a5", 0x21, "confirmed"),
        ("d2", 0x0C, "confirmed"),
        ("d2", 0xA6, "confirmed"),
        ("d2", 0xA6, "confirmed"),
    ]
    assert [n["name"] for n in of(notes, "fault_set")] == ["mos_off_by_command"] * 2  # not by the write to 000C
    sent, notes = run(read_scenario("write-denied"), 30)
    assert [n["result"] for n in of(notes, "write")] == ["denied", "denied"]
    assert {piece.data[5:7] for piece in replies(sent, 0x93)} == {b"\1\1"}


def test_damage_on_demand() -> None:
    sent, notes = run(read_scenario("lost-bytes"), 60)
    assert [n["how"] for n in of(notes, "damaged")] == ["drop", "drop", "drop", "flip", "insert", "cut"]
    bad = [piece.data.hex() for piece in sent if not good(piece.data)]
    assert bad == [n["heard"] for n in of(notes, "damaged")]
    for note in of(notes, "damaged"):
        whole = bytes.fromhex(str(note["sent"]))
        assert good(whole)
        assert whole[2] == (0x90 if note["how"] == "cut" else 0x95)
        if note["how"] == "drop":
            assert whole[4] == 5  # frame 5 of the burst


def test_noise_is_told_frame_by_frame() -> None:
    sent, notes = run(read_scenario("noisy-bus"), 60)
    damaged = of(notes, "damaged")
    assert sorted(str(n["heard"]) for n in damaged) == sorted(p.data.hex() for p in sent if not good(p.data))
    assert {n["how"] for n in damaged} == {"drop", "flip", "insert", "cut", "collide"}


def test_two_masters_collide() -> None:
    sent, notes = run(read_scenario("shared-bus"), 60)
    mixed = [piece for piece in sent if "," in piece.sender]
    assert len(mixed) == len(of(notes, "collision")) > 10
    assert not any(good(piece.data) for piece in mixed)
    assert any(len(piece.data) > 13 for piece in mixed)  # the rest of one is heard behind the other
    whole = [piece for piece in sent if piece.sender in {"inverter", "monitor"}]
    assert {piece.data[1] for piece in whole} == {0x40, 0x80}
    for note in of(notes, "unanswered"):
        assert note["why"] in {"busy", "damaged"}


def test_two_at_once_are_heard_as_zeros_win() -> None:
    assert overlaid(b"\xff\xf0\x0f", b"\x3c\x55\xaa", 1) == b"\xff\x30\x05\xaa"
    assert overlaid(b"\xff\xf0\x0f\x77", b"\x3c", 1) == b"\xff\x30\x0f\x77"


def test_foreign_devices_and_sends() -> None:
    sent, notes = run(read_scenario("sinowealth"), 10)
    pairs = [piece.data.hex() for piece in sent if piece.sender == "BMSTool"]
    assert pairs[:4] == ["0a0102", "0d03fd"] * 2
    assert len(of(notes, "foreign")) == 10
    request = "A5 40 90 08 00 00 00 00 00 00 00 00 7D"
    only = f"host = []\n[[board]]\n[[event]]\nat = 2\ndo = 'send'\nhost = 'me'\ndata = '{request}'\n"
    sent, notes = run(only)
    assert [piece.sender for piece in sent] == ["me", "board 1"]
    assert sent[0].time_ns == 2 * 10**9
    assert not notes


def test_nobody_speaks() -> None:
    assert run("host = []\n[[board]]") == ([], [])


def test_silent_board_and_a_host_that_stops() -> None:
    text = "[[host]]\nplan=[0x90]\nretries=0\nuntil=5\n[[board]]\n[[event]]\nat=1\ndo='silent'\ntimes=2\n"
    sent, notes = run(text)
    assert [n["why"] for n in notes] == ["silent"] * 2
    assert 4.8e9 < [piece.time_ns for piece in sent if piece.sender == "host"][-1] < 5e9
