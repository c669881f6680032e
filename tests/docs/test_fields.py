# SPDX-License-Identifier: GPL-2.0-or-later
"""docs/fields.md is what the dissector says of its fields, and those are the ones that both readings share."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from dalytools.field_names import FIELD_NAMES, VIEW_NAMES
from dalytools.tshark import Tshark

DOCS = Path(__file__).parents[2] / "docs"
EXPERT = "FT_NONE"


@pytest.fixture(scope="module")
def fields() -> list[tuple[str, str, str, str]]:
    with Tshark() as tshark:
        return tshark.fields()


def test_committed_page_is_the_dissectors(tmp_path: Path) -> None:
    subprocess.run([sys.executable, DOCS / "make_fields.py", tmp_path / "fields.md"], check=True, timeout=120)
    made = (tmp_path / "fields.md").read_text(encoding="utf-8")
    assert (DOCS / "fields.md").read_text(encoding="utf-8") == made, "out of date: make docs"


def test_names_are_the_shared_ones(fields: list[tuple[str, str, str, str]]) -> None:
    names = [name for _, name, kind, _ in fields if kind != EXPERT]
    assert len(names) == len(set(names))
    assert set(names) == {*FIELD_NAMES, *VIEW_NAMES}


def test_every_field_and_note_has_a_label(fields: list[tuple[str, str, str, str]]) -> None:
    assert not [name for label, name, _, _ in fields if not label]


def test_every_field_has_a_description(fields: list[tuple[str, str, str, str]]) -> None:
    bare = [name for _, name, kind, description in fields if kind != EXPERT and not description]
    assert not bare


def test_every_field_says_how_sure_it_is(fields: list[tuple[str, str, str, str]]) -> None:
    words = ("documented", "seen", "contradicted", "generated", "as on the wire", "another vendor paper")
    unsure = [
        name
        for _, name, kind, description in fields
        if kind != EXPERT and not (description.endswith("]") and description.rpartition("[")[2].startswith(words))
    ]
    assert not unsure


# What the paper (V1.2, sections 2 and 3) gives these in.
UNITS = {
    "daly.pack.voltage": "V",
    "daly.pack.gather_voltage": "V",
    "daly.pack.current": "A",
    "daly.soc": "%",
    "daly.cell.max_voltage": "mV",
    "daly.cell.min_voltage": "mV",
    "daly.temperature.max": "C",
    "daly.temperature.min": "C",
    "daly.remaining_capacity": "mAh",
    "daly.cell.voltage": "mV",
    "daly.temperature": "C",
    "daly.cells.voltage": "mV",
    "daly.cells.min": "mV",
    "daly.cells.max": "mV",
    "daly.cells.average": "mV",
    "daly.cells.spread": "mV",
    "daly.response_time": "s",
}


@pytest.mark.parametrize(("name", "unit"), UNITS.items())
def test_quantities_name_their_unit(fields: list[tuple[str, str, str, str]], name: str, unit: str) -> None:
    (description,) = [description for _, field, _, description in fields if field == name]
    assert unit in description.replace(";", " ").replace(",", " ").split()
