# SPDX-License-Identifier: GPL-2.0-or-later
"""Packages that not everybody needs (pyproject.toml, optional-dependencies): what to type when one is missing."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

from dalytools.problem import Problem

SOURCES = Path(__file__).parents[2]
"""Where a clone's pyproject.toml stands; installed from a wheel, there is none."""


def missing(what: str, package: str, extra: str) -> Problem:
    """Say that what is wanted needs a package: into this Python, and in a clone from the clone."""
    clone = (SOURCES / "pyproject.toml").is_file()
    wanted = ["--editable", f"{SOURCES}[{extra}]"] if clone else [f"dalyshark[{extra}]"]
    command = shlex.join([sys.executable, "-m", "pip", "install", *wanted])
    return Problem(f"{what} the package {package}: type  {command}")
