# SPDX-License-Identifier: GPL-2.0-or-later
"""``-A`` and ``-B``: editcap's words for a range of time, in every format."""

from __future__ import annotations

import argparse
import json
import time
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.made import ANSWER, ASK, write

from dalytools import time_range
from dalytools.cli import main
from dalytools.time_range import TimeRange

if TYPE_CHECKING:
    from pathlib import Path


def read(*words: str) -> TimeRange:
    parser = argparse.ArgumentParser()
    time_range.add_arguments(parser)
    return time_range.read(parser.parse_args(words))


@pytest.mark.parametrize(
    ("text", "time_ns"),
    [
        ("1700000000", 1_700_000_000_000_000_000),
        ("1700000000.000000001", 1_700_000_000_000_000_001),
        ("2023-11-14T22:13:20Z", 1_700_000_000_000_000_000),
        ("2023-11-14 23:13:20.5+01:00", 1_700_000_000_500_000_000),
        ("2023-11-14T23:13:20.123456789+0100", 1_700_000_000_123_456_789),
        ("2023-11-15Z", 1_700_006_400_000_000_000),
        ("1969-12-31T23:59:59.25Z", -750_000_000),
    ],
)
def test_times(text: str, time_ns: int) -> None:
    assert read("-A", text).begin_ns == time_ns
    assert read("--to", text).end_ns == time_ns


def test_without_a_zone_it_is_local_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "EAST-3")  # three hours east
    time.tzset()
    try:
        assert read("-A", "2023-11-15T01:13:20").begin_ns == 1_700_000_000_000_000_000
    finally:
        monkeypatch.undo()
        time.tzset()


@pytest.mark.parametrize("text", ["", "now", "2023-13-01", "2023-11-14T25:00:00Z", "1e9", "٣", "2023-11-14T22:13:20Q"])
def test_what_is_no_time(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        read("-A", text)
    assert "is no time" in capsys.readouterr().err


def test_from_is_in_it_and_to_is_not() -> None:
    span = TimeRange(10, 20)
    assert [span.holds(moment) for moment in (9, 10, 19, 20)] == [False, True, True, False]
    assert TimeRange().holds(-5)


def test_records_in_it_know_what_came_before(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture = write(tmp_path / "a.pcapng", [(0, ASK), (0.05, ANSWER), (5, ASK), (5.05, ANSWER)])
    words = ["decode", str(capture), "--format", "jsonl", "-A", "1700000000.05", "-B", "1700000005.05"]
    assert main(words) == 0
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["number"] for row in rows] == [2, 3]
    assert rows[0]["fields"]["daly.request_in"] == 1
    assert main([*words, "--fields", "daly.soc"]) == 0
    (row,) = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert row["fields"] == {"daly.soc": 38.5}
