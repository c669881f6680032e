# SPDX-License-Identifier: GPL-2.0-or-later
"""Every command has its module, its line in the help, and its row in the README."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from dalytools import commands
from dalytools.cli import COMMANDS, MODULES

README = (Path(__file__).parents[3] / "README.md").read_text(encoding="utf-8")


def test_every_module_is_a_command() -> None:
    modules = {path.stem for path in Path(commands.__path__[0]).glob("*.py")} - {"__init__"}
    assert {MODULES.get(name, name) for name in COMMANDS} == modules


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_can_be_loaded_and_is_in_the_readme(name: str) -> None:
    module = importlib.import_module(f"dalytools.commands.{MODULES.get(name, name)}")
    assert callable(module.run)
    assert f"`dalyshark {name}" in README or f"; `{name}`" in README
