# SPDX-License-Identifier: GPL-2.0-or-later
"""Every rule finds what was put in, and nothing is found where nothing was."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from tests.meaning import a5, cells, extremes, status
from tests.meaning_modbus import brings, read, rtu
from tests.tools.dalytools.findings.injected import (
    BESIDES,
    CASES,
    CLEAN,
    EPOCH_NS,
    FAULTY,
    FINE,
    LATER,
    MOS_OFF,
    MOS_ON,
    PACK,
    Heard,
    asked,
    capture,
    discharging,
    poll,
    search,
)
from tests.tools.dalytools.made import SAMPLES

from dalycapture.create import open_writer
from dalycapture.interface import Interface
from dalytools.findings.finding import Severity
from dalytools.findings.limits import MOST_PLACES, Limits
from dalytools.findings.rules import RULES

if TYPE_CHECKING:
    from pathlib import Path

    from dalytools.findings.finding import Finding

FROM_MODBUS = {"other-dialect", "modbus-exception", "modbus-ambiguous"}
"""Rules that need the meaning of Modbus frames."""
ON_CAN = {"not-polled"}


def one(found: list[Finding], rule: str) -> Finding:
    (finding,) = (finding for finding in found if finding.rule == rule)
    return finding


def test_every_rule_has_a_case() -> None:
    assert set(RULES) == set(CASES) | FROM_MODBUS | ON_CAN | {"dissector-differs"}


def test_a_clean_poll(tmp_path: Path) -> None:
    assert search(capture(tmp_path / "clean.pcapng", [*CLEAN, *LATER])) == []


@pytest.mark.parametrize("rule", CASES)
def test_what_was_put_in_is_found_and_no_more(rule: str, tmp_path: Path) -> None:
    found = search(capture(tmp_path / "case.pcapng", [*CASES[rule], *LATER]))
    assert {finding.rule for finding in found} == {rule} | BESIDES.get(rule, set())


def test_a_finding_says_where_when_and_how_often(tmp_path: Path) -> None:
    at = (0.0, 2.0, 4.0)
    path = capture(tmp_path / "silent.pcapng", [*(Heard(when, a5(0x41, 0x90)) for when in at), *LATER])
    silent = one(search(path), "silent")
    assert silent.severity is Severity.ERROR
    assert str(silent.place) == "board 2"
    assert silent.tally.count == 3
    assert (silent.tally.first_packet, silent.tally.last_packet) == (1, 3)
    assert (silent.tally.last_ns - silent.tally.first_ns) == 4_000_000_000
    assert silent.text == "nothing ever answered: 3 requests in 4.0 s"
    assert silent.advice == "board 1 answers: ask that, or give the board the number that is asked"
    unanswered = one(search(path), "unanswered")
    assert str(unanswered.place) == "board 2, 0x90 pack"
    assert unanswered.text == "3 of 3 requests got no reply in time"


def test_a_silent_bluetooth_address_is_told_of_0x40(tmp_path: Path) -> None:
    """jblance/mpp-solar 113: days of guessing, cured by asking 40."""
    packets = [Heard(2.0 * number, a5(0x80, 0x90)) for number in range(4)]
    silent = one(search(capture(tmp_path / "80.pcapng", packets)), "silent")
    assert str(silent.place) == "address 0x80"
    assert "ask 0x40 instead" in silent.advice


def test_one_finding_a_board_and_id(tmp_path: Path) -> None:
    packets = [
        Heard(second + part, a5(host, data_id))
        for second in range(0, 6, 3)
        for part, (host, data_id) in enumerate(((0x40, 0x62), (0x40, 0x63), (0x41, 0x62)))
    ]
    found = search(capture(tmp_path / "grouped.pcapng", [*packets, *LATER]))
    places = {str(finding.place): finding.tally.count for finding in found if finding.rule == "unanswered"}
    assert places == {
        "board 1, 0x62 software version": 2,
        "board 1, 0x63 hardware version": 2,
        "board 2, 0x62 software version": 2,
    }


def test_the_boards_own_bluetooth_module_is_no_stranger(tmp_path: Path) -> None:
    """Field notes, e: what the app says to the module is no board's, and nobody's to take off."""
    talk = [Heard(5, "81100f05000200000000876a"), *asked(6, 0x90, PACK)]
    assert search(capture(tmp_path / "module.pcapng", [*CLEAN, *talk, *LATER])) == []


def test_late_has_a_limit(tmp_path: Path) -> None:
    path = capture(tmp_path / "late.pcapng", [*CLEAN, *asked(5, 0x90, PACK, after=0.3), *LATER])
    assert search(path) == []
    late = one(search(path, Limits(late_s=0.2)), "late")
    assert late.tally.first_packet == len(CLEAN) + 2
    assert "later than 200 ms" in late.text
    assert "0.29 s" in late.text  # 0.3 s from start to start, less the 13.5 ms that the request takes


def test_a_reply_after_the_request_was_given_up_is_late_not_unasked(tmp_path: Path) -> None:
    found = search(capture(tmp_path / "late.pcapng", [*CLEAN, *asked(5, 0x90, PACK, after=3.0), *LATER]))
    assert {finding.rule for finding in found} == {"late", "unanswered"}
    assert "1 of them after the request had been given up" in one(found, "late").text


def test_a_slow_board_is_not_silent(tmp_path: Path) -> None:
    packets = [heard for second in range(0, 20, 4) for heard in asked(second, 0x90, PACK, after=1.5)]
    found = search(capture(tmp_path / "slow.pcapng", [*packets, *LATER]))
    assert {finding.rule for finding in found} == {"late", "unanswered"}


def test_wrong_board_names_both(tmp_path: Path) -> None:
    """Board 1 answers what board 2 was asked, and the right answer follows (thieryus bus.rs)."""
    packets = asked(5, 0x90, PACK, a5(2, 0x90, "00c6000075300181"), host=0x41)
    found = search(capture(tmp_path / "wrong.pcapng", [*CLEAN, *packets, *LATER]))
    assert {finding.rule for finding in found} == {"wrong-board"}
    assert one(found, "wrong-board").text == "board 1 answered 1 time what board 2 was asked"


@pytest.mark.parametrize(("answers", "wrong"), [(4, False), (3, True)])
def test_a_board_that_another_host_asked_answers_for_itself(answers: int, wrong: bool, tmp_path: Path) -> None:
    """Board 4 is asked, 20 ms later 40, which names board 1 and takes any reply: the newest gets it (records.md 7)."""
    reply = a5(answers, 0x90, "00c6000075300181")
    packets = [Heard(5, a5(0x43, 0x90)), Heard(5.02, a5(0x40, 0x90)), Heard(5.05, reply)]
    found = search(capture(tmp_path / "both.pcapng", [*CLEAN, *packets, *LATER]))
    assert ("wrong-board" in {finding.rule for finding in found}) is wrong


def test_a_board_that_was_asked_long_before_answers_for_another(tmp_path: Path) -> None:
    reply = a5(4, 0x90, "00c6000075300181")
    packets = [Heard(5, a5(0x43, 0x90)), Heard(7, a5(0x40, 0x90)), Heard(7.05, reply)]
    found = search(capture(tmp_path / "both.pcapng", [*CLEAN, *packets, *LATER]))
    assert one(found, "wrong-board").text == "board 4 answered 1 time what board 1 was asked"


@pytest.mark.parametrize("gap", [0.03, 2.0])
def test_lengths_are_not_compared_where_two_asked_at_once(gap: float, tmp_path: Path) -> None:
    """The board hears the first, the newest gets the reply (records.md 7): two frames, not the app's sixteen."""
    few = [cells(number, 3300, 3300, 3300) for number in (1, 2)]
    many = [cells(number, 3300, 3300, 3300) for number in range(1, 17)]
    packets = [
        *asked(0, 0x95, *many, host=0x80),
        *asked(2, 0x95, *few),
        Heard(4, a5(0x40, 0x95)),
        *asked(4 + gap, 0x95, *few, host=0x80),
    ]
    found = search(capture(tmp_path / "both.pcapng", [*packets, *LATER]))
    assert ("burst-length" in {finding.rule for finding in found}) is (gap > 1)


def test_lengths_of_bursts_are_compared_by_who_asks(tmp_path: Path) -> None:
    """The app gets 16 frames where the PC gets as many as the cells need (field notes, fact 6): that is no change."""
    few = [cells(number, 3300, 3300, 3300) for number in (1, 2)]
    many = [cells(number, 3300, 3300, 3300) for number in range(1, 17)]
    packets = [
        heard
        for second in range(0, 12, 4)
        for heard in (*asked(second, 0x95, *few), *asked(second + 2, 0x95, *many, host=0x80))
    ]
    assert search(capture(tmp_path / "lengths.pcapng", [*packets, *LATER])) == []


def test_the_length_may_change_with_the_cell_count(tmp_path: Path) -> None:
    packets = [
        *asked(0, 0x94, status(6)),
        *asked(1, 0x95, *(cells(number, 3300, 3300, 3300) for number in (1, 2))),
        *asked(2, 0x94, status(9)),
        *asked(3, 0x95, *(cells(number, 3300, 3300, 3300) for number in (1, 2, 3))),
    ]
    assert search(capture(tmp_path / "counts.pcapng", [*packets, *LATER])) == []


def test_an_adapter_that_hears_itself_is_no_sleep(tmp_path: Path) -> None:
    packets = [
        heard
        for second in range(4)
        for heard in (Heard(second, a5(0x40, 0x90)), Heard(second + 0.02, a5(0x40, 0x90)), Heard(second + 0.06, PACK))
    ]
    found = search(capture(tmp_path / "loop.pcapng", packets))
    assert {finding.rule for finding in found} == {"echo"}
    assert "the adapter or the host hears itself" in one(found, "echo").text


def test_a_board_that_falls_silent_sleeps(tmp_path: Path) -> None:
    packets = [*CLEAN, *(Heard(5 + 2 * number, a5(0x40, 0x90)) for number in range(3)), Heard(40)]
    found = search(capture(tmp_path / "sleep.pcapng", packets))
    assert {finding.rule for finding in found} == {"asleep", "unanswered"}
    assert one(found, "asleep").text == "answered 15 requests, then none of the last 3"


def test_damage_below_the_limit_is_a_note(tmp_path: Path) -> None:
    packets = [*(heard for second in range(20) for heard in poll(second)), Heard(30, "00"), *asked(31, 0x90, PACK)]
    path = capture(tmp_path / "little.pcapng", packets)
    assert one(search(path), "damaged").severity is Severity.NOTE
    assert one(search(path, Limits(damaged_percent=0.01)), "damaged").severity is Severity.WARNING


def test_what_the_ends_of_a_capture_cut_is_no_damage(tmp_path: Path) -> None:
    whole = [*CLEAN, *asked(6, 0x90, PACK)]
    path = capture(tmp_path / "cut.pcapng", [Heard(-1, PACK[8:]), *whole[:-1], Heard(6.1, PACK[:12])])
    assert search(path) == []


def test_a_frame_cut_off_at_the_very_beginning_is_damage(tmp_path: Path) -> None:
    """The capture holds its first byte: it did not join in the middle."""
    path = capture(tmp_path / "first.pcapng", [Heard(-5, PACK[:20]), *CLEAN])
    assert one(search(path), "damaged").tally.first_packet == 1


@pytest.mark.parametrize(
    ("packets", "said"),
    [
        ([Heard(0, "37" * 80)], "100.00 % of 80 bytes"),  # a wrong baud rate: nothing but this
        ([Heard(0, "37" * 300), *asked(6, 0x90, PACK)], "92.02 % of 326 bytes"),  # longer than any frame's rest
    ],
)
def test_junk_that_is_no_rest_of_a_frame_is_damage_at_the_beginning_too(
    packets: list[Heard], said: str, tmp_path: Path
) -> None:
    found = one(search(capture(tmp_path / "junk.pcapng", packets)), "damaged")
    assert found.severity is Severity.WARNING
    assert found.text == f"{said} belong to no good frame (1 junk)"


def test_a_write_says_what_and_a_password_is_not_told(tmp_path: Path) -> None:
    packets = [*CLEAN, Heard(5, MOS_ON), Heard(5.05, a5(1, 0xD9, "01")), Heard(6, MOS_OFF), Heard(6.05, a5(1, 0xD9))]
    write = one(search(capture(tmp_path / "write.pcapng", packets)), "write")
    assert str(write.place) == "board 1, 0xD9 discharge MOS"
    assert write.text.startswith("2 writes: ")
    assert write.text.count(";") == 1


def test_a_denied_write_says_what_was_asked_and_what_the_board_says(tmp_path: Path) -> None:
    denied = one(search(capture(tmp_path / "denied.pcapng", [*CASES["write-denied"], *LATER])), "write-denied")
    assert "asked: discharge MOS off, the board says: discharge MOS on" in denied.text


@pytest.mark.parametrize(("raw", "count"), [(30000, 1), (30009, 1), (30011, 0), (29500, 0)])
def test_a_step_of_the_load_explains_a_contradiction(raw: int, count: int, tmp_path: Path) -> None:
    """The cells say 3310 mV, then 0x91 3400; the next 0x90 tells whether it is another load (more than 1 A)."""
    packets = [
        *CLEAN,
        *asked(5, 0x91, extremes(3400, 2, 3290, 5)),
        *asked(5.5, 0x90, a5(1, 0x90, f"00c60000{raw:04x}0181")),
    ]
    found = search(capture(tmp_path / "step.pcapng", [*packets, *LATER]))
    assert sum(finding.tally.count for finding in found if finding.rule == "contradiction") == count


@pytest.mark.parametrize(("state", "count"), [(0, 1), (1, 0)])
def test_another_state_explains_a_contradiction(state: int, count: int, tmp_path: Path) -> None:
    packets = [
        *asked(0, 0x93, a5(1, 0x93, "000101")),
        *CLEAN,
        *asked(5, 0x91, extremes(3400, 2, 3290, 5)),
        *asked(5.5, 0x93, a5(1, 0x93, f"{state:02x}0101")),
        *asked(6, 0x90, PACK),
    ]
    found = search(capture(tmp_path / "state.pcapng", [*sorted(packets, key=lambda heard: heard.at), *LATER]))
    assert sum(finding.tally.count for finding in found if finding.rule == "contradiction") == count


def test_replies_of_zeros_are_no_other_load(tmp_path: Path) -> None:
    """Behind the contradiction the board wakes up: raw 0 is -3000 A by the letter. The next one is 0 A still."""
    packets = [
        *asked(0, 0x93, a5(1, 0x93, "010101")),
        *CLEAN,
        *asked(5, 0x91, extremes(3400, 2, 3290, 5)),
        *asked(6, 0x93, a5(1, 0x93)),
        *asked(7, 0x90, a5(1, 0x90)),
        *asked(8, 0x90, PACK),
    ]
    found = search(capture(tmp_path / "woke.pcapng", [*sorted(packets, key=lambda heard: heard.at), *LATER]))
    assert one(found, "contradiction").tally.count == 1


def test_replies_of_zeros_in_a_row_are_counted_with_the_one_that_can_not_be(tmp_path: Path) -> None:
    """0x98 of zeros is no fault, and 0x92 may be; beside a 0x91 of zeros they are of a board that just woke."""
    zeros = [
        heard for at, data_id in enumerate((0x98, 0x92, 0x91, 0x93)) for heard in asked(at, data_id, a5(1, data_id))
    ]
    (finding,) = search(capture(tmp_path / "woke.pcapng", [*zeros, *asked(5, 0x90, PACK), *asked(6, 0x98, FINE)]))
    assert finding.rule == "zero-reply"
    assert (finding.tally.count, finding.tally.first_packet, finding.tally.last_packet) == (4, 2, 8)
    assert (
        search(capture(tmp_path / "fine.pcapng", [*asked(-2, 0x98, FINE), *asked(-1, 0x97, a5(1, 0x97)), *CLEAN])) == []
    )


def test_a_board_that_was_silent_for_a_while(tmp_path: Path) -> None:
    packets = [*CLEAN, *(Heard(5 + 2 * number, a5(0x40, 0x90)) for number in range(3)), *asked(11, 0x90, PACK)]
    found = search(capture(tmp_path / "gap.pcapng", [*packets, *LATER]))
    assert {finding.rule for finding in found} == {"asleep", "unanswered"}
    assert one(found, "asleep").text == "answered none of 3 requests in 4.0 s, then it did again"


def test_ids_that_were_never_answered_are_no_sleep(tmp_path: Path) -> None:
    packets = [*CLEAN, *(Heard(5 + 2 * number, a5(0x40, 0x57)) for number in range(5)), Heard(40)]
    found = search(capture(tmp_path / "unknown.pcapng", packets))
    assert {finding.rule for finding in found} == {"unanswered"}


def test_two_buses_are_kept_apart(tmp_path: Path) -> None:
    packets = [Heard(2.0 * number, a5(0x40, 0x90), interface=number % 2) for number in range(6)] + [
        Heard(30),
        Heard(30, interface=1),
    ]
    path = capture(tmp_path / "two.pcapng", packets, ("dalyshark bus=left", "dalyshark bus=right"))
    silent = {str(finding.place): finding.tally.count for finding in search(path) if finding.rule == "silent"}
    assert silent == {"bus left, board 1": 3, "bus right, board 1": 3}


def test_faults_say_what_became_of_them(tmp_path: Path) -> None:
    packets = [
        *asked(0, 0x98, a5(1, 0x98, "0100000000001000")),  # cell_volt_high_level_1; the state mos_off_by_command
        *asked(1, 0x98, a5(1, 0x98, "0300000000000000")),
        *asked(2, 0x98, a5(1, 0x98)),
        *asked(3, 0x98, a5(1, 0x98, "0200000000000000")),
    ]
    found = search(capture(tmp_path / "faults.pcapng", packets))
    told = {(finding.rule, finding.place.detail): finding.text for finding in found}
    assert told == {
        ("fault-standing", "cell_volt_high_level_1"): "set from the first fault reply on, cleared 1 time",
        ("fault-raised", "cell_volt_high_level_2"): "raised 2 times, cleared 1 time",
    }


def test_hostile_captures_are_counted_in_bounded_memory(tmp_path: Path) -> None:
    frames = (a5(0x20 + number % 200, number // 200) for number in range(3000))
    found = search(
        capture(tmp_path / "many.pcapng", [*(Heard(n / 50, frame) for n, frame in enumerate(frames)), Heard(100)])
    )
    assert sum(finding.rule == "unanswered" for finding in found) == MOST_PLACES + 1
    assert any(finding.place.detail == "others" for finding in found)


@pytest.mark.parametrize(("raw", "meaning"), [(30500, "discharging"), (29500, "charging")])
def test_what_the_sign_of_the_current_means(raw: int, meaning: str, tmp_path: Path) -> None:
    packets = [heard for second in range(3) for heard in discharging(second, raw)]
    sign = one(search(capture(tmp_path / "sign.pcapng", packets)), "current-sign")
    assert str(sign.place) == "board 1"
    assert sign.severity is Severity.NOTE
    assert f"above 0 A means {meaning} on this board: so in 3 of 3 readings" in sign.text


def test_a_sign_that_changes_says_nothing(tmp_path: Path) -> None:
    """The load stepped between 0x93 and 0x90, or nothing can be told."""
    packets = [heard for second in range(4) for heard in discharging(second, 30500 if second % 2 else 29500)]
    assert search(capture(tmp_path / "signs.pcapng", packets)) == []


def test_stale_slots_are_named(tmp_path: Path) -> None:
    stale = one(search(capture(tmp_path / "stale.pcapng", CASES["stale-slots"])), "stale-slots")
    assert "the board has 4 cells" in stale.text
    assert "slot 5 and behind" in stale.text
    assert stale.examples == ("packet 5: 3301 3302 mV behind the last cell",)


def test_slots_of_zeros_are_no_cells_for_anybody(tmp_path: Path) -> None:
    packets = [*asked(0, 0x94, status(4)), *asked(1, 0x95, cells(1, 3300, 3310, 3300), cells(2, 3290, 0, 0xFFFF))]
    assert search(capture(tmp_path / "zeros.pcapng", packets)) == []


def test_a_switch_that_shows_is_no_finding(tmp_path: Path) -> None:
    """Nor one whose first reading comes too soon, or that is switched back by somebody."""
    off, on = ("020100", "020101")
    packets = [
        *CLEAN,
        *(Heard(5, MOS_OFF), Heard(5.05, a5(1, 0xD9, "00"))),
        *asked(5.5, 0x93, a5(1, 0x93, on)),
        *asked(8, 0x93, a5(1, 0x93, off)),
        *(Heard(9, MOS_ON), Heard(9.05, a5(1, 0xD9, "01"))),
        *asked(12, 0x93, a5(1, 0x93, on)),
    ]
    assert {finding.rule for finding in search(capture(tmp_path / "on.pcapng", packets))} == {"write"}


def test_the_cell_behind_register_000c_is_named(tmp_path: Path) -> None:
    """batmon-ha 356: the example of the papers switches nothing."""
    found = search(capture(tmp_path / "000c.pcapng", [*CASES["write-no-switch"], *LATER]))
    assert "holds the voltage of cell 13" in one(found, "write-no-switch").text


def test_a_silent_board_beside_another_dialect(tmp_path: Path) -> None:
    """syssi/esphome-daly-bms 35: a D2 board polled as A5."""
    packets = [
        *(Heard(2.0 * number, a5(0x40, 0x90)) for number in range(4)),
        *(Heard(10, read(0, 0x50)), Heard(10.05, brings(*[3300] * 4, *[0] * 76))),
        *LATER[:1],
    ]
    found = search(capture(tmp_path / "d2.pcapng", packets))
    assert "answers in Modbus D2, and in nothing else" in one(found, "silent").advice
    assert one(found, "other-dialect").tally.count == 4


def test_a_cause_stands_before_what_follows_from_it(tmp_path: Path) -> None:
    found = search(capture(tmp_path / "order.pcapng", [*CASES["asleep"], *LATER]))
    assert [finding.rule for finding in found] == ["asleep", "echo", "unanswered"]


def test_lengths_of_bursts_on_can_are_compared_by_who_asks(tmp_path: Path) -> None:
    """As on a serial line: host 80 gets 16 frames where host 40 gets as many as the cells need."""
    frames: list[str] = []
    for host, count in ((0x40, 2), (0x80, 16)) * 3:
        frames.append(f"989501{host:02x}08000000" + "00" * 8)
        frames += [f"9895{host:02x}0108000000{number:02x}0ce40ce40ce400" for number in range(1, count + 1)]
        frames += [f"989001{host:02x}08000000" + "00" * 8, f"9890{host:02x}0108000000" + "00c6000075300181"]
    rules = {finding.rule for finding in search(can(tmp_path / "lengths.pcapng", *frames))}
    assert "burst-length" not in rules


def can(path: Path, *frames: str) -> Path:
    with open_writer(path, application="test") as writer:
        writer.add_interface(Interface("can0", "", 227, 250_000))
        for number, frame in enumerate(frames):
            writer.write_packet(EPOCH_NS + number * 100_000_000, bytes.fromhex(frame))
    return path


VICTRON, REQUEST, ERROR = (
    "0000035108000000380200e803e80300",
    "98900140080000000000000000000000",
    "20000080080000000000000000000000",
)


def test_a_can_bus_where_nobody_asks(tmp_path: Path) -> None:
    """Field notes c.1: boards on CAN are strictly polled. 359 is nobody's that we know, 00004210 Pylontech's."""
    others = ("00000359020000000000", "80004210020000000000")
    (finding,) = search(can(tmp_path / "can.pcapng", VICTRON, *others, VICTRON))
    assert finding.rule == "not-polled"
    assert finding.tally.count == 4
    assert (
        "2 frames of Victron/Pylontech (351); 1 frame of unknown (359); 1 frame of Pylontech-HV (00004210)"
        in finding.text
    )
    assert search(can(tmp_path / "few.pcapng", VICTRON, VICTRON)) == []


def test_a_request_is_a_poll(tmp_path: Path) -> None:
    found = search(can(tmp_path / "can.pcapng", *[VICTRON] * 3, *[REQUEST] * 30))
    assert "not-polled" not in {finding.rule for finding in found}


def test_error_frames_of_can(tmp_path: Path) -> None:
    (finding,) = search(can(tmp_path / "can.pcapng", ERROR, ERROR))
    assert finding.rule == "line-errors"
    assert finding.text.startswith("2 error frames")


MANIFEST = json.loads((SAMPLES / "manifest.json").read_text(encoding="utf-8"))
STALE = {"stale-slots"}
"""A note of what a healthy board does too: 8, 14 and 16 cells do not fill the slots of their last frame, 48 do."""


@pytest.mark.parametrize("name", [entry["file"] for entry in MANIFEST])
def test_samples(name: str) -> None:
    """Nothing real is an error; where nothing is wrong, nothing is found. What is wrong in the others, made-* say."""
    found = search(SAMPLES / name)
    assert [finding for finding in found if finding.severity is Severity.ERROR] == []
    stem = name.split(".", maxsplit=1)[0]
    expected = {
        "made-poll-cycle": {"current-sign", *STALE},  # four readings of a current with a state; three are enough
        "made-16-cells-stale": STALE,
        "made-48-cells": set[str](),
        "made-app-16-frames": set[str](),  # those behind are empty
        "made-link-type-151": STALE,
        "made-classic": STALE,
        "made-raw-chunked": STALE,
        "made-two-boards": STALE,
        "real-8s-cpy": STALE,
        "real-poll-cycle": STALE,
        "made-sleeping": {"asleep", "echo", "unanswered", "zero-reply", *STALE},
        "made-faults": {"fault-raised"},
        "made-events": {"port-lost", *STALE},
        "real-corrupt-lv165": {"damaged", "burst-missing"},
        "real-sinowealth": {"foreign"},
        "real-mos-switch": {"write"},
    }
    if stem in expected:
        assert {finding.rule for finding in found} == expected[stem]


def test_cells_of_zeros_in_the_first_frame_are_of_no_pack(tmp_path: Path) -> None:
    """Every pack has a cell 1: the zeros of waking up begin there, and the fault was there all the time."""
    packets = [
        *asked(0, 0x98, FAULTY),
        *asked(2, 0x95, cells(1, 0, 0, 0), cells(2, 0, 0, 0)),
        *(heard for at, data_id in enumerate((0x98, 0x93), 3) for heard in asked(at, data_id, a5(1, data_id))),
        *asked(6, 0x90, PACK),
        *asked(7, 0x98, FAULTY),
    ]
    found = search(capture(tmp_path / "woke.pcapng", [*packets, *LATER]))
    assert {finding.rule for finding in found} == {"zero-reply", "fault-standing"}
    assert one(found, "zero-reply").tally.count == 4


def test_cells_of_zeros_behind_the_first_frame_may_be_unused_slots(tmp_path: Path) -> None:
    """A board that counts from 0, with three cells, sends all 16 frames to the app (field notes, fact 6)."""
    packets = [
        *asked(0, 0x98, FAULTY),
        *asked(2, 0x95, cells(0, 3300, 3310, 3300), cells(1, 0, 0, 0), cells(2, 0, 0, 0), host=0x80),
        *asked(3, 0x98, FINE),
        *asked(4, 0x90, PACK),
    ]
    found = search(capture(tmp_path / "unused.pcapng", [*packets, *LATER]))
    assert "zero-reply" not in {finding.rule for finding in found}
    assert one(found, "fault-standing").text == "set from the first fault reply on, cleared 1 time"


def test_faults_that_zeros_seemed_to_clear_were_there_all_the_time(tmp_path: Path) -> None:
    """A board that wakes answers 0x98 with zeros as well; then it says again what it said before."""
    packets = [
        *asked(0, 0x98, FAULTY),
        *(heard for at, data_id in enumerate((0x98, 0x90), 2) for heard in asked(at, data_id, a5(1, data_id))),
        *asked(5, 0x90, PACK),
        *asked(6, 0x98, FAULTY),
        *asked(7, 0x98, FINE),
    ]
    found = search(capture(tmp_path / "woke.pcapng", [*packets, *LATER]))
    assert {finding.rule for finding in found} == {"zero-reply", "fault-standing"}
    assert one(found, "fault-standing").text == "set from the first fault reply on, cleared 1 time"


@pytest.mark.parametrize(("gap", "silent"), [(0.05, False), (2.0, True)])
def test_a_write_of_d2_that_is_answered_with_another_value_is_no_silence(
    gap: float, silent: bool, tmp_path: Path
) -> None:
    """Two different writes of one register in 50 ms: the second may be the answer."""
    packets = [
        heard for at in (5, 10) for heard in (Heard(at, rtu("d20600a50000")), Heard(at + gap, rtu("d20600a50001")))
    ]
    found = {finding.rule for finding in search(capture(tmp_path / "d2.pcapng", [*CLEAN, *packets, *LATER]))}
    assert ("silent" in found, "other-dialect" in found) == (silent, silent)


@pytest.mark.parametrize(("amperes", "counted"), [(59.5, 0), (0.0, 1)])
def test_a_reply_from_a_step_of_the_load_contradicts_nothing(amperes: float, counted: int, tmp_path: Path) -> None:
    """Cells sag at 2.4 s; the next current tells why, or that it is none; later the load is off again."""
    current = f"{30000 + round(amperes * 10):04x}"
    packets = [
        *asked(0, 0x94, status(6)),
        *asked(1, 0x90, PACK),
        *asked(1.5, 0x91, extremes(3310, 2, 3290, 5)),
        *asked(2.4, 0x95, cells(1, 3260, 3270, 3260), cells(2, 3260, 3250, 3260)),
        *asked(3, 0x90, a5(1, 0x90, f"00c40000{current}0181")),
        *asked(5, 0x90, PACK),
        *asked(6, 0x91, extremes(3310, 2, 3290, 5)),
        *asked(7, 0x90, PACK),
    ]
    found = search(capture(tmp_path / "step.pcapng", [*packets, *LATER]))
    assert any(finding.rule == "contradiction" for finding in found) == bool(counted)


def _of_81(*, volts: bool) -> list[Heard]:
    """A read of 0038 to 003A in 81: 19.8 V, 0 A, 38.5 %; or zeros."""
    state = "00c675300181" if volts else "00" * 6
    return [Heard(7, rtu("810300380003")), Heard(7.05, rtu(f"510306{state}"))]


@pytest.mark.parametrize(("volts", "of_waking"), [(False, 4), (True, 0)])
def test_what_a_board_says_in_81_tells_whether_its_zeros_are_true(volts: bool, of_waking: int, tmp_path: Path) -> None:
    """Two replies that may be true in A5, its state in 81, and one more."""
    packets = [
        *asked(0, 0x90, PACK),
        *asked(5, 0x97, a5(1, 0x97)),
        *asked(6, 0x98, FINE),
        *_of_81(volts=volts),
        *asked(8, 0x97, a5(1, 0x97)),
        *asked(9, 0x90, PACK),
    ]
    found = [
        finding
        for finding in search(capture(tmp_path / "81.pcapng", [*packets, *LATER]))
        if finding.rule == "zero-reply"
    ]
    assert sum(finding.tally.count for finding in found) == of_waking


def test_zeros_that_are_true_end_a_fault_that_other_zeros_seemed_to_clear(tmp_path: Path) -> None:
    """It wakes with zeros; then, awake, it has no fault; and then one comes again."""
    packets = [
        *asked(0, 0x98, FAULTY),
        *(heard for at, data_id in enumerate((0x98, 0x90), 2) for heard in asked(at, data_id, a5(1, data_id))),
        *asked(5, 0x90, PACK),
        *asked(6, 0x98, FINE),
        *asked(7, 0x90, PACK),
        *asked(8, 0x98, FAULTY),
    ]
    found = search(capture(tmp_path / "woke.pcapng", [*packets, *LATER]))
    assert {finding.rule for finding in found} == {"zero-reply", "fault-standing", "fault-raised"}
    assert one(found, "fault-standing").text == "set from the first fault reply on, cleared 1 time"


@pytest.mark.parametrize(("asks", "answers"), [("d2", "d2"), ("81", "51")])
def test_a_reply_that_fits_several_requests_is_no_silence(asks: str, answers: str, tmp_path: Path) -> None:
    """One answer to two requests, three times; each leaves one without a reply."""
    packets = [
        heard
        for at in (5, 8, 11)
        for heard in (
            Heard(at, rtu(f"{asks}0300630002")),
            Heard(at + 0.03, rtu(f"{asks}0300830002")),
            Heard(at + 0.06, rtu(f"{answers}0304ffffffff")),
        )
    ]
    found = search(capture(tmp_path / "two.pcapng", [*CLEAN, *packets, *LATER]))
    assert {finding.rule for finding in found} == {"modbus-ambiguous", "unanswered"}


def test_zeros_before_a_silence_are_not_of_the_waking_up_behind_it(tmp_path: Path) -> None:
    """No cell is balanced: 0x97 is zero and right. Two requests unanswered, and the zeros of a board that woke."""
    packets = [
        *asked(-1, 0x98, FINE),
        *asked(0, 0x90, PACK),
        *asked(1, 0x97, a5(1, 0x97)),
        Heard(2, a5(0x40, 0x98)),
        Heard(4, a5(0x40, 0x98)),
        *asked(6, 0x98, FINE),
        *asked(7, 0x90, a5(1, 0x90)),
        *asked(8, 0x90, PACK),
    ]
    zeros = one(search(capture(tmp_path / "slept.pcapng", [*packets, *LATER])), "zero-reply")
    assert (zeros.tally.count, zeros.tally.first_packet) == (2, 10)


@pytest.mark.parametrize(("pause", "of_waking"), [(8.0, 2), (1.0, 4)])
def test_zeros_behind_an_answer_are_right_if_a_pause_follows(pause: float, of_waking: int, tmp_path: Path) -> None:
    """The end of a poll: nothing is balanced, no fault. Others have their turn, it sleeps and wakes, and says zeros."""
    packets = [
        *asked(0, 0x90, PACK),
        *asked(0.4, 0x97, a5(1, 0x97)),
        *asked(0.8, 0x98, FINE),
        *asked(0.8 + pause, 0x98, FINE),
        *asked(1.2 + pause, 0x90, a5(1, 0x90)),
        *asked(15, 0x90, PACK),
    ]
    zeros = one(search(capture(tmp_path / "turn.pcapng", [*packets, *LATER])), "zero-reply")
    assert zeros.tally.count == of_waking


def test_asking_what_a_board_never_answers_is_no_pause(tmp_path: Path) -> None:
    """The end of a poll again, with three tries for 0x97 in between; the zeros behind them are true all the same."""
    packets = [
        *asked(0, 0x90, PACK),
        *(Heard(at, a5(0x40, 0x97)) for at in (0.4, 1.2, 2.0)),
        *asked(2.8, 0x98, FINE),
        *asked(10.8, 0x98, FINE),
        *asked(11.2, 0x90, a5(1, 0x90)),
        *asked(15, 0x90, PACK),
    ]
    zeros = one(search(capture(tmp_path / "turn.pcapng", [*packets, *LATER])), "zero-reply")
    assert zeros.tally.count == 2


def test_zeros_of_waking_up_may_have_a_pause_between_them(tmp_path: Path) -> None:
    """It woke just before the end of its turn."""
    packets = [
        *asked(0, 0x90, PACK),
        *asked(8, 0x97, a5(1, 0x97)),
        *asked(8.4, 0x98, FINE),
        *asked(16, 0x90, a5(1, 0x90)),
        *asked(16.4, 0x90, PACK),
    ]
    zeros = one(search(capture(tmp_path / "turn.pcapng", [*packets, *LATER])), "zero-reply")
    assert zeros.tally.count == 3


def _d2_says(soc: int) -> str:
    """A read of 0028 to 002A: 19.8 V, 0 A, SOC in 0.1 %."""
    return brings(198, 30000, soc)


@pytest.mark.parametrize("others", [0, 1])
def test_d2_names_no_board(others: int, tmp_path: Path) -> None:
    """SOC 50 % by D2, 38.5 % by board 1: a contradiction if it is the only board; of two, it may be the other's."""
    packets = [
        *asked(0, 0x90, PACK),
        Heard(1, read(0x28, 3)),
        Heard(1.05, _d2_says(500)),
        *(asked(5, 0x90, a5(2, 0x90, "00c60000753001f4"), host=0x41) if others else []),
    ]
    found = search(capture(tmp_path / "d2.pcapng", [*packets, *LATER]))
    assert [finding.place.detail for finding in found if finding.rule == "contradiction"] == ["soc"] * (1 - others)


@pytest.mark.parametrize("written", [False, True])
def test_soc_that_a_host_sets_in_between_is_no_contradiction(written: bool, tmp_path: Path) -> None:
    sets = [Heard(2, a5(0x40, 0x21, "00000000000001f4")), Heard(2.05, a5(1, 0x21, "01"))]  # 50 %
    packets = [
        Heard(1, read(0x28, 3)),
        Heard(1.05, _d2_says(385)),
        *(sets if written else []),
        *asked(3, 0x90, a5(1, 0x90, "00c60000753001f4")),
    ]
    found = search(capture(tmp_path / "soc.pcapng", [*packets, *LATER]))
    assert ("contradiction" in {finding.rule for finding in found}) is not written


def test_a_late_reply_is_not_of_the_wrong_board(tmp_path: Path) -> None:
    """Board 1 is given up, board 2 is asked the same and still waits: what board 1 says then is its own, late."""
    packets = [
        *asked(0, 0x90, PACK),
        *asked(1, 0x90, a5(2, 0x90, "00c6000075300181"), host=0x41),
        Heard(5, a5(0x40, 0x90)),
        Heard(6.5, a5(0x41, 0x90)),
        Heard(6.6, PACK),
    ]
    found = search(capture(tmp_path / "late.pcapng", [*packets, *LATER]))
    assert {finding.rule for finding in found} == {"late", "unanswered"}


def test_the_next_current_may_come_long_after(tmp_path: Path) -> None:
    """Slow polls: 30 s later another load. That it stepped between the two replies can't be ruled out."""
    packets = [*CLEAN, *asked(5, 0x91, extremes(3400, 2, 3290, 5)), *asked(35, 0x90, a5(1, 0x90, "00c6000077240181"))]
    found = search(capture(tmp_path / "slow.pcapng", [*packets, Heard(60)]))
    assert "contradiction" not in {finding.rule for finding in found}
