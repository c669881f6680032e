# SPDX-License-Identifier: GPL-2.0-or-later
"""The commands of docs/import.md do what the page says, and it names every kind of log."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

from dalytools.logs.kinds import KINDS, RAW

PAGE = (Path(__file__).parents[2] / "docs" / "import.md").read_text(encoding="utf-8")
LOG = """\
COM3 opened
[12:34:56.789] TX: A5 40 90 08 00 00 00 00 00 00 00 00 7D
[12:34:56.840] RX: A5 01 90 08 02 10 00 00 75 30 01 F4 EA
"""


def test_the_command_prints_what_the_page_shows(tmp_path: Path) -> None:
    (tmp_path / "terminal.log").write_text(LOG, encoding="utf-8")
    ((words, shown),) = re.findall(r"^    \$ dalyshark (.*)\n((?:    (?!\$).*\n)*)", PAGE, re.MULTILINE)
    line = [sys.executable, "-c", "from dalytools.cli import entry; entry()", *shlex.split(words)]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.stdout + done.stderr == re.sub(r"^    ", "", shown, flags=re.MULTILINE)


def test_every_kind_is_told() -> None:
    for name in (*KINDS, RAW):
        assert f"| `{name}` |" in PAGE
