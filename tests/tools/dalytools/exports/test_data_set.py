# SPDX-License-Identifier: GPL-2.0-or-later
"""``decode --partition``: a data set that grows capture by capture, and is never seen half written."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import duckdb
import pytest
from tests.tools.dalytools.exports.sessions import ask_and_answer, decode, poll
from tests.tools.dalytools.made import ANSWER, ASK, write

from dalyref.decoder import decode as decode_records
from dalyref.packet import Packet
from dalytools.exports import data_set
from dalytools.exports.data_set import DataSet
from dalytools.exports.records import Records

DAY = 86_400
WORDS = ("--format", "parquet", "--partition", "board,day")


def query(text: str, *values: object) -> list[tuple[Any, ...]]:
    return duckdb.connect().execute(text, list(values)).fetchall()


def count(place: Path, by: str = "board, day") -> dict[tuple[Any, ...], int]:
    """Count rows by partition, as DuckDB reads the data set."""
    text = f"select {by}, count(*) from read_parquet(?) group by all"
    return {tuple(map(str, row[:-1])): row[-1] for row in query(text, str(place / "**/*.parquet"))}


def files(place: Path) -> list[str]:
    return sorted(str(path.relative_to(place)) for path in place.rglob("*") if path.is_file())


def test_a_directory_for_each_board_and_day(tmp_path: Path) -> None:
    one = ask_and_answer(tmp_path / "a.pcapng", 0, 1, DAY, DAY + 1, DAY + 2)
    two = ask_and_answer(tmp_path / "b.pcapng", 0, board=2)
    place = tmp_path / "fleet"
    assert decode(one, two, *WORDS, "-o", place) == 0
    folders = {str(Path(name).parent) for name in files(place)}
    assert folders == {"board=1/day=2023-11-14", "board=1/day=2023-11-15", "board=2/day=2023-11-14"}
    # The request of b.pcapng names board 1, its reply is board 2's.
    assert count(place) == {("1", "2023-11-14"): 5, ("1", "2023-11-15"): 6, ("2", "2023-11-14"): 1}
    types = query("select typeof(board), typeof(day) from read_parquet(?) limit 1", str(place / "**/*.parquet"))
    assert types == [("BIGINT", "DATE")]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.pcapng", "b.pcapng", "fleet"]


def test_records_of_no_board_are_null(tmp_path: Path) -> None:
    capture = write(tmp_path / "a.pcapng", [(0, ASK), (0.05, ANSWER), (1, b"\x00\xff")])
    assert decode(capture, *WORDS, "-o", tmp_path / "fleet") == 0
    assert count(tmp_path / "fleet") == {("1", "2023-11-14"): 2, ("None", "2023-11-14"): 1}


def test_captures_are_added(tmp_path: Path) -> None:
    place = tmp_path / "fleet"
    for number in range(3):
        assert decode(ask_and_answer(tmp_path / f"{number}.pcapng", number * 3600), *WORDS, "-o", place) == 0
    assert count(place) == {("1", "2023-11-14"): 4, ("1", "2023-11-15"): 2}  # 22:13, 23:13, 00:13


def test_a_capture_added_again_does_not_count_twice_wherever_it_lies(tmp_path: Path) -> None:
    place = tmp_path / "fleet"
    first = ask_and_answer(tmp_path / "a.pcapng", 0, 1)
    assert decode(first, *WORDS, "-o", place) == 0
    before = files(place)
    moved = first.rename(tmp_path / "elsewhere.pcapng")
    assert decode(moved, *WORDS, "-o", place) == 0
    assert files(place) == before
    assert count(place) == {("1", "2023-11-14"): 4}


def test_two_parts_of_a_capture_by_time_are_two(tmp_path: Path) -> None:
    place, capture = tmp_path / "fleet", ask_and_answer(tmp_path / "a.pcapng", 0, 10)
    assert decode(capture, *WORDS, "-o", place, "-B", "1700000005") == 0
    assert decode(capture, *WORDS, "-o", place, "-A", "1700000005") == 0
    assert count(place) == {("1", "2023-11-14"): 4}


def test_labels_tell_sites_apart(tmp_path: Path) -> None:
    place, capture = tmp_path / "fleet", ask_and_answer(tmp_path / "a.pcapng", 0)
    for site in ("harbour", "hill"):
        words = ("--format", "parquet", "--label", f"site={site}", "--partition", "site,board,day")
        assert decode(capture, *words, "-o", place) == 0
    assert count(place, "site, board") == {("harbour", "1"): 2, ("hill", "1"): 2}


def test_moments_by_month(tmp_path: Path) -> None:
    place, capture = tmp_path / "fleet", poll(tmp_path / "a.pcapng", 0, 60)
    words = ("--format", "parquet", "--rows", "moment", "--partition", "month", "--fields", "soc")
    assert decode(capture, *words, "-o", place) == 0
    assert (
        query("select month, board, soc_percent from read_parquet(?)", str(place / "**/*.parquet"))
        == [("2023-11", 1, 38.5)] * 2
    )


@pytest.mark.parametrize(
    "words",
    [
        ("--format", "parquet", "--partition", "day,board"),
        ("--format", "parquet", "--partition", "board"),
        ("--format", "parquet", "--partition", "board,day", "--fields", "daly.soc"),
        ("--format", "parquet", "--partition", "board,day", "--rows", "moment"),
        ("--format", "parquet", "--partition", "board,day", "--label", "site=a"),
    ],
)
def test_another_shape_is_refused_and_nothing_changes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    place, capture = tmp_path / "fleet", ask_and_answer(tmp_path / "a.pcapng", 0)
    assert decode(capture, *WORDS, "-o", place) == 0
    before = files(tmp_path)
    assert decode(capture, *words, "-o", place) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert files(tmp_path) == before


def test_other_peoples_directories_are_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home/letter.txt").write_text("dear")
    capture = ask_and_answer(tmp_path / "a.pcapng", 0)
    assert decode(capture, *WORDS, "-o", tmp_path / "home") == 2
    assert decode(capture, *WORDS, "-o", capture) == 2
    assert decode(capture, *WORDS, "-o", tmp_path / "home/letter.txt") == 2
    assert files(tmp_path) == ["a.pcapng", "home/letter.txt"]
    (tmp_path / "empty").mkdir()
    assert decode(capture, *WORDS, "-o", tmp_path / "empty") == 0
    assert count(tmp_path / "empty") == {("1", "2023-11-14"): 2}


@pytest.mark.parametrize("keys", ["", "board,", "board,board", "soc", "file"])
def test_what_can_be_no_partition(tmp_path: Path, capsys: pytest.CaptureFixture[str], keys: str) -> None:
    capture = ask_and_answer(tmp_path / "a.pcapng", 0)
    assert decode(capture, "--format", "parquet", "--partition", keys, "-o", tmp_path / "fleet") == 2
    assert "--partition" in capsys.readouterr().err
    assert files(tmp_path) == ["a.pcapng"]


def test_interrupted_before_the_end_nothing_is_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = tmp_path / "fleet"
    assert decode(ask_and_answer(tmp_path / "a.pcapng", 0), *WORDS, "-o", place) == 0
    before = files(tmp_path)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(DataSet, "commit", interrupted)
    second = ask_and_answer(tmp_path / "b.pcapng", 100)
    assert decode(second, *WORDS, "-o", place) == 130
    assert decode(second, *WORDS, "-o", tmp_path / "other") == 130
    assert files(tmp_path) == sorted([*before, "b.pcapng"])
    assert not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


def test_interrupted_while_files_take_their_places_the_same_command_heals_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "fleet"
    assert decode(ask_and_answer(tmp_path / "a.pcapng", 0), *WORDS, "-o", place) == 0
    second = ask_and_answer(tmp_path / "b.pcapng", 100, DAY, 2 * DAY)
    real = Path.replace
    into: list[Path] = []

    def some(self: Path, target: Path) -> Path:
        if target.is_relative_to(place):
            if len(into) == 2:
                raise KeyboardInterrupt
            into.append(target)
        return real(self, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", some)
        assert decode(second, *WORDS, "-o", place) == 130
    assert sum(count(place).values()) == 2 + 2 * 2  # whole files, readable
    assert decode(second, *WORDS, "-o", place) == 0
    assert count(place) == {("1", "2023-11-14"): 4, ("1", "2023-11-15"): 2, ("1", "2023-11-16"): 2}


def test_a_capture_that_makes_fewer_files_now_leaves_no_old_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "fleet"
    capture = ask_and_answer(tmp_path / "a.pcapng", 0, DAY, 1, DAY + 1, 2, DAY + 2)
    with monkeypatch.context() as patch:
        patch.setattr(data_set, "_MOST_OPEN", 1)  # a new file at each change of the day
        assert decode(capture, *WORDS, "-o", place) == 0
    assert len(files(place)) == 6
    assert sum(count(place).values()) == 12
    assert decode(capture, *WORDS, "-o", place) == 0
    assert len(files(place)) == 2
    assert sum(count(place).values()) == 12


def test_two_that_begin_a_data_set_at_once(tmp_path: Path) -> None:
    place = tmp_path / "fleet"
    both = [DataSet(str(place), ["board"], Records().columns) for _ in range(2)]
    for number, mine in enumerate(both):
        for record in decode_records([Packet(1, number * 10**9, ASK)]):
            for row in Records().take("a", record):
                mine.put(row)
        mine.end_file(f"{number}")
    for mine in both:
        mine.commit()
    assert files(place) == ["board=1/0-0.parquet", "board=1/1-0.parquet"]
    assert list(tmp_path.iterdir()) == [place]
    assert place.stat().st_mode & 0o777 == 0o777 & ~umask()


def umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def test_memory_is_bounded_over_many_partitions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(data_set, "_MOST_LOOSE_ROWS", 4)
    monkeypatch.setattr(data_set, "_MOST_ROWS", 8)
    capture = ask_and_answer(tmp_path / "a.pcapng", *(day * DAY + second for second in range(5) for day in range(6)))
    assert decode(capture, *WORDS, "-o", tmp_path / "fleet") == 0
    assert set(count(tmp_path / "fleet").values()) == {10}
    assert len(files(tmp_path / "fleet")) == 6


def test_a_clock_gone_mad_does_not_make_files_without_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(data_set, "_MOST_FILES", 5)
    capture = ask_and_answer(tmp_path / "a.pcapng", *(day * DAY for day in range(6)))
    assert decode(capture, *WORDS, "-o", tmp_path / "fleet") == 2
    assert "more than 5 files" in capsys.readouterr().err
    assert files(tmp_path) == ["a.pcapng"]


def test_nothing_to_read_makes_no_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert decode(tmp_path / "missing.pcapng", *WORDS, "-o", tmp_path / "fleet") == 2
    assert list(tmp_path.iterdir()) == []
