# SPDX-License-Identifier: GPL-2.0-or-later
"""The bus in virtual time: half duplex, real timings, the same each time."""

from __future__ import annotations

from itertools import islice, pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from dalytools.simulator.bus import Bus, traffic
from dalytools.simulator.scenario import Board, Damage, Event, Habits, Host, Pack, Scenario
from dalytools.simulator.sent import Sent

FRAME_NS = 13_541_666  # 13 x 10 / 9600 s


def good(data: bytes) -> bool:
    return len(data) == 13 and data[0] == 0xA5 and data[3] == 8 and sum(data[:12]) & 0xFF == data[12]


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    numbers = draw(st.lists(st.integers(1, 16), min_size=1, max_size=3, unique=True))
    boards = tuple(
        Board(
            number,
            Pack(cells=draw(st.integers(1, 48)), sensors=draw(st.integers(1, 21))),
            Habits(reserved=draw(st.sampled_from(["stale", "zero", "ff"]))),
            draw(st.sampled_from(["", "", "echo", "silence"])),
        )
        for number in numbers
    )
    share = draw(st.sampled_from([0.0, 0.05, 0.25]))
    address = draw(st.sampled_from([None, 0x40, 0x80]))
    return Scenario(
        draw(st.integers(0, 1000)),
        draw(st.sampled_from([9600, 115200])),
        boards,
        Host(address=address),
        Damage(share, share, share, share),
    )


@given(scenarios())
@settings(max_examples=40, deadline=None)
def test_one_at_a_time_and_repeatable(scenario: Scenario) -> None:
    sent = list(islice(traffic(scenario), 300))
    assert sent == list(islice(traffic(scenario), 300))
    char_ns = 10 * 10**9 / scenario.baud
    for before, after in pairwise(sent):
        assert after.time_ns >= before.time_ns + int(len(before.data) * char_ns) - 1
    if not scenario.damage.total:
        assert all(good(piece.data) for piece in sent)
    assert all(piece.data for piece in sent)


def test_another_seed_is_another_bus() -> None:
    assert list(islice(traffic(Scenario(seed=1)), 50)) != list(islice(traffic(Scenario(seed=2)), 50))


def test_plan_and_timing_of_a_clean_bus() -> None:
    """PC software's plan (field notes b); reply 37 ms after the request and a bit, burst frames back to back."""
    sent = list(islice(traffic(Scenario(boards=(Board(pack=Pack(cells=14, sensors=1)),))), 48))
    requests = [piece.data[2] for piece in sent if piece.sender == "host"]
    assert requests == [0x90, 0x91, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0xD8] * 2
    for before, after in pairwise(sent):
        between = after.time_ns - before.time_ns - FRAME_NS
        if after.sender == "host":
            assert 60e6 <= between <= 66.1e6
        elif before.sender == "host":
            assert 37e6 <= between <= 38.6e6
            assert after.data[1:3] == bytes((1, before.data[2]))
        else:
            assert abs(between) <= 2
            assert after.data[2] == 0x95


def test_each_board_is_asked_by_its_own_address() -> None:
    boards = (Board(1), Board(2, asleep="silence"), Board(5))
    asked: dict[int, set[str]] = {}
    for before, after in pairwise(islice(traffic(Scenario(boards=boards)), 400)):
        if before.sender == "host":
            asked.setdefault(before.data[1], set()).add(after.sender)
    assert asked == {0x40: {"board 1"}, 0x41: {"host"}, 0x44: {"board 5"}}


def test_retries_after_the_time_out() -> None:
    """Silence: each request three times, 500 ms and a gap apart, then the next ID."""
    sent = list(islice(traffic(Scenario(boards=(Board(asleep="silence"),))), 9))
    assert [piece.data[2] for piece in sent] == [0x90] * 3 + [0x91] * 3 + [0x92] * 3
    for before, after in pairwise(sent):
        assert 560e6 <= after.time_ns - before.time_ns - FRAME_NS <= 566.1e6


def test_events_happen_at_their_time() -> None:
    events = (
        Event(1.0, "fault", name="eeprom"),
        Event(2.0, "clear", name="eeprom"),
        Event(3.0, "sleep", name="echo"),
        Event(4.0, "wake"),
    )
    host = Host(plan=(0x98,))
    scenario = Scenario(boards=(Board(habits=Habits(zero_replies=1)),), host=host, events=events)
    seen: list[tuple[float, str, bytes]] = []
    for asked, answer in pairwise(islice(traffic(scenario), 100)):
        if asked.sender == "host":
            seen.append((asked.time_ns / 1e9, answer.sender, answer.data))
    for second, sender, data in seen:
        assert sender == "board 1"
        if second < 3:
            assert data[1] == 1
            assert data[9] == (8 if 1 <= second < 2 else 0)
        else:
            assert data[1] == (0x40 if second < 4 else 1)
    assert max(second for second, *_ in seen) > 4.5


def test_damage_is_at_the_asked_rate_and_of_each_kind() -> None:
    clean = list(islice(traffic(Scenario()), 6_000))
    assert all(good(piece.data) for piece in clean)
    for kind in ("drop", "flip", "insert", "cut"):
        sent = list(islice(traffic(Scenario(damage=Damage(**{kind: 0.2}))), 6_000))
        bad = [piece.data for piece in sent if not good(piece.data)]
        assert 0.15 < len(bad) / len(sent) < 0.25
        sizes = {len(data) for data in bad}
        if kind == "flip":
            assert sizes == {13}
        elif kind == "insert":
            assert sizes == {14, 15, 16, 17}
        else:
            assert max(sizes) == 12


def test_a_damaged_reply_is_asked_for_again() -> None:
    scenario = Scenario(host=Host(plan=(0x90, 0x91)), damage=Damage(flip=0.1))
    sent = list(islice(traffic(scenario), 3000))
    again = 0
    for asked, answer, following in zip(sent, sent[1:], sent[2:], strict=False):
        if answer.sender == "board 1" and good(following.data):
            if not good(answer.data):
                again += following.data == asked.data
            else:
                assert following.data != asked.data
    assert again > 50


def test_a_damaged_reply_is_not_what_the_next_board_hears() -> None:
    boards = (Board(1), Board(2), Board(3))
    sent = islice(traffic(Scenario(boards=boards, damage=Damage(cut=0.3))), 3000)
    assert {piece.sender for piece in sent} == {"host", "board 1", "board 2", "board 3"}


def test_client_is_served_between_the_hosts_polls() -> None:
    bus = Bus(Scenario())
    bus.poll()
    request = bytes.fromhex("a5409808000000000000000085")  # tano-req-98
    sent = bus.ask(request, 10**9)
    assert sent[0] == Sent(10**9, "client", request)
    assert [piece.sender for piece in sent[1:]] == ["board 1"]
    assert bus.ask(b"\xa5\x40\x98", 2 * 10**9) == [Sent(2 * 10**9, "client", b"\xa5\x40\x98")]
