# SPDX-License-Identifier: GPL-2.0-or-later
"""A capture file from its first packet to what the decoder is to be fed, and what is wrong with the file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalycapture.errors import CaptureError
from dalycapture.linktype import link_type_name
from dalycapture.reader import read_capture
from dalytools.wires.carriers import NOT_READ

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dalyref.packet import Packet
    from dalytools.wires.carriers import Carriers

ADVANCE_EVERY = 1024
"""Packets between two steps of a progress bar."""


def carried(
    name: str,
    carriers: Carriers,
    problems: list[str],
    *,
    packet: Callable[[Packet], None] | None = None,
    advance: Callable[[int], None] | None = None,
) -> Iterator[Packet]:
    """Yield what a file's packets carry, in order.

    packet: is told each packet of the file before what it carries; advance: how many there were, now and then. What is
    wrong with the file, or with what was chosen for it, is appended to `problems`.
    """
    ours, others = False, set[int]()
    try:
        for count, one in enumerate(read_capture(name), 1):
            if packet is not None:
                packet(one)
            if carriers.reads(one.link_type):
                ours = True
            else:
                others.add(one.link_type)
            yield from carriers.of(one)
            if advance is not None and count % ADVANCE_EVERY == 0:
                advance(count)
    except CaptureError as error:
        problems.append(str(error))
    yield from carriers.finish()
    if others and not ours:
        names = ", ".join(link_type_name(number) for number in sorted(others)[:5])
        problems.append(f"{name}: its link type is {names}; {NOT_READ}")
    if carriers.nothing:
        problems.append(f"{name}: {carriers.nothing}")
