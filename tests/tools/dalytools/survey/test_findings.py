# SPDX-License-Identifier: GPL-2.0-or-later
"""What was planted is found, and named for what it is; what was not planted is not claimed."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from functools import partial
from math import sin, tau
from typing import TYPE_CHECKING, Any

import pytest
from tests.tools.dalytools.survey.planted import START_S, Bus, bcd

from dalytools.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

Place = dict[str, Any]


def surveyed(capture: Path, folder: Path, *words: str) -> dict[str, Place]:
    """Survey a capture; return its places by name."""
    out = folder / "survey.json"
    assert main(["survey", str(capture), "--json", str(out), *words]) == 0
    return {place["name"]: place for place in json.loads(out.read_text("utf-8"))["places"]}


def planted(tmp_path: Path, payload: Callable[[Bus, int], bytes], polls: int = 300) -> Place:
    """Return what is said of the replies to 0xE0, of which `payload` gives the bytes."""
    bus = Bus(polls)
    capture = bus.write(tmp_path / "planted.pcapng", {0xE0: lambda poll: payload(bus, poll)})
    return surveyed(capture, tmp_path)["board 1 reply 0xE0"]


def said(place: Place, kind: str) -> list[tuple[int, int, str]]:
    return [(claim["first"], claim["last"], claim["text"]) for claim in place["claims"] if claim["kind"] == kind]


def test_a_counter(tmp_path: Path) -> None:
    place = planted(tmp_path, lambda _, poll: bytes((0, poll & 0xFF, 7, 0, 0, 0, 0, 0)))
    assert said(place, "counter") == [(1, 1, "counts up by 1 each time, and runs over")]
    (claim,) = place["claims"]
    assert claim["n"] == 299


def test_a_counter_of_sixteen(tmp_path: Path) -> None:
    place = planted(tmp_path, lambda _, poll: bytes((poll % 16, 0, 0, 0, 0, 0, 0, 0)))
    assert said(place, "counter") == [(0, 0, "counts up by 1 each time, from 0 to 15 and round again")]


def test_a_byte_that_follows_the_current_two_polls_later(tmp_path: Path) -> None:
    def payload(bus: Bus, poll: int) -> bytes:
        return bytes((0x11, 128 + (bus.current[max(0, poll - 2)] - 30000) // 5 // 10 * 3, *bus.noise(1), 0, 0, 0, 0, 0))

    place = planted(tmp_path, payload)
    ((first, last, text),) = said(place, "follows")
    assert (first, last) == (1, 1)
    assert text.startswith("moves with current, 2 polls later (")
    (claim,) = place["claims"]
    assert claim["strength"] > 0.99
    assert 100 < claim["n"] <= 300


def test_what_comes_later_is_no_copy(tmp_path: Path) -> None:
    """When it changes, it changes to what 0x90 held two polls before, and mostly still holds: as a copy would."""

    def payload(bus: Bus, poll: int) -> bytes:
        return bytes((7, *bus.current[max(0, poll - 2)].to_bytes(2), 7, 7, 7, 7, 7))

    bus = Bus()
    bus.current = [level for level in bus.current[::6] for _ in range(6)]  # steps alone
    capture = bus.write(tmp_path / "later.pcapng", {0xE0: lambda poll: payload(bus, poll)})
    place = surveyed(capture, tmp_path)["board 1 reply 0xE0"]
    assert not said(place, "mirror")
    ((_, _, text),) = said(place, "follows")
    assert text.startswith("moves with current, 2 polls later (2 s): r +1.00")


def test_two_that_repeat_themselves_at_the_same_turn(tmp_path: Path) -> None:
    bus = Bus(300)
    bus.current = [30000 + (400 if poll % 20 < 7 else -200) for poll in range(300)]
    capture = bus.write(tmp_path / "turns.pcapng", {0xE0: lambda poll: bytes((90 if poll % 20 < 8 else 10, *bytes(7)))})
    assert not said(surveyed(capture, tmp_path)["board 1 reply 0xE0"], "follows")


def test_one_great_jump_proves_nothing(tmp_path: Path) -> None:
    """Both jump when the load is switched on, and then go their own ways."""
    bus = Bus(300)
    r = bus.random
    bus.current = [30000 + (2000 if poll > 120 else 0) + r.randrange(-20, 21) for poll in range(300)]
    capture = bus.write(
        tmp_path / "jump.pcapng", {0xE0: lambda poll: bytes(((200 if poll > 120 else 20) + r.randrange(4), *bytes(7)))}
    )
    assert not said(surveyed(capture, tmp_path)["board 1 reply 0xE0"], "follows")


def test_a_byte_against_the_size_of_the_current(tmp_path: Path) -> None:
    place = planted(tmp_path, lambda bus, poll: bytes((200 - abs(bus.current[poll] - 30000) // 5, *bytes(7))))
    ((_, _, text),) = said(place, "follows")
    assert text.startswith("moves against size of the current: r -1.00")


def test_a_mirrored_byte(tmp_path: Path) -> None:
    """Bytes 4 and 5 of 0x90 stand in bytes 1 and 2; it is not said a second time that they move with the current."""
    place = planted(tmp_path, lambda bus, poll: bytes((0x55, *bus.pack(poll)[4:6], 0, 0, 0, 0, 0)))
    ((first, last, text),) = said(place, "mirror")
    assert (first, last) == (1, 2)
    assert text == "changes to what board 1 reply 0x90 d4-5 holds, each time"
    assert not said(place, "follows")


def test_a_buffer_that_was_not_cleared(tmp_path: Path) -> None:
    place = planted(tmp_path, lambda bus, poll: bytes((1, 2, 3, 4)) + bus.pack(poll)[4:])
    ((first, last, text),) = said(place, "mirror")
    assert (first, last) == (4, 7)  # the SOC behind it changed but a few times, and never differed
    assert "left in the buffer?" in text


@pytest.mark.parametrize(("order", "words"), [("big", "high byte first"), ("little", "low byte first")])
def test_a_number_of_two_bytes(tmp_path: Path, order: Any, words: str) -> None:
    value = 0x3FFC

    def payload(bus: Bus, _: int) -> bytes:
        nonlocal value
        value += bus.random.randrange(-20, 21)
        return bytes((9, *value.to_bytes(2, order), 9, 9, 9, 9, 9))

    ((first, last, text),) = said(planted(tmp_path, payload, 600), "number")
    assert (first, last) == (1, 2)
    assert text.startswith(f"one number of 16 bits, {words}: ")


def test_seconds_since_the_start_in_four_bytes(tmp_path: Path) -> None:
    place = planted(tmp_path, lambda _, poll: bytes(4) + (0x0001FE00 + poll).to_bytes(4), 900)
    assert "counts up by 1 each time, and runs over" in {text for _, _, text in said(place, "counter")}


def test_what_goes_up_evenly(tmp_path: Path) -> None:
    """It does not go on by the same step each time, but evenly."""
    place = planted(tmp_path, lambda _, poll: bytes((int(poll * 0.7) & 0xFF, *bytes(7))))
    ((_, _, text),) = said(place, "steady")
    assert text == "goes up evenly with the time, by 0.7 a second"


def test_a_text(tmp_path: Path) -> None:
    assert said(planted(tmp_path, lambda _bus, _poll: b"DALY-77B"), "text") == [(0, 7, "text: 'DALY-77B'")]


def test_a_bcd_clock(tmp_path: Path) -> None:
    def payload(_: Bus, poll: int) -> bytes:
        now = datetime.fromtimestamp(START_S, UTC) + timedelta(hours=3, seconds=poll)
        words = (now.year % 100, now.month, now.day, now.hour, now.minute, now.second)
        return bytes((0, *map(bcd, words), 0))

    ((first, last, text),) = said(planted(tmp_path, payload), "clock")
    assert (first, last) == (1, 6)
    assert text == "clock, as BCD: 2023-11-15 01:18:19 in the newest, goes with the time of the capture"


def test_a_bcd_date_with_its_century(tmp_path: Path) -> None:
    place = planted(tmp_path, lambda bus, _: bytes.fromhex("20240315") + bus.noise(4))
    assert said(place, "date") == [(0, 3, "date, as BCD: 2024-03-15")]


def test_noise_and_constants_are_nothing(tmp_path: Path) -> None:
    for seed in range(3):
        bus = Bus(400, seed)

        def noise(_: int, bus: Bus = bus) -> bytes:
            return bus.noise(8)

        def still(_: int) -> bytes:
            return bytes.fromhex("0042ff0180aa5513")

        replies: dict[int, Callable[[int], bytes]] = {**dict.fromkeys(range(0xE0, 0xE4), noise), 0xE4: still}
        places = surveyed(bus.write(tmp_path / f"noise-{seed}.pcapng", replies), tmp_path, "--id", "E0-EF")
        replied = [place for name, place in places.items() if " reply " in name]
        assert len(replied) == 5
        assert [place["claims"] for place in replied] == [[]] * 5


def test_what_drifts_as_the_soc_does_is_not_said_to_follow_it(tmp_path: Path) -> None:
    """Two that wander by themselves look alike in their levels (here r is beyond 0.9), and prove nothing."""
    place = planted(tmp_path, lambda bus, poll: bytes((200 - poll // 3 + bus.random.randrange(2), *bytes(7))))
    assert not said(place, "follows")


def curve(waves: list[tuple[float, float, float]], poll: int) -> float:
    return sum(size * sin(tau * often * poll / 400 + phase) for size, often, phase in waves)


def test_smooth_curves_that_have_nothing_to_do_with_each_other(tmp_path: Path) -> None:
    """As the sun goes over a roof: of 128 such numbers, some look alike in levels and changes, none in truth."""
    for seed in range(4):
        bus = Bus(400, seed)

        def smooth(bus: Bus = bus) -> Callable[[int], float]:
            waves = [
                (bus.random.uniform(0.3, 1), bus.random.uniform(0.2, 3), bus.random.random() * 6) for _ in range(3)
            ]
            return partial(curve, waves)

        current, voltage = smooth(), smooth()
        bus.current = [30000 + int(4000 * current(poll)) for poll in range(400)]
        bus.voltage = [530 + int(60 * voltage(poll)) for poll in range(400)]
        curves = {data_id: [smooth() for _ in range(4)] for data_id in range(0xE0, 0xE8)}

        def reply(some: list[Callable[[int], float]], poll: int) -> bytes:
            return b"".join((30000 + int(8000 * curve(poll))).to_bytes(2) for curve in some)

        replies = {data_id: partial(reply, some) for data_id, some in curves.items()}
        places = surveyed(bus.write(tmp_path / f"smooth-{seed}.pcapng", replies), tmp_path, "--id", "E0-E7")
        assert not any(said(place, "follows") for place in places.values())


def test_few_samples_are_too_few(tmp_path: Path) -> None:
    place = planted(tmp_path, lambda bus, poll: bytes((poll, 128 + (bus.current[poll] - 30000) // 5, *bytes(6))), 12)
    assert place["claims"] == []


def test_how_often_and_how_evenly(tmp_path: Path) -> None:
    place = planted(tmp_path, lambda _bus, _poll: bytes(8), 50)
    assert place["count"] == 50
    assert place["interval"]["p50"] == pytest.approx(1.0, rel=0.011)
    assert place["interval"]["p95"] == pytest.approx(1.0, rel=0.011)
    assert place["group"] == "unknown"


def test_bits_and_values_are_counted(tmp_path: Path) -> None:
    place = planted(tmp_path, lambda _, poll: bytes((0x80 if poll % 2 else 0x01, *bytes(7))), 11)
    assert place["bytes"][0] == {"names": [], "changed": 10, "values": {"01": 6, "80": 5}, "flips": [10, *[0] * 6, 10]}
    assert place["bytes"][1]["changed"] == 0
