# SPDX-License-Identifier: GPL-2.0-or-later
"""The modules that know nothing of Wireshark, in plain Lua 5.2 and 5.4."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from dalytools.tshark import dissector_folder

SCRIPT = Path(__file__).with_name("plain.lua")


@pytest.mark.parametrize("lua", ["lua5.2", "lua5.4"])
def test_plain_lua(lua: str) -> None:
    assert shutil.which(lua), f"{lua} is missing: make setup"
    done = subprocess.run(
        [lua, str(SCRIPT), str(dissector_folder())], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "all fine"
