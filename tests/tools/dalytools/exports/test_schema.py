# SPDX-License-Identifier: GPL-2.0-or-later
"""Columns: every field has one, of the type and unit that the dissector says (docs/fields.md)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from dalytools.exports.arrow_schema import arrow_schema
from dalytools.exports.schema import FIELDS, RECORD_COLUMNS, Column
from dalytools.field_names import FIELD_NAMES

PAGE = (Path(__file__).parents[4] / "docs/fields.md").read_text("utf-8")
SAID = {
    name: (kind.strip(), about)
    for name, kind, about in re.findall(r"^\| `(daly\.\S+)` \| ([^|]+) \| [^|]+ \| ([^|]+) \|", PAGE, re.MULTILINE)
}
TYPES = {
    "boolean": {"bool"},
    "bytes": {"text"},
    "double": {"double"},
    "packet number": {"int64"},
    "16 bits, signed": {"int32"},
    "32 bits, signed": {"int32"},
    "text": {"text"},
    "8 bits": {"int32"},
    "16 bits": {"int32"},
    "32 bits": {"int64"},
    "64 bits": {"int64"},
}
BY_FIELD = {column.field: column for column in FIELDS}


def test_every_field_is_a_column_in_the_order_of_the_names() -> None:
    assert [column.field for column in FIELDS] == list(FIELD_NAMES)


@pytest.mark.parametrize("columns", [FIELDS, RECORD_COLUMNS], ids=["fields", "records"])
def test_no_two_columns_have_one_name_even_where_case_does_not_count(columns: tuple[Column, ...]) -> None:
    names = [column.name.lower() for column in columns]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[a-z][a-z0-9_]*", name) for name in names)  # no quotes needed in SQL


@pytest.mark.parametrize("column", FIELDS, ids=lambda column: column.field)
def test_types_and_units_are_those_of_the_dissector(column: Column) -> None:
    kind, about = SAID[column.field]
    assert column.type in TYPES[kind] or (column.words and column.type == "text")
    units = re.findall(r"(?:^|[ ,])(mV|V|mA|A|mAh|Ah|C|%|s|min|W|Wh|km)(?=[,;])", f"{about.strip()};")
    if column.field in {"daly.alarm.value", "daly.alarm.recovery"}:
        assert column.unit == ""  # by its class
    elif column.unit:
        assert column.unit == units[0]
    else:
        assert not units or column.field in {"daly.pack.current_raw"}  # says what a step is


def test_names_carry_the_unit() -> None:
    assert BY_FIELD["daly.pack.voltage"].name == "pack_voltage_V"
    assert BY_FIELD["daly.soc"].name == "soc_percent"
    assert BY_FIELD["daly.cells.voltage"].name == "cells_voltage_mV"
    assert BY_FIELD["daly.fault.eeprom"].name == "fault_eeprom"


def test_words_stand_for_numbers_and_a_number_without_a_word_stays() -> None:
    state = BY_FIELD["daly.state"]
    assert [state.values(sent) for sent in (0, 1, 2, 7)] == ["stationary", "charging", "discharging", "7"]
    inverter = BY_FIELD["daly.setting.inverter"]  # field notes, a.2: 0x69
    assert [inverter.values(sent) for sent in (0, 1, 4, 8, 9)] == ["none", "Pylon", "Voltronic", "Victron", "9"]


def test_no_sensor_is_no_temperature() -> None:
    assert BY_FIELD["daly.sensors.temperature"].values([21, -40, 215]) == [21, None, None]
    assert BY_FIELD["daly.temperature.max"].values(-40) is None
    assert BY_FIELD["daly.temperature.max"].values(0) == 0
    assert BY_FIELD["daly.setting.charge_temp_low_1"].values(-40) == -40  # a limit, no sensor


def test_arrow_knows_types_and_units() -> None:
    schema: Any = arrow_schema(RECORD_COLUMNS)
    assert schema.field("time_UTC").type == pa.timestamp("us", tz="UTC")
    assert schema.field("pack_voltage_V").type == pa.float64()
    assert schema.field("pack_voltage_V").metadata == {b"unit": b"V", b"field": b"daly.pack.voltage"}
    assert schema.field("cells_voltage_mV").type == pa.list_(pa.int32())
    assert schema.field("fault_eeprom").type == pa.bool_()
    assert schema.field("state").type == pa.string()
    assert "cell_01_mV" not in schema.names  # in cells_voltage_mV
