# SPDX-License-Identifier: GPL-2.0-or-later
"""The commands of docs/scenarios.md do what the page says."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

from dalytools.simulator.scenario_file import parsed
from dalytools.simulator.truth import KINDS

PAGE = (Path(__file__).parents[2] / "docs" / "scenarios.md").read_text(encoding="utf-8")


def test_commands_print_what_the_page_shows(tmp_path: Path) -> None:
    (tmp_path / "mistake.toml").write_text("[[board]]\ncels = 4\n", encoding="utf-8")
    blocks = re.findall(r"^    \$ dalyshark (.*)\n((?:    (?!\$).*\n)*)", PAGE, re.MULTILINE)
    assert len(blocks) == 7
    for words, shown in blocks:
        done = subprocess.run(
            [sys.executable, "-c", "from dalytools.cli import entry; entry()", *shlex.split(words)],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert done.stdout + done.stderr == re.sub(r"^    ", "", shown, flags=re.MULTILINE), words


def test_the_scenario_of_the_page_is_one() -> None:
    (text,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    assert parsed(text, "page").boards[0].number == 2


def test_every_kind_of_note_is_told() -> None:
    for kind in KINDS:
        assert f"`{kind}`" in PAGE
