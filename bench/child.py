# SPDX-License-Identifier: GPL-2.0-or-later
"""What a program cost, from the kernel's account of it: not what the clock says, for others use the machine too."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import subprocess

MIB = 1 << 20
_MAXRSS_UNIT = 1 if sys.platform == "darwin" else 1024


@dataclass(frozen=True, slots=True)
class Cost:
    """User and system CPU time in seconds; the most memory it had resident, in MiB; its exit status.

    The kernel counts the memory of whoever started it as its own up to then: keep the starter small.
    """

    user_s: float
    system_s: float
    peak_mib: float
    status: int


def wait(child: subprocess.Popen[bytes]) -> Cost:
    """Wait for a program's end; its cost."""
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return Cost(used.ru_utime, used.ru_stime, used.ru_maxrss * _MAXRSS_UNIT / MIB, child.returncode)


def resident_mib(pid: int) -> float:
    """Return what a running program has resident now, in MiB (Linux)."""
    with open(f"/proc/{pid}/statm", encoding="ascii") as file:  # noqa: PTH123 - /proc is no place for paths
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / MIB


def cpu_s(pid: int) -> float:
    """Return the CPU time, user and system, that a running program has used, in s (Linux; 10 ms steps)."""
    with open(f"/proc/{pid}/stat", encoding="utf-8", errors="replace") as file:  # noqa: PTH123 - as above
        after_name = file.read().rpartition(")")[2].split()
    return (int(after_name[11]) + int(after_name[12])) / os.sysconf("SC_CLK_TCK")
