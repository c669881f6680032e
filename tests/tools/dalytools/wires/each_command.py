# SPDX-License-Identifier: GPL-2.0-or-later
"""Each command that reads captures of every wire, for tests that hold for all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from dalytools.cli import main

if TYPE_CHECKING:
    from pathlib import Path

COMMANDS = {
    "decode": ("decode",),
    "check": ("check",),
    "check alone": ("check", "--no-dissector"),
    "report": ("report",),
    "survey": ("survey",),
}
every = pytest.mark.parametrize("command", COMMANDS)


def run(command: str, path: Path | str, tmp_path: Path, *options: str) -> int:
    """Run it on a file; return its exit status."""
    output = ("-o", str(tmp_path / "out.html")) if command == "report" else ()
    return main([*COMMANDS[command], *options, str(path), *output])
