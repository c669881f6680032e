# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark capture`` on a full bus: 74 frames/s, all that 9600 baud carries, on a pseudo-terminal.

    feeder (bench.feeder) --> pseudo-terminal --> dalyshark capture -w FILE

The bytes come one at a time, as from a UART, then a frame at a time, as from an adapter with a buffer. CPU share and
memory are the kernel's account of the running sniffer, its start left out.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import time
import tty
from pathlib import Path
from typing import TYPE_CHECKING

from bench.child import cpu_s, resident_mib
from bench.table import Goal, Result
from dalycapture.reader import read_capture
from dalytools.problem import Problem

if TYPE_CHECKING:
    from bench.options import Options

SETTLED_AT = 0.25  # of the run: memory may not grow any more
MOST_CPU, MOST_MIB, MOST_GROWTH_MIB = 5.0, 40.0, 1.0
START_S = 20.0


def measure(options: Options) -> list[Result]:
    """Measure for ``options.seconds`` each way."""
    result = Result(
        f"Sniffer: a full bus of 9600 baud for {options.seconds:g} s",
        ("bytes come", "frames", "lost", "frames/s", "CPU, % of a core", "memory, MiB", "growth from 25 % on, MiB"),
        note="The feeder writes every byte once, so frames that are not in the file were lost by the sniffer.",
    )
    for size, label in ((1, "one at a time"), (13, "a frame at a time")):
        _one(result, label, size, options.seconds)
    return [result]


def _one(result: Result, label: str, size: int, seconds: float) -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory(prefix="dalyshark-bench-") as folder:
        path = Path(folder) / "sniffed.pcapng"
        program = str(Path(sys.executable).with_name("dalyshark"))
        sniffer = subprocess.Popen([program, "capture", os.ttyname(slave), "-q", "-w", str(path)])
        try:
            _wait_for(path, sniffer)
            time.sleep(1)  # to be past its start
            feeder = subprocess.Popen(
                [sys.executable, "-m", "bench.feeder", str(master), str(size), str(seconds)],
                pass_fds=(master,),
                stdout=subprocess.PIPE,
            )
            started, before = time.monotonic(), cpu_s(sniffer.pid)
            time.sleep(SETTLED_AT * seconds)
            early = resident_mib(sniffer.pid)
            fed = int(feeder.communicate()[0])
            took, used = time.monotonic() - started, cpu_s(sniffer.pid) - before
            late = resident_mib(sniffer.pid)
        finally:
            sniffer.send_signal(signal.SIGINT)
            status = sniffer.wait()
            os.close(master)
            os.close(slave)
        if status:
            raise Problem(f"the sniffer ended with status {status}")
        written = sum(1 for packet in read_capture(path) if len(packet.data) == 13)
    share = 100 * used / took
    result.rows.append(
        (label, str(fed), str(fed - written), f"{fed / took:.1f}", f"{share:.2f}", f"{late:.1f}", f"{late - early:.2f}")
    )
    result.goals += [
        Goal(f"CPU, {label}", share, MOST_CPU, " %"),
        Goal(f"memory, {label}", late, MOST_MIB, " MiB"),
        Goal(f"growth, {label}", late - early, MOST_GROWTH_MIB, " MiB"),
    ]


def _wait_for(path: Path, sniffer: subprocess.Popen[bytes]) -> None:
    """Wait until the sniffer has written its file's header: it listens."""
    until = time.monotonic() + START_S
    while not path.exists() or not path.stat().st_size:
        if sniffer.poll() is not None or time.monotonic() > until:
            raise Problem("the sniffer did not start")
        time.sleep(0.05)
