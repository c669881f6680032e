# SPDX-License-Identifier: GPL-2.0-or-later
"""What carries the bytes of a simulated bus into a capture: one kind of wire a module, all with the same two calls."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dalycapture.interface import Interface
    from dalytools.simulator.sent import Sent


class WirePacket(NamedTuple):
    """One packet of the capture. time_ns: of the bus; flags: pcapng's ``epb_flags``."""

    time_ns: int
    data: bytes
    flags: int = 0


class Wire(Protocol):
    """Makes packets of what was heard, piece by piece in order of time."""

    interface: Interface

    def feed(self, piece: Sent) -> Iterable[WirePacket]:
        """Take one piece; the packets that are complete now."""
        ...

    def finish(self, end_ns: int) -> Iterable[WirePacket]:
        """Hand out the rest: the capture ends."""
        ...
