# SPDX-License-Identifier: GPL-2.0-or-later
"""Any capture file to columns of packets: pcapng at speed, others packet by packet."""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, Final

from dalycapture.captured import Told
from dalycapture.errors import CaptureError
from dalycapture.reader import is_pcapng, opened, packets
from dalytools.bulk.blocks import CHUNK, BlockReader
from dalytools.bulk.packets import from_objects

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dalyref.packet import Packet
    from dalytools.bulk.packets import Interfaces, Packets

_LOT: Final = 16384


def read_columns(path: Path | str, interfaces: Interfaces, *, chunk: int = CHUNK) -> Iterator[Packets]:
    """Yield the packets of a capture file, some at a time.

    interfaces: takes those that the file describes. chunk: bytes read at a time, of pcapng. Raises CaptureError as
    ``dalycapture.reader.read_capture`` does, after all packets before the damage.
    """
    with opened(path) as source:
        if is_pcapng(source):
            yield from BlockReader(source, interfaces, Told(), chunk=chunk).packets()
        else:
            yield from _lots(packets(source), interfaces)


def _lots(objects: Iterator[Packet], interfaces: Interfaces) -> Iterator[Packets]:
    problem: CaptureError | None = None

    def up_to_the_problem() -> Iterator[Packet]:
        nonlocal problem
        try:
            yield from objects
        except CaptureError as error:
            problem = error

    left = up_to_the_problem()
    while lot := list(islice(left, _LOT)):
        yield from_objects(lot, interfaces)
    if problem:
        raise problem
