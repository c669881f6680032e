# SPDX-License-Identifier: GPL-2.0-or-later
"""The commands of docs/survey.md print what the page shows."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "survey.md").read_text(encoding="utf-8")


def test_commands_print_what_the_page_shows(tmp_path: Path) -> None:
    (scenario,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "after.toml").write_text(scenario, encoding="utf-8")
    blocks = re.findall(r"^    \$ dalyshark (.*)\n((?:    (?!\$).*\n|\n(?=    (?!\$)))*)", PAGE, re.MULTILINE)
    assert [words.split()[0] for words, _ in blocks] == ["simulate", "survey", "simulate", "survey"]
    for words, shown in blocks:
        done = subprocess.run(
            [sys.executable, "-c", "from dalytools.cli import entry; entry()", *shlex.split(words)],
            cwd=tmp_path,
            env={**os.environ, "PYTHONIOENCODING": "utf-8"},
            capture_output=True,
            encoding="utf-8",
            timeout=60,
            check=False,
        )
        assert done.stdout + done.stderr == re.sub(r"^    ", "", shown, flags=re.MULTILINE), words
