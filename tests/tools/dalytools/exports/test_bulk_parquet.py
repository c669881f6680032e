# SPDX-License-Identifier: GPL-2.0-or-later
"""``decode --format parquet --fields``: the quick way writes what the plain way writes."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import pytest
from bench.soak import likely_bus, trouble, write
from pyarrow import parquet
from tests.tools.dalytools.exports.sessions import decode
from tests.tools.dalytools.made import ASK, SAMPLES
from tests.tools.dalytools.made import write as write_packets

from dalytools.exports import bulk_choice, bulk_parquet

if TYPE_CHECKING:
    from pathlib import Path

pq: Any = parquet

ASKED = (
    "daly.pack.voltage,daly.soc,daly.cells.voltage,daly.sensors.temperature,daly.state,daly.battery_code",
    "daly.cell.*voltage,daly.temperature,daly.temperature.max,daly.pack.state,daly.charger,daly.fault.eeprom",
    "daly.setting.*,daly.clock,daly.cells.*,daly.frame_number,daly.balance.mask",
)


def nothing(*_: object) -> None:
    """Say that the quick way does not do it."""


def both_ways(
    files: list[Path],
    fields: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    *span: str,
) -> int:
    """Write both, hold them against each other; return the rows."""
    quick, slow = folder / "quick.parquet", folder / "plain.parquet"
    words = (*span, "--format", "parquet", "--fields", fields, "-o")
    used: list[object] = []
    with monkeypatch.context() as patch:
        take = bulk_parquet.Rows.take

        def noted(rows: bulk_parquet.Rows, batch: Any) -> Any:
            used.append(batch)
            return take(rows, batch)

        patch.setattr(bulk_parquet.Rows, "take", noted)
        status = decode(*files, *words, quick)
    said = capsys.readouterr()
    assert used
    with monkeypatch.context() as patch:
        patch.setattr(bulk_choice, "chosen", nothing)
        assert decode(*files, *words, slow) == status
    assert capsys.readouterr() == said
    one, other = pq.read_table(quick), pq.read_table(slow)
    assert one.schema.equals(other.schema, check_metadata=True)
    assert one.to_pylist() == other.to_pylist()
    return one.num_rows


@pytest.mark.parametrize("fields", ASKED)
def test_same_rows(
    fields: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    made = [tmp_path / "trouble.pcapng", tmp_path / "bus.pcapng"]
    for path, make in zip(made, (trouble, likely_bus), strict=True):
        write(path, itertools.islice(make(3), 1500))
    files = [*made, SAMPLES / "made-16-cells-stale.pcapng", SAMPLES / "made-modbus-mixed.pcapng"]
    cut = tmp_path / "cut.pcapng"
    cut.write_bytes(made[1].read_bytes()[:-7])
    assert both_ways([*files, cut], fields, tmp_path, monkeypatch, capsys) > 100


def test_a_range_of_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Cells whose burst began before it are in the table of a record in it."""
    path = tmp_path / "bus.pcapng"
    write(path, itertools.islice(likely_bus(3), 1500))
    whole = both_ways([path], ASKED[0], tmp_path, monkeypatch, capsys)
    times = pq.read_table(tmp_path / "quick.parquet").column("time_UTC").to_pylist()
    first, last = (f"{times[place].timestamp():.6f}" for place in (whole // 3, 2 * whole // 3))
    for span, rows in (
        (("-A", first), whole - whole // 3),
        (("-B", last), 2 * whole // 3),
        (("-A", first, "-B", last), 2 * whole // 3 - whole // 3),
        (("-A", "1"), whole),
    ):
        assert both_ways([path], ASKED[0], tmp_path, monkeypatch, capsys, *span) == rows
    cut = tmp_path / "cut.pcapng"
    cut.write_bytes(path.read_bytes()[:-7])
    assert both_ways([path, cut], ASKED[0], tmp_path, monkeypatch, capsys, "-B", first) == 2 * (whole // 3)


def test_what_the_quick_way_does_not_have_goes_the_plain_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr(bulk_parquet.Rows, "take", refuse)
    path, out = write_packets(tmp_path / "x.pcapng", [(0.0, ASK)]), tmp_path / "x.parquet"
    for fields in ("daly.response_time", "daly.board,daly.soc", "daly.command", "daly.soc,daly.unanswered"):
        assert decode(path, "--format", "parquet", "--fields", fields, "-o", out) == 0


def test_another_medium_goes_the_plain_way(tmp_path: Path) -> None:
    log, out = tmp_path / "can.log", tmp_path / "x.parquet"
    log.write_text("(1700000000.000000) can0 18904001#00F8000075300181\n")
    assert decode(log, "--format", "parquet", "--fields", "daly.soc", "-o", out) == 0
    assert pq.read_table(out).column("soc_percent").to_pylist() == [38.5]
