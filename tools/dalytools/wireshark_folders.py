# SPDX-License-Identifier: GPL-2.0-or-later
"""Where this user's Wireshark looks for Lua plugins, profiles and capture tools: asked of ``tshark -G folders``."""

from __future__ import annotations

import os
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
    extcap: Path
    """Personal capture tools (extcap)."""


def wireshark_folders() -> WiresharkFolders:
    """Ask the tshark of this machine. Raises Problem where there is none, or where it does not answer."""
    program = find_tshark()
    told = _ask(program, "-G", "folders")
    places = dict(re.findall(r"(?m)^([^:\n]+):\s+(\S.*)$", told))
    plugins = places.get("Personal Lua Plugins") or places.get("Personal Plugins")
    configuration = places.get("Personal configuration")
    told_extcap = places.get("Personal Extcap path")
    if not plugins or not configuration:
        raise Problem(f"{program} does not tell its folders; is it tshark of Wireshark 4.0 or later?")
    said = _ask(program, "--version")
    version = re.search(r"(\d+\.\d+\.\d+)", said)
    number = version[1] if version else ""
    return WiresharkFolders(
        program,
        number,
        re.search(r"(?i)(with\s+|\+)Lua", said) is not None,
        Path(plugins),
        Path(configuration) / "profiles",
        Path(told_extcap) if told_extcap else extcap_folder(number, Path(configuration), Path(plugins)),
    )


def extcap_folder(version: str, configuration: Path, plugins: Path) -> Path:
    """Say where a Wireshark that does not tell it looks for personal capture tools.

    4.0: beside the configuration. 4.2 moved it beside the plugins, but on Windows; that, 4.4 and 4.6 do tell it.
    """
    numbers = [int(part) for part in version.split(".")[:2]]
    if os.name == "nt" or numbers < [4, 2]:
        return configuration / "extcap"
    return plugins.parent / "extcap"


def _ask(program: str, *words: str) -> str:
    try:
        done = subprocess.run(  # noqa: S603 - our words, no shell
            [program, *words], capture_output=True, timeout=60, check=False, stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise Problem(f"{program} does not run: {error}; install Wireshark again") from None
    return done.stdout.decode(errors="replace")
