# SPDX-License-Identifier: GPL-2.0-or-later
"""A missing optional package: what to type puts it into the Python that missed it; from a clone, from there."""

from __future__ import annotations

import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

from dalytools import extra

if TYPE_CHECKING:
    import pytest

CLONE = Path(__file__).parents[3]


def test_in_a_clone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/home/a b/.venv/bin/python")
    said = str(extra.missing("plots need", "plotly", "report"))
    assert said.startswith(
        "plots need the package plotly: type  '/home/a b/.venv/bin/python' -m pip install --editable "
    )
    assert shlex.split(said)[-1] == f"{CLONE}[report]"


def test_from_a_wheel(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(extra, "SOURCES", tmp_path)
    monkeypatch.setattr(sys, "executable", "/usr/bin/python3")
    said = str(extra.missing("TCP is read with", "scapy", "scapy"))
    assert said == "TCP is read with the package scapy: type  /usr/bin/python3 -m pip install 'dalyshark[scapy]'"


def test_every_extra_that_is_named_is_there() -> None:
    """In messages and on the pages."""
    extras = set(
        tomllib.loads((CLONE / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    )
    found = subprocess.run(
        ["git", "grep", "-hoE", r"(dalyshark|\.)\[[a-z,]+\]'", "--", "docs", "README.md", "CHANGELOG.md"],
        cwd=CLONE,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    named = {name for line in found.split() for name in line.partition("[")[2].rstrip("]'").split(",")}
    assert named <= extras
    assert len(named) >= 4
