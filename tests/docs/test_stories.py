# SPDX-License-Identifier: GPL-2.0-or-later
"""The commands of docs/stories.md print what the page shows, and each story's cause is named in what they print."""

from __future__ import annotations

import re
import shlex
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from dalytools.cli import main
from dalytools.findings.rules import RULES
from dalytools.simulator.scenario_file import ready_made

if TYPE_CHECKING:
    from collections.abc import Iterator

PAGE = (Path(__file__).parents[2] / "docs" / "stories.md").read_text(encoding="utf-8")
STORIES = dict(re.findall(r"^## (g\.\d) (?:.*)\n((?:(?!## ).*\n)*)", PAGE, re.MULTILINE))
LEFT_OUT = "..."


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TZ", "UTC")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


def commands(story: str) -> list[tuple[str, list[str]]]:
    blocks = re.findall(r"^    \$ dalyshark (.*)\n((?:    (?!\$ ).*\n|\n(?=    (?!\$ )))*)", story, re.MULTILINE)
    return [(words, [line.removeprefix("    ") for line in shown.splitlines()]) for words, shown in blocks]


def pieces(shown: list[str]) -> list[list[str]]:
    """Divide what is shown at the lines that stand for lines left out."""
    out: list[list[str]] = [[]]
    for line in shown:
        if line == LEFT_OUT:
            out.append([])
        else:
            out[-1].append(line)
    return out


def found(piece: list[str], lines: list[str], start: int) -> int:
    """Return where the piece begins, at or behind start."""
    return next(at for at in range(start, len(lines)) if lines[at : at + len(piece)] == piece)


@pytest.mark.parametrize("name", [f"g.{number}" for number in range(1, 10)])
def test_commands_print_what_the_page_shows(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    told = commands(STORIES[name])
    assert any(words.startswith("simulate ") for words, _ in told)
    for words, shown in told:
        main(shlex.split(words))
        output = capsys.readouterr()
        lines = [line.rstrip() for line in (output.out + output.err).splitlines()]
        first, *rest = pieces(shown)
        assert lines[: len(first)] == first, words
        at = len(first)
        for piece in rest:
            at = found(piece, lines, at) + len(piece)
        if LEFT_OUT not in shown:
            assert lines == first, words


def test_the_first_table_names_the_rules_that_each_story_shows() -> None:
    rows = re.findall(r"^\| .* \| \[(g\.\d)\]\(#.*\) \| (.*) \|$", PAGE, re.MULTILINE)
    assert [name for name, _ in rows] == sorted(STORIES)
    for name, rules in rows:
        for rule in re.findall(r"`(.*?)`", rules):
            assert rule in RULES
            assert re.search(rf"(?:error|warning|note) +{rule} ", STORIES[name]), (name, rule)


def test_every_story_of_the_scenarios_is_told() -> None:
    scenarios = {name: one.story for name, one in ready_made().items() if one.story}
    assert set(scenarios.values()) == set(STORIES)
