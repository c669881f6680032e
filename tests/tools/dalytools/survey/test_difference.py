# SPDX-License-Identifier: GPL-2.0-or-later
"""What was turned is found in the traffic, and what moves anyway is not."""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING, Any

from tests.tools.dalytools.survey.planted import Bus

from dalytools.cli import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import pytest

    Payload = Callable[[Bus, int], bytes]


def compared(tmp_path: Path, before: dict[int, Payload], after: dict[int, Payload], polls: int = 200) -> dict[str, Any]:
    captures: list[str] = []
    for name, seed, payloads in (("a", 1, before), ("b", 2, after)):
        bus = Bus(polls, seed)
        replies = {data_id: partial(payload, bus) for data_id, payload in payloads.items()}
        captures.append(str(bus.write(tmp_path / f"{name}.pcapng", replies)))
    out = tmp_path / "difference.json"
    assert main(["survey", "--diff", *captures, "--json", str(out), "--direction", "reply", "--id", "E0-EF"]) == 0
    return json.loads(out.read_text("utf-8"))


def changes(difference: dict[str, Any]) -> list[tuple[str, int, int, str]]:
    return [
        (change["kind"], change["first"], change["last"], change["text"])
        for place in difference["changed"]
        for change in place["changes"]
    ]


def test_a_setting_of_two_bytes(tmp_path: Path) -> None:
    found = compared(
        tmp_path,
        {0xE0: lambda bus, _: bus.noise(2) + bytes.fromhex("0e1000010203")},
        {0xE0: lambda bus, _: bus.noise(2) + bytes.fromhex("0d4800010203")},
    )
    assert changes(found) == [("value", 2, 3, "0E 10 before, 0D 48 now")]


def test_one_bit(tmp_path: Path) -> None:
    found = compared(
        tmp_path, {0xE0: lambda _bus, _poll: b"\x81" + bytes(7)}, {0xE0: lambda _bus, _poll: b"\x89" + bytes(7)}
    )
    assert changes(found) == [("value", 0, 0, "81 before, 89 now (bit 3)")]


def test_what_moves_anyway_is_no_change(tmp_path: Path) -> None:
    def payload(bus: Bus, poll: int) -> bytes:
        return bytes((poll & 0xFF, *bus.noise(3), *bus.pack(poll)[4:6], 0, 0x20 + bus.random.randrange(4)))

    found = compared(tmp_path, {0xE0: payload, 0xE1: lambda bus, _: bus.noise(8)}, {0xE0: payload})
    assert found["changed"] == []
    assert [place["name"] for place in found["only_before"]] == ["board 1 reply 0xE1"]
    assert found["only_now"] == []
    assert found["unchanged"] == 1


def test_it_began_to_move_and_it_stands_still(tmp_path: Path) -> None:
    found = compared(
        tmp_path,
        {0xE0: lambda bus, _: bytes((7, bus.random.randrange(10), 0, 0, 0, 0, 0, 0))},
        {0xE0: lambda bus, _: bytes((bus.random.randrange(2, 9), 4, 0, 0, 0, 0, 0, 0))},
    )
    assert changes(found) == [
        ("began to move", 0, 0, "stood still at 07, now moves in 02-08 (7 values)"),
        ("stands still", 1, 1, "moves in 00-09 (10 values), now stands still at 04"),
    ]


def test_another_range(tmp_path: Path) -> None:
    found = compared(
        tmp_path,
        {0xE0: lambda bus, _: bytes((0x20 + bus.random.randrange(8), *bytes(7)))},
        {0xE0: lambda bus, _: bytes((0x30 + bus.random.randrange(8), *bytes(7)))},
    )
    ((kind, first, last, text),) = changes(found)
    assert (kind, first, last) == ("range", 0, 0)
    assert text.startswith("20-27 before, 30-37 now; most often ")


def test_a_state_that_came_once_and_stayed(tmp_path: Path) -> None:
    found = compared(
        tmp_path,
        {0xE0: lambda _bus, _poll: bytes(8)},
        {0xE0: lambda _, poll: bytes((2 if poll >= 150 else 0, *bytes(7)))},
    )
    assert changes(found) == [("also", 0, 0, "always 00 before, now 02 too (50 of 200 times)")]


def test_a_knob_turned_in_the_middle_of_the_second_capture(tmp_path: Path) -> None:
    found = compared(
        tmp_path,
        {0xE0: lambda _bus, _poll: b"\x5b" + bytes(7)},
        {0xE0: lambda _, poll: bytes((0x5A if poll else 0x5B, *bytes(7)))},
    )
    assert changes(found) == [("mostly", 0, 0, "always 5B before, now 5A (199 of 200 times)")]


def test_seen_too_seldom_to_be_sure(tmp_path: Path) -> None:
    found = compared(
        tmp_path, {0xE0: lambda _bus, _poll: bytes(8)}, {0xE0: lambda _bus, _poll: b"\1" + bytes(7)}, polls=3
    )
    assert changes(found) == [
        ("few", 0, 0, "00 before, 01 now (bit 0), but seen 3 and 3 times only: it may move anyway")
    ]


def test_what_is_unknown_in_one_alone_is_not_gone_from_the_other(tmp_path: Path) -> None:
    """The reserved byte 7 of 0x94 moves in the first only."""
    captures = [
        str(Bus(30, seed).write(tmp_path / f"{seed}.pcapng", {0x94: partial(status, moves)}))
        for seed, moves in ((1, 1), (2, 0))
    ]
    out = tmp_path / "difference.json"
    assert main(["survey", "--diff", *captures, "--json", str(out), "--unknown"]) == 0
    found = json.loads(out.read_text("utf-8"))
    assert (found["only_before"], found["only_now"]) == ([], [])
    assert [place["name"] for place in found["changed"]] == ["board 1 reply 0x94"]


def status(moves: int, poll: int) -> bytes:
    return bytes((16, 2, 0, 0, 2, 0, 37, 200 * moves * (poll % 2)))


def test_the_same_capture_twice(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture = str(Bus(60).write(tmp_path / "same.pcapng", {0xE0: lambda poll: bytes((poll, *bytes(7)))}))
    assert main(["survey", "--diff", capture, capture]) == 0
    assert "Nothing changed: 4 places unchanged" in capsys.readouterr().out


def test_two_captures_are_needed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["survey", "one.pcapng", "--diff", "two.pcapng", "three.pcapng"]) == 2
    assert main(["survey"]) == 2
    said = capsys.readouterr().err
    assert "name no other" in said
    assert "name a capture, or two behind --diff" in said


def test_what_moved_in_one_alone_is_shown_as_the_newest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = str(Bus(60).write(tmp_path / "a.pcapng", {}))
    after = Bus(60).write(
        tmp_path / "b.pcapng", {0xE0: lambda poll: bytes((poll, *bytes(7))), 0xE1: lambda _: b"\x05" + bytes(7)}
    )
    assert main(["survey", "--diff", before, str(after), "--id", "E0-E1"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if "reply" in line]
    assert lines[0].endswith(", newest 3B 00 00 00 00 00 00 00")  # 59, the last of 60
    assert lines[1].endswith("): 05 00 00 00 00 00 00 00")
