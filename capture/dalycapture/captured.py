# SPDX-License-Identifier: GPL-2.0-or-later
"""What a capture file says beyond what the decoder needs: flags, losses, the whole interface, statistics."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from dalyref.packet import Packet

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalycapture.interface import Interface


MOST_NS: Final = 0x7FFFFFFF_FFFFFFFF  # the year 2262; tables and plots hold signed numbers


@dataclass(frozen=True, slots=True)
class CapturedPacket(Packet):
    """A packet with all that the file has of it."""

    flags: int = 0
    """``epb_flags`` (dalycapture.pcapng)."""
    dropped: int = 0
    """``epb_dropcount``: packets lost before this one."""


@dataclass(frozen=True, slots=True)
class Statistics:
    """An Interface Statistics Block: times in nanoseconds since 1970, counts of packets; None: not in there."""

    interface: int
    start_ns: int | None = None
    end_ns: int | None = None
    received: int | None = None
    dropped: int | None = None
    os_dropped: int | None = None


def possible(time_ns: int) -> int:
    """Return ns since 1970; 0, which is no time, for what a capture can not mean: before 1970, after 2262."""
    return time_ns if 0 <= time_ns <= MOST_NS else 0


def _ignore(_: object) -> None: ...


@dataclass(slots=True)
class Told:
    """Who is told what stands between the packets, when it is read."""

    interface: Callable[[Interface], None] = field(default=_ignore)
    """Each interface described, in the order of their numbers over the file."""
    statistics: Callable[[Statistics], None] = field(default=_ignore)
