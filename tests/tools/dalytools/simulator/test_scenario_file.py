# SPDX-License-Identifier: GPL-2.0-or-later
"""Scenario files: what they say is what comes out, and every mistake is one line that helps."""

from __future__ import annotations

import re
import tomllib
from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dalytools.problem import Problem
from dalytools.simulator.scenario import Board, Host, Phase, Scenario
from dalytools.simulator.scenario_file import example_text, parsed, read_scenario, ready_made

if TYPE_CHECKING:
    from pathlib import Path


def test_an_empty_file_is_the_default() -> None:
    assert parsed("", "x") == Scenario()


def test_the_example_shows_the_defaults() -> None:
    """All keys of [[board]] and [[host]] stand there with their defaults, but for the board that sleeps."""
    found = parsed(example_text(), "example")
    assert found.boards == (Board(asleep="echo"),)
    assert found.hosts == (Host(),)
    assert found.boards[0].pack.profile[0] == Phase(-32, 30)
    assert not found.damage.total


def test_the_example_names_every_key() -> None:
    """A key that no comment tells of can't be found: those that `means nothing here` offers are all in the example."""
    text = example_text()
    for table in ("", "[[board]]\n", "[[host]]\n", "[damage]\n", "[[foreign]]\n", "[[board]]\n[board.texts]\n"):
        with pytest.raises(Problem) as problem:
            parsed(f"{table}nonsense = 1", "x")
        known = str(problem.value).split("known are: ")[1].split(", ")
        for key in known:
            assert re.search(rf"\b{key}\b", text), key


def test_ready_made_ones_are_read_and_tell_what_they_show() -> None:
    found = ready_made()
    assert len(found) >= 20
    assert {f"g.{number}" for number in range(1, 10)} <= {scenario.story for scenario in found.values()}
    for name, scenario in found.items():
        assert 10 < len(scenario.about) <= 125, name
        assert read_scenario(name) == scenario


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("seed = ", "is not TOML"),
        ("[[board]]\ncells = 49", "board 1: cells = 49: must be a whole number from 1 to 48"),
        (
            "[[board]]\n[[board]]\nnumber = 2\ncells = true",
            "board 2: cells = true: must be a whole number from 1 to 48",
        ),
        ("[[board]]\ncels = 4", "board 1: cels means nothing here; did you mean cells?"),
        ("[[board]]\nchemistry = 'lead'", "chemistry = 'lead': must be one of lfp, nmc, lto"),
        ("[[board]]\n[[board]]", "two boards with one number"),
        ("[[board]]\nload = [{amperes = 1, seconds = 0}]", "board 1: load 1: seconds = 0: must be a number from 0.1"),
        ("[[board]]\ndialects = ['can']", "must be a list of one of a5, d2, 81"),
        ("[[board]]\nfaults = ['cell_volt_hihg_level_1']", "such as cell_volt_high_level_1"),
        ("[board]\ncells = 4", "board = {'cells': 4}: must be at most 1000 tables, each begun by [[board]]"),
        (
            "[[board]]\n[board.texts]\nserial_number = 'ä'",
            "board 1: texts: serial_number = 'ä': must be a text of at most",
        ),
        ("[[board]]\nproduction_date = '2024-01-01'", "must be a date from 2000-01-01"),
        ("[[host]]\naddress = 0x01", "host 1: address = 1: must be an address of a host, 0x20 to 0xff"),
        ("[[host]]\nplan = [256]", "must be a list of data IDs"),
        ("[[host]]\nplan = []", "at least one data ID"),
        (
            "[[host]]\nreads = [{register = 1, count = 127}]",
            "host 1: reads 1: count = 127: must be a whole number from 1",
        ),
        ("[damage]\ndrop = 0.6\ncut = 0.6", "damage: damage to 1.2 of the frames: must be 0 to 1 in all"),
        ("[damage]\ndrop = nan", "damage: drop = nan: must be a number from 0 to 1"),
        ("[[foreign]]\ndata = 'A5 4'", "foreign 1: data = 'A5 4': must be 1 to 256 bytes in hex"),
        ("[[foreign]]", "a foreign station says 1 to 256 bytes"),
        ("[[event]]\nat = 1", "event 1: do is missing: what happens, one of sleep, wake"),
        ("[[event]]\ndo = 'explode'", "event 1: do = 'explode': must be one of sleep, wake"),
        ("[[event]]\ndo = 'fault'", "event 1: name is missing"),
        ("[[event]]\ndo = 'wake'\nname = 'x'", "event 1: name means nothing here"),
        ("[[event]]\ndo = 'wake'\nboard = 3", "event 1: board = 3: must be one of the boards of this file: 1"),
        ("[[event]]\ndo = 'write'\ndialect = 'd2'", "event 1: register is missing"),
        ("wire = 'wifi'", "wire = 'wifi': must be one of uart, can, ble, tcp"),
        ("start = 2026-01-01", "start = 2026-01-01: must be a date and time"),
        ("seed = 99999999999999999999999", "must be a whole number from 0"),
        ("x = " + "[" * 2000 + "]" * 2000, "not TOML"),
    ],
)
def test_a_mistake_is_one_line_with_file_key_and_what_is_allowed(text: str, says: str) -> None:
    with pytest.raises(Problem) as problem:
        parsed(text, "my.toml")
    assert str(problem.value).startswith("my.toml: ")
    assert says in str(problem.value)
    assert "\n" not in str(problem.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    for name, says in (
        ("faluts", "did you mean faults?"),
        ("/no/where.toml", "no such file"),
        (str(tmp_path), "directory"),
    ):
        with pytest.raises(Problem) as problem:
            read_scenario(name)
        assert says in str(problem.value)
    for content, says in ((b"\xff\xfe", "UTF-8"), (b"#" * (1 << 20) + b"##", "larger than 1 MiB")):
        (tmp_path / "x.toml").write_bytes(content)
        with pytest.raises(Problem) as problem:
            read_scenario(str(tmp_path / "x.toml"))
        assert says in str(problem.value)


@given(st.data())
@settings(max_examples=150, deadline=None)
def test_changed_examples_are_read_or_refused_in_a_line(data: st.DataObject) -> None:
    lines = example_text().splitlines()
    place = data.draw(st.integers(0, len(lines) - 1))
    line = lines[place]
    lines[place] = data.draw(
        st.sampled_from(
            ["", line[:-3], line.replace("=", "= -"), line.replace('"', ""), line + "0", "[[event]]", "[x]"]
        )
    )
    said = ""
    try:
        parsed("\n".join(lines), "x")
    except Problem as problem:
        said = str(problem)
    assert "\n" not in said
    assert len(said) < 600


def test_the_example_is_toml_with_every_table() -> None:
    assert set(tomllib.loads(example_text())) >= {"board", "host", "damage", "foreign", "event"}
