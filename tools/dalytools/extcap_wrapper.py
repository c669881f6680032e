# SPDX-License-Identifier: GPL-2.0-or-later
"""The small program that Wireshark starts as its capture tool: our Python, with our extcap.

Wireshark runs what is in its extcap folder and is executable, and knows nothing of Python. The Python is named whole,
for Wireshark has another PATH than a shell; so the wrapper is made anew when dalyshark moves: ``dalyshark install``.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from pathlib import Path

START: Final = "from dalycapture.extcap import entry; entry()"


def wrapper_name(system: str = os.name) -> str:
    """Return its file name; Windows starts only what its name says is a program."""
    return "dalyshark.bat" if system == "nt" else "dalyshark"


def wrapper(python: str = sys.executable, system: str = os.name) -> bytes:
    """Return its text."""
    if system == "nt":
        return f'@echo off\r\nrem dalyshark\'s capture tool for Wireshark\r\n"{python}" -c "{START}" %*\r\n'.encode()
    told = "# dalyshark's capture tool for Wireshark; made by: dalyshark install"
    return f'#!/bin/sh\n{told}\nexec {shlex.quote(python)} -c {shlex.quote(START)} "$@"\n'.encode()


def answers(path: Path) -> tuple[bool, str]:
    """Ask the wrapper as Wireshark would: (whether all is well, what to tell people)."""
    since = time.monotonic()
    try:
        done = subprocess.run(  # noqa: S603 - our own file, no shell
            [str(path), "--extcap-interfaces", "--extcap-version=4.4"],
            capture_output=True,
            timeout=20,
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return False, f"{path} does not run ({error}); to mend it: dalyshark install"
    if done.returncode or b"interface {value=daly}" not in done.stdout:
        last = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["it says nothing"]
        return False, f"{path} does not answer ({last[0]}); to mend it: dalyshark install"
    return True, f"answers in {(time.monotonic() - since) * 1000:.0f} ms"
