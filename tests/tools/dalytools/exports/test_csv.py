# SPDX-License-Identifier: GPL-2.0-or-later
"""``decode --format csv``: rows that a spreadsheet shows right, and safely."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

import pytest
from tests.tools.dalytools.exports.sessions import CELLS, TOLD, ask_and_answer, decode, poll, table
from tests.tools.dalytools.made import ANSWER, ASK, a5, write

from dalyref.decoder import decode as decode_records
from dalyref.packet import Packet
from dalytools.exports.csv_file import CsvFile, safe, time_text
from dalytools.exports.moments import Moments
from dalytools.exports.schema import FIELDS, TIME

if TYPE_CHECKING:
    from pathlib import Path


def test_a_moment_is_a_round_of_polling(tmp_path: Path) -> None:
    capture, out = poll(tmp_path / "a.pcapng", 0, 2), tmp_path / "a.csv"
    assert decode(capture, "--format", "csv", "-o", out) == 0
    first, second = table(out)
    assert {name: first[name] for name in TOLD} == TOLD
    assert first["file"] == str(capture)
    assert (first["number"], second["number"]) == ("1", "12")
    assert second["time_UTC"] == "2023-11-14 22:13:22.000000"
    assert "" not in second.values()  # columns that occur, and no others
    assert [name for name, value in first.items() if not value] == ["pack_state"]  # of a 93 before the 90
    assert sorted(tmp_path.iterdir()) == [out, capture]


def test_what_was_not_told_is_empty_and_nothing_is_carried_on(tmp_path: Path) -> None:
    capture = write(
        tmp_path / "a.pcapng",
        [(0, ANSWER), (0.1, a5(1, 0x93, bytes.fromhex("0201000000000000"))), (1, ANSWER), (2, ANSWER)],
    )
    assert decode(capture, "--format", "csv", "-o", tmp_path / "a.csv") == 0
    rows = table(tmp_path / "a.csv")
    assert [(row["pack_voltage_V"], row["state"]) for row in rows] == [
        ("24.8", "discharging"),
        ("24.8", ""),
        ("24.8", ""),
    ]


def test_a_moment_spans_ten_seconds_at_most(tmp_path: Path) -> None:
    mos = a5(1, 0x93, bytes(8))
    capture = write(tmp_path / "a.pcapng", [(0, ANSWER), (9.9, mos), (20, ANSWER), (30.1, mos)])
    assert decode(capture, "--format", "csv", "-o", tmp_path / "a.csv") == 0
    assert [(row["number"], row["pack_voltage_V"], row["state"]) for row in table(tmp_path / "a.csv")] == [
        ("1", "24.8", "stationary"),
        ("3", "24.8", ""),
        ("4", "", "stationary"),
    ]


def test_boards_have_rows_of_their_own_in_the_order_of_time(tmp_path: Path) -> None:
    slow, fast = a5(1, 0x90, ANSWER[4:12]), a5(2, 0x90, ANSWER[4:12])
    capture = write(tmp_path / "a.pcapng", [(0, slow), (1, fast), (2, fast), (3, fast), (8, slow)])
    assert decode(capture, "--format", "csv", "-o", tmp_path / "a.csv") == 0
    assert [(row["number"], row["board"]) for row in table(tmp_path / "a.csv")] == [
        ("1", "1"),
        ("2", "2"),
        ("3", "2"),
        ("4", "2"),
        ("5", "1"),
    ]


def test_two_connections_on_one_interface_are_two_packs() -> None:
    """Both say board 1; the second's reply is between two of the first's."""
    mos = a5(1, 0x93, bytes.fromhex("0201000000000000"))
    packets = [
        Packet(1, 0, ANSWER, transport="tcp", connection="a", direction="inbound"),
        Packet(2, 10**9, mos, transport="tcp", connection="b", direction="inbound"),
    ]
    shape = Moments(span_ns=10**10)
    rows = [row for record in decode_records(packets) for row in shape.take("f", record)] + shape.end_file()
    told = [(row["connection"], row.get("pack_voltage_V"), row.get("state")) for row in rows]
    assert told == [("a", 24.8, None), ("b", None, "discharging")]


def test_damaged_records_and_requests_are_no_values(tmp_path: Path) -> None:
    damaged = ANSWER[:-1] + bytes([ANSWER[-1] ^ 1])
    capture = write(tmp_path / "a.pcapng", [(0, ASK), (0.05, damaged), (1, ASK), (1.05, ASK), (1.2, ANSWER[:8])])
    for rows in ("moment", "value"):
        assert decode(capture, "--format", "csv", "--rows", rows, "-o", tmp_path / "a.csv") == 0
        assert table(tmp_path / "a.csv") == []
        assert (tmp_path / "a.csv").read_text("utf-8").startswith("file,number,time_UTC,interface,")
    assert decode(capture, "--format", "csv", "--rows", "record", "-o", tmp_path / "a.csv") == 0
    rows = table(tmp_path / "a.csv")
    assert [row["kind"] for row in rows] == ["frame", "bad_checksum", "frame", "frame", "short"]
    assert [row["direction"] for row in rows] == ["request", "", "request", "echo", ""]
    assert rows[1]["checksum_status"] == "bad"
    assert rows[1]["data_id"] == "0x90"
    assert rows[4]["undecoded"] == "0x" + ANSWER[:8].hex()
    assert "pack_voltage_V" not in rows[0]


def test_a_sensor_that_is_not_there_is_empty(tmp_path: Path) -> None:
    counts, sensors = a5(1, 0x94, bytes([8, 3])), a5(1, 0x96, bytes([1, 61, 0, 255]))  # 21 C, none, none
    capture = write(tmp_path / "a.pcapng", [(0, counts), (0.1, sensors)])
    assert decode(capture, "--format", "csv", "-o", tmp_path / "a.csv") == 0
    (row,) = table(tmp_path / "a.csv")
    assert row["sensor_01_C"] == "21"
    assert "sensor_02_C" not in row
    assert decode(capture, "--format", "csv", "--rows", "record", "-o", tmp_path / "b.csv") == 0
    assert table(tmp_path / "b.csv")[1]["sensors_temperature_C"] == "21 none none"


def test_a_row_a_value(tmp_path: Path) -> None:
    capture = poll(tmp_path / "a.pcapng", 0)
    assert decode(capture, "--format", "csv", "--rows", "value", "-o", tmp_path / "a.csv") == 0
    rows = table(tmp_path / "a.csv")
    of = {row["field"]: row for row in rows}
    assert (of["daly.soc"]["value"], of["daly.soc"]["unit"], of["daly.soc"]["data_id"]) == ("38.5", "%", "0x90")
    assert (of["daly.state"]["value"], of["daly.state"]["text"]) == ("0", "stationary")
    assert (of["daly.mos.charge"]["value"], of["daly.mos.charge"]["text"]) == ("1", "true")
    cells = [row for row in rows if row["field"] == "daly.cells.voltage"]
    assert [int(row["value"]) for row in cells] == CELLS
    assert [int(row["part"]) for row in cells] == list(range(1, 9))
    assert {row["unit"] for row in cells} == {"mV"}
    assert {row["board"] for row in rows} == {"1"}


def test_fields_named_are_columns_in_that_order_whether_they_occur_or_not(tmp_path: Path) -> None:
    capture = poll(tmp_path / "a.pcapng", 0)
    words = ("--format", "csv", "--fields", "soc,daly.power,cells_max_mV", "-o", tmp_path / "a.csv")
    assert decode(capture, *words) == 0
    (row,) = table(tmp_path / "a.csv")
    assert list(row)[6:] == ["soc_percent", "power_W", "cells_max_mV"]
    assert list(row.values())[6:] == ["38.5", "", "3154"]


def test_patterns_and_cells(tmp_path: Path) -> None:
    capture = poll(tmp_path / "a.pcapng", 0)
    assert decode(capture, "--format", "csv", "--fields", "daly.cell.0*", "-o", tmp_path / "a.csv") == 0
    (row,) = table(tmp_path / "a.csv")
    assert [int(value) for value in list(row.values())[6:]] == CELLS
    assert decode(capture, "--format", "csv", "--fields", "daly.sensors.temperature", "-o", tmp_path / "b.csv") == 0
    (row,) = table(tmp_path / "b.csv")
    assert row["sensor_01_C"] == "21"


def test_records_that_have_none_of_the_fields_are_left_out(tmp_path: Path) -> None:
    capture = ask_and_answer(tmp_path / "a.pcapng", 0, 1)
    words = ("--format", "csv", "--rows", "record", "--fields", "response_time,soc", "-o", tmp_path / "a.csv")
    assert decode(capture, *words) == 0
    rows = table(tmp_path / "a.csv")
    assert [row["number"] for row in rows] == ["2", "4"]
    # 50 ms less 13 characters of 10 bits at 9600 baud
    assert float(rows[0]["response_time_s"]) == pytest.approx(0.05 - 130 / 9600, abs=1e-6)


def test_many_captures(tmp_path: Path) -> None:
    captures = [poll(tmp_path / f"{name}.pcapng", 0) for name in "abc"]
    assert decode(*captures, "--format", "csv", "-o", tmp_path / "a.csv") == 0
    assert [row["file"] for row in table(tmp_path / "a.csv")] == list(map(str, captures))


def test_text_of_the_battery_is_no_formula(tmp_path: Path) -> None:
    # Battery code, 0x57: "=cmd|'/C" and so on, seven characters a frame.
    text = b"=1+cmd|'/C calc'!A0"
    frames = [a5(1, 0x57, bytes([number + 1]) + text[7 * number : 7 * number + 7]) for number in range(3)]
    capture = write(tmp_path / "a.pcapng", [(number * 0.02, frame) for number, frame in enumerate(frames)])
    assert decode(capture, "--format", "csv", "-o", tmp_path / "a.csv") == 0
    (row,) = table(tmp_path / "a.csv")
    assert row["battery_code"] == "'=1+cmd|'/C calc'!A0"


def test_comments_and_names_of_files_can_do_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    comment = '@SUM(1)\n"a",\x1b[31m\x00\u202e'
    write(tmp_path / "=a.pcapng", [(0, b"")], comment=comment)
    assert decode("=a.pcapng", "--format", "csv", "--rows", "record", "-o", "out.csv") == 0
    (row,) = table(tmp_path / "out.csv")
    assert row["file"] == "'=a.pcapng"
    assert row["kind"] == "event"
    assert row["comment"].startswith('\'@SUM(1)\\n"a",\\x1b[31m')
    assert row["comment"].isprintable()


@pytest.mark.parametrize("begin", ["=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20"])
def test_what_a_spreadsheet_would_take_for_a_formula(begin: str) -> None:
    assert safe(f"{begin}1") == f"'{begin}1"


def test_what_is_no_formula_stays() -> None:
    assert [safe(text) for text in ("a=1", "", "'x", "1-2")] == ["a=1", "", "'x", "1-2"]
    assert safe("\t=1") == "\\t=1"


def test_negative_numbers_are_numbers() -> None:
    columns = [column for column in FIELDS if column.name in {"pack_current_A", "temperature_min_C"}]
    out = io.StringIO()
    CsvFile(out, columns).put({"pack_current_A": -1.5, "temperature_min_C": -7})
    assert list(csv.reader(io.StringIO(out.getvalue())))[1] == ["-1.5", "-7"]


@pytest.mark.parametrize(
    ("time_ns", "text"),
    [
        (0, "1970-01-01 00:00:00.000000"),
        (1_999, "1970-01-01 00:00:00.000001"),  # rounded down
        (-1, "1969-12-31 23:59:59.999999"),
        (2**80, ""),  # a broken clock: no time rather than a wrong one
        (-(2**80), ""),
    ],
)
def test_times(time_ns: int, text: str) -> None:
    assert time_text(time_ns) == text
    out = io.StringIO()
    CsvFile(out, [TIME]).put({TIME.name: time_ns})
    assert out.getvalue().splitlines()[1] == (text or '""')


def test_one_names_what_there_is_not(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture = poll(tmp_path / "a.pcapng", 0)
    assert decode(capture, "--format", "csv", "--fields", "daly.sock") == 2
    assert capsys.readouterr().err == (
        "dalyshark decode: --fields: no column is called 'daly.sock'; do you mean daly.soc?\n"
    )


@pytest.mark.parametrize(
    "words",
    [
        ("--rows", "value"),
        ("--fields", "daly.soc"),
        ("--partition", "board", "--format", "csv"),
        ("--label", "site=a", "--format", "jsonl"),
        ("--label", "board=a", "--format", "csv"),
        ("--label", "a=", "--format", "csv"),
        ("--format", "parquet"),
    ],
)
def test_what_does_not_fit_together_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    capture = poll(tmp_path / "a.pcapng", 0)
    try:
        status: object = decode(capture, *words)
    except SystemExit as end:
        status = end.code
    out = capsys.readouterr()
    assert (status, out.out) == (2, "")
    assert out.err.startswith("dalyshark decode: ")


def test_labels_are_columns(tmp_path: Path) -> None:
    capture = poll(tmp_path / "a.pcapng", 0)
    words = ("--format", "csv", "--label", "site=harbour", "--label", "rack=r-2", "-o", tmp_path / "a.csv")
    assert decode(capture, *words) == 0
    (row,) = table(tmp_path / "a.csv")
    assert list(row.items())[:2] == [("site", "harbour"), ("rack", "r-2")]


def test_standard_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capture = poll(tmp_path / "a.pcapng", 0)
    assert decode(capture, "--format", "csv") == 0
    out = capsys.readouterr().out
    (row,) = csv.DictReader(io.StringIO(out))
    assert {name: row[name] for name in TOLD} == TOLD


@pytest.mark.parametrize("rows", ["moment", "record", "value"])
def test_columns_that_are_always_there_may_be_named(
    rows: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Who names time_UTC, as it stands in the first line, means what is there."""
    capture = poll(tmp_path / "a.pcapng", 0)
    for fields in ("daly.soc", "time_UTC,daly.soc", "number,daly.soc,file,interface"):
        assert decode(capture, "--format", "csv", "--rows", rows, "--fields", fields) == 0
    out = capsys.readouterr().out
    third = len(out) // 3
    assert out == out[:third] * 3
    assert "soc" in out
    assert decode(capture, "--format", "csv", "--rows", rows, "--fields", "time_UTC") == 2
    assert capsys.readouterr().err == "dalyshark decode: --fields: time_UTC is there in any case; name a field too\n"
