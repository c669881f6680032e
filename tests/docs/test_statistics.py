# SPDX-License-Identifier: GPL-2.0-or-later
"""The outputs in docs/statistics.md are what tshark prints."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"


def test_committed_outputs_are_tsharks(tmp_path: Path) -> None:
    made = tmp_path / "statistics.md"
    subprocess.run([sys.executable, DOCS / "make_statistics.py", made], check=True, timeout=120)
    text = made.read_text(encoding="utf-8")
    assert (DOCS / "statistics.md").read_text(encoding="utf-8") == text, "out of date: make docs"
    assert text.count("    Daly BMS: ") == 4
