# SPDX-License-Identifier: GPL-2.0-or-later
"""An adapter that is pulled out and put in again, while a bus of 20 frames/s goes on: what of it is in the file.

    name (a link, as udev makes them) --> pseudo-terminal 1, closed --> nothing --> pseudo-terminal 2 ...

first record   from the moment the link is there again to the start of the first frame in the file
gap            what the file's event "port back after" says, beside the time that the link was away
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import tty
from pathlib import Path
from typing import TYPE_CHECKING, Final

from bench.table import Goal, Result
from dalycapture.reader import read_capture
from dalyref.a5 import SIZE, build
from dalytools.problem import Problem

if TYPE_CHECKING:
    from bench.options import Options

TIMES: Final = 20
START_S: Final = 20.0
FRAME_EVERY_S: Final = 0.05
BACK: Final = re.compile(r"port back after ([0-9.]+) s")


class _Socket:
    """A name under which one pseudo-terminal after the other is plugged in."""

    def __init__(self, name: Path) -> None:
        self.name = name
        self._number = 0
        self.plug()

    def plug(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.name.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        self.name.unlink()
        os.close(self._slave)
        os.close(self._master)

    def send_for(self, seconds: float) -> None:
        """Put a numbered frame on the bus every now and then, whether somebody listens or not."""
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self._number += 1
            os.write(self._master, build(1, 0x90, self._number.to_bytes(8, "big")))
            time.sleep(FRAME_EVERY_S)


def measure(_options: Options) -> list[Result]:
    """Pull it out twenty times, for half a second to two."""
    result = Result(f"Adapter pulled out and put in again, {TIMES} times", ("what", "median, ms", "worst, ms"))
    lost_s: list[float] = []
    back_ns: list[int] = []
    with tempfile.TemporaryDirectory(prefix="dalyshark-bench-") as folder:
        path = Path(folder) / "sniffed.pcapng"
        socket = _Socket(Path(folder) / "usb-adapter")
        program = str(Path(sys.executable).with_name("dalyshark"))
        sniffer = subprocess.Popen([program, "capture", str(socket.name), "-q", "-w", str(path)])
        try:
            until = time.monotonic() + START_S
            while not path.exists() or not path.stat().st_size:
                if sniffer.poll() is not None or time.monotonic() > until:
                    raise Problem("the sniffer did not start")
                time.sleep(0.05)
            socket.send_for(1.0)
            for turn in range(TIMES):
                gone = time.monotonic()
                socket.unplug()
                time.sleep(0.5 + 1.5 * turn / TIMES)
                socket.plug()
                lost_s.append(time.monotonic() - gone)
                back_ns.append(time.time_ns())
                socket.send_for(1.0)
        finally:
            sniffer.send_signal(signal.SIGINT)
            if sniffer.wait(30):
                raise Problem(f"the sniffer ended with status {sniffer.returncode}")
            socket.unplug()
        packets = list(read_capture(path))
    first_ms = [
        min(packet.time_ns - moment for packet in packets if len(packet.data) == SIZE and packet.time_ns >= moment)
        / 1e6
        for moment in back_ns
    ]
    told = [float(found[1]) for packet in packets if (found := BACK.match(packet.comment))]
    if len(told) != TIMES:
        raise Problem(f"{len(told)} of {TIMES} returns are in the file")
    off_ms = [abs(said - true) * 1e3 for said, true in zip(told, lost_s, strict=True)]
    for what, values in (("first record after it is back", first_ms), ("length of the gap, off by", off_ms)):
        result.rows.append((what, f"{sorted(values)[len(values) // 2]:.1f}", f"{max(values):.1f}"))
    result.goals += [Goal("first record", max(first_ms), 250, " ms"), Goal("gap", max(off_ms), 50, " ms")]
    return [result]
