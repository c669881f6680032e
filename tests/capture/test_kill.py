# SPDX-License-Identifier: GPL-2.0-or-later
"""A kill at any moment leaves a file of which every whole block reads, and all that was framed is in it."""

from __future__ import annotations

import contextlib
import random
import subprocess
import sys
import time
from typing import TYPE_CHECKING

from bench.crash import kills
from tests.capture.bus import Bus, numbered

from dalycapture.errors import TruncatedError
from dalycapture.reader import read_capture

if TYPE_CHECKING:
    from pathlib import Path

# Prints how many records were written, after each was: what is printed must be in the file.
SNIFF = """
import sys
from dalycapture.create import open_writer
from dalycapture.interface import tap
from dalycapture.opening import open_port
from dalycapture.sniffer import Side, Sniffer
port = open_port(sys.argv[1])
side = Side(port, tap("x"))
sniffer = Sniffer([side], [open_writer(sys.argv[2])], listener=lambda one: print(one.record.start, flush=True))
print("open", flush=True)
sniffer.run()
"""


def test_killed_at_random_moments(tmp_path: Path) -> None:
    chance = random.Random(9600)
    for life in range(8):
        path = tmp_path / f"{life}.pcapng"
        with Bus() as bus:
            sniffer = subprocess.Popen([sys.executable, "-c", SNIFF, bus.port, str(path)], stdout=subprocess.PIPE)
            assert sniffer.stdout
            assert sniffer.stdout.readline() == b"open\n"
            end = time.monotonic() + chance.uniform(0.01, 0.3)
            sent = 0
            while time.monotonic() < end:
                for _ in range(20):
                    bus.send(numbered(sent))
                    sent += 1
                time.sleep(0.001)
            sniffer.kill()
            sniffer.wait(20)
            reported = len(sniffer.stdout.read().splitlines())
            sniffer.stdout.close()
        got: list[bytes] = []
        with contextlib.suppress(TruncatedError):  # at most the block that was under way
            got.extend(packet.data for packet in read_capture(path))
        assert got == [numbered(n) for n in range(len(got))]
        assert reported <= len(got) <= sent


def test_killed_torn_and_appended_to(tmp_path: Path) -> None:
    """The short form of `make crash`: each life goes on in the same file, every fourth end is torn by hand."""
    assert kills(5, tmp_path)
