# SPDX-License-Identifier: GPL-2.0-or-later
"""The traffic that is measured with: a host polls a board of 16 cells, values move, a packet a frame as sniffed."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from dalycapture.create import open_writer
from dalycapture.interface import tap
from dalytools.simulator.bus import traffic
from dalytools.simulator.scenario import Scenario

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dalytools.simulator.sent import Sent

EPOCH_NS = 1_700_000_000_000_000_000


def frames(count: int) -> Iterator[Sent]:
    """Yield so many frames of 13 bytes, in order. 25 are a cycle: ten requests and their replies, six of them cells."""
    return itertools.islice(traffic(Scenario(), EPOCH_NS), count)


def write(path: Path, count: int) -> None:
    """Write so many frames to a pcapng file, as the sniffer does."""
    with open_writer(path) as writer:
        writer.add_interface(tap("made"))
        for sent in frames(count):
            writer.write_packet(sent.time_ns, sent.data)
