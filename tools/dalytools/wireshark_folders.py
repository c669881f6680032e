# SPDX-License-Identifier: GPL-2.0-or-later
"""Where this user's Wireshark looks for Lua plugins and profiles: asked of tshark itself (``tshark -G folders``)."""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

from dalytools.problem import Problem
from dalytools.tshark import find_tshark


@dataclass(frozen=True, slots=True)
class WiresharkFolders:
    """One Wireshark of this machine, as the user who runs us."""

    program: str
    """Path of its tshark."""
    version: str
    """Such as ``4.0.17``; empty where it does not say."""
    lua: bool
    """It was built with Lua: without, it has no plugins of this kind."""
    plugins: Path
    """Personal Lua plugins."""
    profiles: Path
    """Personal profiles, one folder each."""


def wireshark_folders() -> WiresharkFolders:
    """Ask the tshark of this machine. Raises Problem where there is none, or where it does not answer."""
    program = find_tshark()
    told = _ask(program, "-G", "folders")
    places = dict(re.findall(r"(?m)^([^:\n]+):\s+(\S.*)$", told))
    plugins = places.get("Personal Lua Plugins") or places.get("Personal Plugins")
    configuration = places.get("Personal configuration")
    if not plugins or not configuration:
        raise Problem(f"{program} does not tell its folders; is it tshark of Wireshark 4.0 or later?")
    said = _ask(program, "--version")
    version = re.search(r"(\d+\.\d+\.\d+)", said)
    return WiresharkFolders(
        program,
        version[1] if version else "",
        re.search(r"(?i)with\s+Lua", said) is not None,
        Path(plugins),
        Path(configuration) / "profiles",
    )


def _ask(program: str, *words: str) -> str:
    try:
        done = subprocess.run(  # noqa: S603 - our words, no shell
            [program, *words], capture_output=True, timeout=60, check=False, stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Problem(f"{program} does not run: {error}; install Wireshark again") from None
    return done.stdout.decode(errors="replace")
