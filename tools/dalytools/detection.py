# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark capture --detect PORT``: speed and format of a bus, by listening; not a byte is sent."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from dalycapture import detect
from dalycapture.opening import open_port
from dalytools.problem import Problem
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from dalycapture.detect import Trial
    from dalycapture.settings import Settings


def detect_settings(name: str, settings: Settings) -> int:
    """Try all speeds, print what was found; exit status 0 found, 1 not. Raises PortError, Problem."""
    if "://" in name:
        raise Problem(f"{name}: the server sets the speed; --detect needs a serial device of this machine")
    port = open_port(name, replace(settings, baud=detect.SPEEDS[0], line_format="8N1"))
    done: list[Trial] = []
    try:
        for trial in detect.trials(port, settings, listen=detect.listen):
            print(f"  {plain(str(trial))}", file=sys.stderr)  # noqa: T201 - progress
            done.append(trial)
    finally:
        port.close()
    verdict = detect.judge(done)
    print(plain(verdict.text))  # noqa: T201
    if verdict.settings is None:
        return 1
    words = [f"--baud {verdict.settings.baud}"] if verdict.settings.baud != detect.SPEEDS[0] else []
    if verdict.settings.line_format != "8N1":
        words.append(f"--format {verdict.settings.line_format}")
    print(" ".join([f"Next: dalyshark capture {plain(name)}", *words, "-w FILE"]))  # noqa: T201
    return 0
