# SPDX-License-Identifier: GPL-2.0-or-later
"""docs/fleet.md on a small fleet: its commands run, its queries answer, with the same numbers over the CSV."""

from __future__ import annotations

import json
import re
from collections import Counter
from typing import TYPE_CHECKING, Any

import pyarrow.dataset
import pytest
from tests.docs.shell import shell

from bench import fleet

if TYPE_CHECKING:
    from pathlib import Path

    import duckdb

SITES, DAYS = ("harbour", "mill"), ("2026-03-01", "2026-03-02")
PAGE = (fleet.ROOT / "docs/fleet.md").read_text("utf-8")
COMMANDS = re.findall(r"^    (dalyshark decode .*)$", PAGE, re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The data set that the commands of the page make."""
    made = tmp_path_factory.mktemp("fleet")
    assert len(list(fleet.make_captures(made, 2000, SITES, DAYS))) == 4
    assert len(COMMANDS) == 2
    shell(" && ".join((*COMMANDS, COMMANDS[1])), made)  # mill once more: counts once
    return made


@pytest.fixture(scope="module")
def base(folder: Path) -> duckdb.DuckDBPyConnection:
    return fleet.connect(folder)


def test_the_page_opens_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import duckdb

    monkeypatch.chdir(folder)
    (view,) = re.findall(r"^```sql\n(CREATE VIEW.*?)```", PAGE, re.MULTILINE | re.DOTALL)
    own = duckdb.connect()
    own.execute(view)
    assert own.execute("SELECT count(*) FROM fleet").fetchall()[0][0] > 1500


def test_every_record_is_there_once(folder: Path, base: duckdb.DuckDBPyConnection) -> None:
    expected: Counter[tuple[str, str]] = Counter()
    for site in SITES:
        out = shell(f"dalyshark decode {site}-*.pcapng --format jsonl", folder)
        expected.update((site, json.loads(line)["kind"]) for line in out.splitlines())
    rows = base.execute(fleet.queries()["Records by kind"]).fetchall()
    assert {(site, kind): count for site, kind, count in rows} == expected


def test_pyarrow_reads_it_as_it_is(folder: Path, base: duckdb.DuckDBPyConnection) -> None:
    reader: Any = pyarrow.dataset
    table = reader.dataset(str(folder / "fleet"), partitioning="hive").to_table(columns=["site", "board", "day"])
    assert set(table.column("site").to_pylist()) == set(SITES)
    assert set(table.column("board").to_pylist()) == {1, 2, None}
    assert set(table.column("day").to_pylist()) == set(DAYS)


@pytest.mark.parametrize("name", fleet.queries())
def test_the_queries_answer_the_same_over_the_csv(base: duckdb.DuckDBPyConnection, name: str) -> None:
    text = fleet.queries()[name]
    answer = base.execute(text).fetchall()
    assert bool(answer) != (name == "Faults that came")  # none in so short a time
    assert base.execute(fleet.over_csv(text)).fetchall() == answer


def test_there_are_five_queries() -> None:
    assert len(fleet.queries()) == 5


def test_a_pack_of_eight_nmc_cells(base: duckdb.DuckDBPyConnection) -> None:
    rows = base.execute(fleet.queries()["One pack, one day"]).fetchall()
    assert all(24 < volts < 34 and 70 < soc < 90 for _, volts, soc in rows)  # 8 cells of 3 to 4.2 V, begun at 80 %
