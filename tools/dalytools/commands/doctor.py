# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark doctor``: what is there, what is missing, and how to get it. Opens no port, changes nothing.

Exit status: 0 all is there, 1 something is missing.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dalycapture.adapters import serial_ports
from dalytools import __version__
from dalytools.extcap_wrapper import answers
from dalytools.installation import Installation, Step
from dalytools.problem import Problem
from dalytools.terminal_text import plain
from dalytools.tshark import Tshark
from dalytools.wireshark_folders import WiresharkFolders, wireshark_folders

if TYPE_CHECKING:
    import argparse


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at."""

    ok: bool
    what: str
    said: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = "Tell what is there, what is missing, and how to get it. Opens no port and changes nothing."
    parser.add_argument("--json", action="store_true", help="the findings as JSON")


def run(args: argparse.Namespace) -> int:
    """Look at everything; print a line each."""
    findings = [Finding(ok=True, what="dalyshark", said=f"{__version__}, Python {platform.python_version()}")]
    try:
        folders = wireshark_folders()
    except Problem as problem:
        findings.append(Finding(ok=False, what="Wireshark", said=str(problem)))
    else:
        findings += _wireshark(folders)
    findings.append(_ports())
    if args.json:
        print(json.dumps([asdict(each) for each in findings], indent=1))  # noqa: T201
    else:
        for each in findings:
            print(f"{'ok' if each.ok else '!!'}  {each.what:<18} {plain(each.said)}")  # noqa: T201
    return 0 if all(each.ok for each in findings) else 1


def _wireshark(folders: WiresharkFolders) -> list[Finding]:
    lua = "with Lua" if folders.lua else "built without Lua: it can load no dissector, take another build"
    found = [Finding(folders.lua, "Wireshark", f"{folders.version} ({folders.program}), {lua}")]
    try:
        with Tshark():
            found.append(
                Finding(ok=True, what="dissector", said="loads in this tshark, as dalyshark's commands start it")
            )
    except Problem as problem:
        found.append(Finding(ok=False, what="dissector", said=str(problem)))
    installation = Installation(folders, dry_run=True)
    plugin, tool, *profile = installation.state()
    found.append(Finding(plugin.step is Step.SAME, "plugin", _state([plugin.step], str(folders.plugins))))
    steps = [each.step for each in profile]
    found.append(Finding(set(steps) == {Step.SAME}, "profile", _state(steps, str(folders.profiles))))
    found += _capture_tool(folders, installation, tool.step)
    others = installation.others()
    if others:
        said = f"also there: {', '.join(map(str, others))}; remove it, only one is loaded"
        found.append(Finding(ok=False, what="plugin, double", said=said))
    if hasattr(os, "geteuid") and os.geteuid() == 0 and not folders.version.startswith("4.0."):
        said = "you are root: Wireshark 4.2 and later load no plugins for root, start it as an ordinary user"
        found.append(Finding(ok=False, what="user", said=said))
    return found


def _capture_tool(folders: WiresharkFolders, installation: Installation, step: Step) -> list[Finding]:
    """Look at what captures inside Wireshark: our tool, and Wireshark's own dumpcap, which reads from it."""
    said = _state([step], str(folders.extcap))
    well = step is Step.SAME
    if well:
        well, more = answers(installation.tool)
        said = f"{said}, {more}" if well else more
    found = [Finding(well, "capture tool", said)]
    dumpcap = shutil.which("dumpcap") or shutil.which("dumpcap", path=str(Path(folders.program).parent))
    if dumpcap is None:
        there = shutil.which("dumpcap", mode=os.F_OK)
        said = "you may not run dumpcap, and Wireshark captures nothing without it: sudo usermod -aG wireshark $USER, "
        said += "then log in again"
        missing = "dumpcap, which Wireshark captures with, is not installed; on Debian and Ubuntu it is in tshark"
        found.append(Finding(ok=False, what="dumpcap", said=said if there else missing))
    return found


def _state(steps: list[Step], folder: str) -> str:
    if all(step is Step.SAME for step in steps):
        return f"installed in {folder}"
    if all(step is Step.WRITE for step in steps):
        return "not installed in Wireshark; to do so: dalyshark install"
    if Step.LEAVE in steps or Step.KEEP in steps:
        return f"changed by you in {folder}; to have ours: dalyshark install --force"
    return "another version than this; to have this one: dalyshark install"


def _ports() -> Finding:
    ports = serial_ports()
    if not ports:
        return Finding(ok=True, what="serial ports", said="none here (needed to capture, not to read files)")
    closed = [port for port in ports if not os.access(port, os.R_OK)]
    if closed:
        said = f"no permission for {', '.join(closed)}: sudo usermod -aG dialout $USER, then log in again"
        return Finding(ok=False, what="serial ports", said=said)
    return Finding(ok=True, what="serial ports", said=", ".join(ports))
