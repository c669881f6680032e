# SPDX-License-Identifier: GPL-2.0-or-later
"""``decode --format parquet``: read back by pyarrow and by DuckDB."""

from __future__ import annotations

import gc
import importlib.util
import sys
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

import duckdb
import pyarrow as pa
from pyarrow import parquet
from tests.tools.dalytools.exports.sessions import CELLS, ask_and_answer, decode, poll
from tests.tools.dalytools.made import ANSWER, ASK, a5, write

from dalyref.decoder import decode as decode_records
from dalyref.packet import Packet
from dalytools.exports import parquet_file
from dalytools.exports.moments import Moments
from dalytools.exports.parquet_file import ParquetFile
from dalytools.exports.schema import RECORD_COLUMNS

if TYPE_CHECKING:
    from pathlib import Path

    import pytest

pq: Any = parquet
read_table, ParquetReader = pq.read_table, pq.ParquetFile


def query(text: str, *values: object) -> list[tuple[Any, ...]]:
    return duckdb.connect().execute(text, list(values)).fetchall()


def test_a_row_a_record(tmp_path: Path) -> None:
    capture, out = poll(tmp_path / "a.pcapng", 0), tmp_path / "a.parquet"
    assert decode(capture, "--format", "parquet", "-o", out) == 0
    table = read_table(out)
    assert table.column_names == [column.name for column in RECORD_COLUMNS]
    rows: list[dict[str, Any]] = table.to_pylist()
    assert len(rows) == 11
    first = {name: value for name, value in rows[0].items() if value is not None}
    assert (
        first
        == {
            "file": str(capture),
            "number": 1,
            "time_UTC": datetime(2023, 11, 14, 22, 13, 20, tzinfo=UTC),
            "interface": 0,
            "kind": "frame",
            "transport": "uart",
            "dialect": "a5",
            "start": 0xA5,
            "address": 1,
            "data_id": 0x90,
            "length": 8,
            "data": "00f8000075300181",
            "checksum": 0x5D,
            "checksum_status": "good",
            "direction": "reply",
            "board": 1,
            "pack_voltage_V": 24.8,
            "pack_gather_voltage_V": 0.0,
            "pack_current_A": 0.0,
            "pack_current_raw": 30000,
            "soc_percent": 38.5,
        }
        or "unasked" not in first
    )
    assert rows[7]["cells_voltage_mV"] == CELLS
    assert rows[8]["sensors_temperature_C"] == [21]
    assert rows[9]["balance_mask"] == 0x90
    assert rows[9]["balance_cell"] == [5, 8]
    assert rows[10]["fault_mos_off_by_command"] is True
    assert rows[10]["fault_eeprom"] is False
    assert rows[0]["fault_eeprom"] is None
    assert rows[0]["fault_raised"] is None


def test_units_travel_in_the_file(tmp_path: Path) -> None:
    assert decode(poll(tmp_path / "a.pcapng", 0), "--format", "parquet", "-o", tmp_path / "a.parquet") == 0
    schema: Any = ParquetReader(tmp_path / "a.parquet").schema_arrow
    assert schema.field("pack_current_A").metadata[b"unit"] == b"A"
    assert schema.field("soc_percent").metadata[b"unit"] == b"%"
    assert schema.field("cells_spread_mV").metadata[b"field"] == b"daly.cells.spread"
    assert schema.field("time_UTC").type == pa.timestamp("us", tz="UTC")


def test_duckdb_reads_it(tmp_path: Path) -> None:
    capture, out = poll(tmp_path / "a.pcapng", 0, 5), tmp_path / "a.parquet"
    assert decode(capture, "--format", "parquet", "-o", out) == 0
    text = "select count(*), avg(pack_voltage_V), sum(fault_count), max(cells_voltage_mV[5]) from read_parquet(?)"
    assert query(text, str(out)) == [(22, 24.8, 0, 3154)]


def test_damaged_records_are_there_without_values(tmp_path: Path) -> None:
    damaged = ANSWER[:-1] + bytes([ANSWER[-1] ^ 1])
    capture = write(tmp_path / "a.pcapng", [(0, ASK), (0.05, damaged), (1, b"\x00\xff")])
    assert decode(capture, "--format", "parquet", "-o", tmp_path / "a.parquet") == 0
    text = "select kind, data_id, pack_voltage_V, soc_percent, undecoded from read_parquet(?) order by number"
    assert query(text, str(tmp_path / "a.parquet")) == [
        ("frame", 0x90, None, None, None),
        ("bad_checksum", 0x90, None, None, None),
        ("junk", None, None, None, "00ff"),
    ]


def test_moments_and_values_are_tables_too(tmp_path: Path) -> None:
    capture = poll(tmp_path / "a.pcapng", 0)
    assert decode(capture, "--format", "parquet", "--rows", "moment", "-o", tmp_path / "m.parquet") == 0
    assert query(
        "select board, pack_voltage_V, soc_percent, cell_05_mV, cell_09_mV, sensor_01_C, state from read_parquet(?)",
        str(tmp_path / "m.parquet"),
    ) == [(1, 24.8, 38.5, 3154, None, 21, "stationary")]
    assert decode(capture, "--format", "parquet", "--rows", "value", "-o", tmp_path / "v.parquet") == 0
    assert query(
        "select value, unit, part from read_parquet(?) where field = 'daly.cells.voltage' order by part",
        str(tmp_path / "v.parquet"),
    ) == [(float(value), "mV", part) for part, value in enumerate(CELLS, 1)]


def test_types_hold_the_largest_values(tmp_path: Path) -> None:
    everything = [a5(1, data_id, b"\xff" * 8) for data_id in range(256)]
    capture = write(tmp_path / "a.pcapng", [(number * 0.1, frame) for number, frame in enumerate(everything)])
    for rows in ("record", "moment", "value"):
        assert decode(capture, "--format", "parquet", "--rows", rows, "-o", tmp_path / "a.parquet") == 0
    assert decode(capture, "--format", "parquet", "-o", tmp_path / "a.parquet") == 0
    ((mask, left),) = query(
        "select max(balance_mask), max(remaining_capacity_mAh) from read_parquet(?)", str(tmp_path / "a.parquet")
    )
    assert (mask, left) == (2**48 - 1, 2**32 - 1)


def test_times_that_no_calendar_has_are_null(tmp_path: Path) -> None:
    with (tmp_path / "a.parquet").open("wb") as out:
        table = ParquetFile(out, RECORD_COLUMNS)
        table.put({"number": 1, "time_UTC": 2**80})
        table.put({"number": 2, "time_UTC": -1})
        table.close()
    times = read_table(tmp_path / "a.parquet").column("time_UTC").cast(pa.int64()).to_pylist()
    assert times == [None, -1]  # rounded down


def test_many_rows_in_groups_come_back_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parquet_file, "BATCH_ROWS", 3)
    monkeypatch.setattr(parquet_file, "GROUP_ROWS", 7)
    capture, out = ask_and_answer(tmp_path / "a.pcapng", *range(10)), tmp_path / "a.parquet"
    assert decode(capture, "--format", "parquet", "-o", out) == 0
    assert ParquetReader(out).metadata.num_row_groups == 3  # 9, 9, 2
    assert read_table(out).column("number").to_pylist() == list(range(1, 21))
    assert read_table(out).column("soc_percent").to_pylist() == [None, 38.5] * 10


def test_an_interrupted_write_leaves_what_was_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    capture = ask_and_answer(tmp_path / "a.pcapng", *range(10))

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(ParquetFile, "close", interrupted)
    for name in ("new.parquet", "old.parquet"):
        out = tmp_path / name
        if name.startswith("old"):
            out.write_bytes(b"what was there")
        assert decode(capture, "--format", "parquet", "-o", out) == 130
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.pcapng", "old.parquet"]
    assert (tmp_path / "old.parquet").read_bytes() == b"what was there"


def test_a_full_disk_is_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert decode(poll(tmp_path / "a.pcapng", 0), "--format", "parquet", "-o", "/dev/full") == 2
    gc.collect()
    assert capfd.readouterr().err == "dalyshark decode: /dev/full: cannot be written: No space left on device\n"


def test_a_csv_that_is_interrupted_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    capture = poll(tmp_path / "a.pcapng", 0)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Moments, "end_file", interrupted)
    assert decode(capture, "--format", "csv", "-o", tmp_path / "a.csv") == 130
    assert list(tmp_path.iterdir()) == [capture]


def test_a_capture_that_is_cut_off_is_exported_as_far_as_it_goes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capture = ask_and_answer(tmp_path / "a.pcapng", *range(10))
    capture.write_bytes(capture.read_bytes()[:-30])
    assert decode(capture, "--format", "parquet", "-o", tmp_path / "a.parquet") == 2
    assert capsys.readouterr().err.startswith("dalyshark decode: ")
    assert query("select count(*) from read_parquet(?)", str(tmp_path / "a.parquet")) == [(19,)]


def test_without_pyarrow_it_says_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def missing(_: str) -> None:
        return None

    monkeypatch.setattr(importlib.util, "find_spec", missing)
    assert decode(poll(tmp_path / "a.pcapng", 0), "--format", "parquet", "-o", tmp_path / "a.parquet") == 2
    said = capsys.readouterr().err
    assert said.startswith(
        f"dalyshark decode: Parquet needs the package pyarrow: type  {sys.executable} -m pip install "
    )
    assert said.endswith("[parquet]'\n")
    assert said.count("\n") == 1


def test_what_stands_in_the_table_is_what_the_decoder_says(tmp_path: Path) -> None:
    """Every field of every record, but for words in place of numbers and what stands for nothing."""
    packets = [Packet(number, number * 10**8, reply) for number, reply in enumerate((ASK, ANSWER, b"\x01"), 1)]
    records = list(decode_records(packets))
    capture = write(tmp_path / "a.pcapng", [(packet.time_ns / 1e9, packet.data) for packet in packets])
    assert decode(capture, "--format", "parquet", "-o", tmp_path / "a.parquet") == 0
    rows: list[dict[str, Any]] = read_table(tmp_path / "a.parquet").to_pylist()
    words = {"daly.direction", "daly.checksum.status"}
    for record, row in zip(records, rows, strict=True):
        told = {column.field: row[column.name] for column in RECORD_COLUMNS if row[column.name] is not None}
        assert {name for name in told if name} == set(record.fields)
        assert all(told[name] == value for name, value in record.fields.items() if name not in words)
