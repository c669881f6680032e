# SPDX-License-Identifier: GPL-2.0-or-later
"""The bytes of TCP connections in order, each with its place in its packet (docs/wires.md, 4).

    segment 1   |----- 100 .. 120 -----|                            the line: 100 .. 120
    segment 2                          .   lost or late
    segment 3                               |- 140 .. 150 -|        waits
    segment 2                          |----- 120 .. 140 -----|     the line: 120 .. 150
    segment 1   |----- 100 .. 120 -----|                            sent again: blanked, for nobody reads it

Every connection is read as a line: what is no frame in it is blanked, whatever it is.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple

from dalyref.packet import Packet
from dalytools.redact.what import What

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalyref.packet import Direction
    from dalytools.redact.blanker import Blanker
    from dalytools.redact.lines import Held, Line

FIN, SYN, RST, ACK = 0x01, 0x02, 0x04, 0x10
_SPACE: Final = 1 << 32
_MOST_HELD: Final = 1 << 16
"""Bytes of a direction that wait for a gap to be filled."""
_MOST_WAITING: Final = 1024
_LONGEST_WAIT: Final = 4096
"""Packets, or a little more, that may come before the gap is filled."""
_LOOK_EVERY: Final = 512
_MOST_CONNECTIONS: Final = 1024

End = tuple[bytes, int]
"""Address and port."""


class Segment(NamedTuple):
    """A TCP segment, and where its bytes stand in its packet."""

    held: Held
    source: End
    destination: End
    sequence: int
    flags: int
    start: int
    size: int
    missing: int
    """Bytes behind these that the snap length cut off."""


@dataclass(slots=True)
class _Side:
    base: int | None = None
    """The first sequence number seen."""
    next: int = 0
    lost: bool = False
    waiting: list[Segment] = field(default_factory=list[Segment])
    held: int = 0


@dataclass(slots=True)
class _Connection:
    name: str
    first: End
    """Who was heard first: its bytes are outbound."""
    sides: dict[End, _Side] = field(default_factory=dict[End, _Side])


class Segments:
    """Takes the segments of a capture. line: gives the line of a connection's name and direction."""

    def __init__(self, blanker: Blanker, line: Callable[[str, Direction], Line]) -> None:
        self._blanker = blanker
        self._line = line
        self._connections: dict[tuple[End, End], _Connection] = {}
        self._waiting: dict[tuple[str, End], _Connection] = {}
        self._names = 0
        self._latest: Packet | None = None

    def feed(self, segment: Segment) -> list[Packet]:
        """Return what has come in order. All of it counts to this packet: the decoder wants numbers in order."""
        out: list[Packet] = []
        self._latest = segment.held.packet
        connection = self._connection(segment, out)
        self._take(connection, segment, out)
        return out

    def pass_packet(self, packet: Packet) -> list[Packet]:
        """Give up what has waited for too many packets, up to this one."""
        out: list[Packet] = []
        self._latest = packet
        if packet.number % _LOOK_EVERY:
            return out
        for (_, end), connection in list(self._waiting.items()):
            side = connection.sides[end]
            while side.waiting and min(one.held.packet.number for one in side.waiting) < packet.number - _LONGEST_WAIT:
                self._skip(connection, end, out)
        return out

    def finish(self) -> list[Packet]:
        """Take the end of the capture: return what was held back."""
        out: list[Packet] = []
        for connection in self._connections.values():
            self._end(connection, out)
        return out

    def _connection(self, segment: Segment, out: list[Packet]) -> _Connection:
        key = min(segment.source, segment.destination), max(segment.source, segment.destination)
        connection = self._connections.get(key)
        if connection is not None and segment.flags & (SYN | ACK) == SYN:
            side = connection.sides.get(segment.source)
            if side is not None and side.base not in (None, segment.sequence):
                self._end(self._connections.pop(key), out)
                connection = None
        if connection is None:
            if len(self._connections) >= _MOST_CONNECTIONS:
                self._end(self._connections.pop(next(iter(self._connections))), out)
            self._names += 1
            connection = self._connections[key] = _Connection(f"tcp {self._names}", segment.source)
        return connection

    def _end(self, connection: _Connection, out: list[Packet]) -> None:
        for end, side in connection.sides.items():
            while side.waiting:
                self._skip(connection, end, out)

    def _take(self, connection: _Connection, segment: Segment, out: list[Packet]) -> None:
        side = connection.sides.setdefault(segment.source, _Side())
        sequence = (segment.sequence + bool(segment.flags & SYN)) % _SPACE
        segment = segment._replace(sequence=sequence)
        if side.base is None:
            side.base, side.next = segment.sequence - bool(segment.flags & SYN), sequence
        if not segment.size and not segment.missing:
            return
        if segment.flags & RST:
            self._blank(segment)
            return
        if _ahead(sequence, side.next) <= 0:
            self._hand(connection, side, segment, out)
            self._drain(connection, side, out)
        else:
            at = len(side.waiting)
            while at and _ahead(side.waiting[at - 1].sequence, sequence) > 0:
                at -= 1
            side.waiting.insert(at, segment)
            side.held += segment.size
            segment.held.undecided += segment.size
        while side.held > _MOST_HELD or len(side.waiting) > _MOST_WAITING:
            self._skip(connection, segment.source, out)
        if side.waiting:
            self._waiting[connection.name, segment.source] = connection
        else:
            self._waiting.pop((connection.name, segment.source), None)

    def _skip(self, connection: _Connection, end: End, out: list[Packet]) -> None:
        """Give a gap up."""
        side = connection.sides[end]
        side.next = side.waiting[0].sequence
        side.lost = True
        self._drain(connection, side, out)
        if not side.waiting:
            self._waiting.pop((connection.name, end), None)

    def _drain(self, connection: _Connection, side: _Side, out: list[Packet]) -> None:
        """Hand over what waited, as far as it is in order now."""
        while side.waiting and _ahead(side.waiting[0].sequence, side.next) <= 0:
            segment = side.waiting.pop(0)
            side.held -= segment.size
            segment.held.undecided -= segment.size
            self._hand(connection, side, segment, out)

    def _hand(self, connection: _Connection, side: _Side, segment: Segment, out: list[Packet]) -> None:
        """Hand over what is new in a segment that begins where the line ends, or before."""
        again = min(_ahead(side.next, segment.sequence), segment.size)
        self._blank(segment._replace(size=again))
        start, size = segment.start + again, segment.size - again
        end = (segment.sequence + segment.size + segment.missing) % _SPACE
        direction: Direction = "outbound" if segment.source == connection.first else "inbound"
        if size:
            self._line(connection.name, direction).add(segment.held, start, size)
            packet = self._latest or segment.held.packet
            out.append(
                Packet(
                    number=packet.number,
                    time_ns=packet.time_ns,
                    data=segment.held.packet.data[start : start + size],
                    interface=packet.interface,
                    direction=direction,
                    link_type=packet.link_type,
                    transport="tcp",
                    connection=connection.name,
                    after_gap=side.lost,
                )
            )
            side.lost = False
        if _ahead(end, side.next) > 0:
            side.lost = side.lost or segment.missing > 0
            side.next = end

    def _blank(self, segment: Segment) -> None:
        """Blank bytes that nobody reads."""
        start, stop = segment.start, segment.start + segment.size
        if segment.size:
            old = segment.held.packet.data[start:stop]
            segment.held.data[start:stop] = self._blanker.whole(old, What.TRAFFIC, "TCP, sent again")


def _ahead(number: int, other: int) -> int:
    """Return how far a sequence number is ahead of another, which may be around the end of the numbers."""
    return (number - other + _SPACE // 2) % _SPACE - _SPACE // 2
