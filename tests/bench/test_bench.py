# SPDX-License-Identifier: GPL-2.0-or-later
"""The measurements measure what they say: their traffic, the kernel's accounts, the verdict on a goal."""

from __future__ import annotations

import itertools
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest
from bench.table import Goal, Result, spread

from bench import child, in_turn, poll_cycle, wires
from dalycapture.reader import read_capture
from dalyref.decoder import decode
from dalyref.records import Kind, split
from dalytools.wires.carriers import Carriers

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def test_a_cycle_is_ten_requests_and_their_replies_six_of_them_cells() -> None:
    cycle = [(frame.data[1], frame.data[2]) for frame in poll_cycle.frames(50)]
    asked = [data_id for address, data_id in cycle[:25] if address == 0x40]
    assert asked == [0x90, 0x91, 0x92, 0x93, 0x94, 0x95, 0x96, 0x97, 0x98, 0xD8]
    assert sum(data_id == 0x95 and address == 1 for address, data_id in cycle[:25]) == 6  # 16 cells, 3 a frame
    assert cycle[25:] == cycle[:25]


def test_the_file_holds_a_packet_a_frame_all_good(tmp_path: Path) -> None:
    path = tmp_path / "daly.pcapng"
    poll_cycle.write(path, 500)
    packets = list(read_capture(path))
    assert [len(packet.data) for packet in packets] == [13] * 500
    assert packets[0].description.startswith("dalyshark")
    assert all(early.time_ns < late.time_ns for early, late in itertools.pairwise(packets))
    records = split(b"".join(packet.data for packet in packets))
    assert [record.kind for record in records] == [Kind.FRAME] * 500


def test_the_other_wires_carry_values(tmp_path: Path) -> None:
    can, modbus = tmp_path / "can.pcapng", tmp_path / "modbus.pcapng"
    wires.write_can(can, 25)
    wires.write_modbus(modbus, 4)
    carriers = Carriers()
    records = [
        record.fields for record in decode(frame for packet in read_capture(can) for frame in carriers.of(packet))
    ]
    assert [fields["daly.transport"] for fields in records] == ["can"] * 25
    assert sum("daly.cells.voltage" in fields for fields in records) == 1
    replies = [record.fields for record in decode(read_capture(modbus))][1::2]
    assert [fields["daly.cells.count"] for fields in replies] == [16, 16]
    assert [fields["daly.soc"] for fields in replies] == [60, 60]
    assert not any("daly.contradiction" in fields for fields in replies)


def test_a_child_s_cost_is_its_own() -> None:
    program = "any(i < 0 for i in range(2_000_000)); raise SystemExit(3)"
    cost = child.wait(subprocess.Popen([sys.executable, "-c", program]))
    assert cost.status == 3
    assert cost.user_s > cost.system_s  # it counts, and asks the system for nothing


def test_a_child_s_peak_is_in_mib() -> None:
    cost = child.wait(subprocess.Popen([sys.executable, "-c", "bytearray(200 << 20)"]))
    assert 200 < cost.peak_mib < 400


def test_the_ways_take_turns_and_the_first_call_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = 0.0
    calls: list[str] = []

    def work(name: str, durations: Iterator[float]) -> None:
        nonlocal clock
        calls.append(name)
        clock += next(durations)

    monkeypatch.setattr(in_turn.time, "process_time", lambda: clock)
    a, b = iter((100.0, 3.0, 1.0, 2.0)), iter((0.0, 7.0, 7.0, 5.0))
    cost = in_turn.in_turn({"a": lambda: work("a", a), "b": lambda: work("b", b)}, 3)
    assert "".join(calls) == "abababab"
    assert cost == {"a": 2.0, "b": 7.0}


@pytest.mark.parametrize(
    ("figure", "limit", "at_least", "met"),
    [(8.0, 8, False, True), (8.01, 8, False, False), (1.0, 1, True, True), (0.99, 1, True, False)],
)
def test_a_goal_is_met_up_to_its_limit(figure: float, limit: float, at_least: bool, met: bool) -> None:
    goal = Goal("ratio", figure, limit, at_least=at_least)
    assert goal.met is met
    assert str(goal).endswith("met" if met else "MISSED")


def test_a_result_is_a_markdown_table() -> None:
    result = Result("Title", ("what", "us"), [("one", "1.5"), ("twenty-one", "21")])
    assert str(result).split("\n") == [
        "## Title",
        "",
        "| what       |  us |",
        "|------------|-----|",
        "| one        | 1.5 |",
        "| twenty-one |  21 |",
        "",
    ]


def test_a_spread_is_the_median_and_the_range() -> None:
    assert spread([3.0, 1.0, 2.0]) == "2.00 (1.00..3.00)"
    assert spread([1.234]) == "1.23"
