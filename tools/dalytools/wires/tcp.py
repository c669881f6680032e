# SPDX-License-Identifier: GPL-2.0-or-later
"""TCP connections of serial servers: segments in order, what comes again dropped (docs/wires.md, 4).

    segments     1000 ..  1013 ..  1039 ..  1026 ..          by sequence number
    handed over  1000     1013              1026+1039        of the packet that closed the gap

A gap that stays open divides the stream: what is behind it is handed over as packets of its own, ``after_gap``.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from dalyref.packet import Packet
from dalytools.wires.network import ACK, RST, SYN, Network

if TYPE_CHECKING:
    from dalyref.packet import Direction
    from dalytools.wires.choice import Numbers
    from dalytools.wires.network import Segment

MOST_HELD: Final = 65536
"""Bytes of one direction that wait behind a gap."""
LONGEST_WAIT_NS: Final = 1_000_000_000
MOST_CONNECTIONS: Final = 1024
_MOST_SEGMENTS: Final = 1024  # that wait behind a gap
_SPACE: Final = 1 << 32


def _behind(number: int, reference: int) -> int:
    """Return how far a sequence number lies behind another, negative before it: they count round."""
    return (number - reference + _SPACE // 2) % _SPACE - _SPACE // 2


@dataclass(frozen=True, slots=True)
class _Waiting:
    """A segment behind a gap, and the packet it came in."""

    sequence: int
    data: bytes
    missing: int
    packet: Packet


@dataclass(slots=True)
class _Side:
    """One direction of a connection."""

    base: int | None = None
    """The first sequence number that was seen."""
    next: int = 0
    """The sequence number of the next byte."""
    lost: bool = False
    """Bytes before the next one are missing."""
    waiting: list[_Waiting] = field(default_factory=list[_Waiting])
    held: int = 0


@dataclass(slots=True)
class Connection:
    """One TCP connection."""

    name: str
    sides: tuple[_Side, _Side] = field(default_factory=lambda: (_Side(), _Side()))


class Tcp:
    """Takes the packets of a network, in order."""

    def __init__(self, ports: Numbers) -> None:
        self._network = Network(ports)
        self._connections: dict[tuple[tuple[str, int], tuple[str, int]], Connection] = {}
        self._gaps: dict[tuple[str, int], Connection] = {}  # open ones, by the connection's name and side
        self._names = 0
        self.late: set[str] = set()
        """Connections, by name, with segments out of order, or with old bytes and new ones."""
        self.again: set[str] = set()
        """Connections, by name, with segments that brought what had come before."""
        self.latest = ""
        """The connection of the latest segment."""
        self.lost = False
        """Bytes of some connection are missing."""

    @property
    def found(self) -> bool:
        """Tell whether a segment of these ports was seen."""
        return self._names > 0

    @property
    def waits(self) -> bool:
        """Tell whether a gap may still be closed."""
        return bool(self._gaps)

    def feed(self, packet: Packet) -> list[Packet]:
        """Take a packet; return what has come to be in order: of the gap that it closes, or given up, by its own."""
        out = self.pass_time(packet.time_ns)
        segment = self._network.segment(packet.link_type, packet.data)
        if segment is not None:
            connection, which = self._connection(segment, out)
            self.latest = connection.name
            self._take(connection, which, segment, packet, out)
        return out

    def pass_time(self, time_ns: int) -> list[Packet]:
        """Take the time of a packet of whatever kind; return what waited for too long."""
        return self.give_up(before_ns=time_ns - LONGEST_WAIT_NS) if self._gaps else []

    def give_up(self, *, before_ns: int | None = None) -> list[Packet]:
        """Close the gaps behind which segments wait since before a time, or all."""
        out: list[Packet] = []
        for (_, which), connection in list(self._gaps.items()):
            side = connection.sides[which]
            while side.waiting and (before_ns is None or min(one.packet.time_ns for one in side.waiting) < before_ns):
                self._skip(connection, which, out)
        return out

    def _connection(self, segment: Segment, out: list[Packet]) -> tuple[Connection, int]:
        """Return the connection of a segment, and the side that sent it."""
        ends = sorted((segment.source, segment.destination))
        key = (ends[0], ends[1])
        which = ends.index(segment.source)
        connection = self._connections.get(key)
        if connection is not None and segment.flags & (SYN | ACK) == SYN:
            known = connection.sides[which].base
            if known not in {None, segment.sequence}:
                self._end(self._connections.pop(key), out)
                connection = None
        if connection is None:
            if len(self._connections) >= MOST_CONNECTIONS:
                self._end(self._connections.pop(next(iter(self._connections))), out)
            self._names += 1
            connection = self._connections[key] = Connection(f"tcp {self._names}")
        return connection, which

    def _end(self, connection: Connection, out: list[Packet]) -> None:
        for which in (0, 1):
            while connection.sides[which].waiting:
                self._skip(connection, which, out)

    def _take(self, connection: Connection, which: int, segment: Segment, packet: Packet, out: list[Packet]) -> None:
        side, sequence = connection.sides[which], segment.sequence
        begins = bool(segment.flags & SYN)
        if begins:
            sequence = (sequence + 1) % _SPACE
        if side.base is None:
            side.base, side.next = segment.sequence, sequence
        length = len(segment.data) + segment.missing
        if segment.flags & RST or length <= -_behind(sequence, side.next):
            if segment.data:
                self.again.add(connection.name)
            return  # nothing in it, or nothing new
        if _behind(sequence, side.next) < 0:
            self.late.add(connection.name)
        self._wait(connection, side, _Waiting(sequence, segment.data, segment.missing, packet))
        if _behind(side.waiting[0].sequence, side.next) <= 0:
            self._drain(connection, which, packet, out)
        while side.held > MOST_HELD or len(side.waiting) > _MOST_SEGMENTS:
            self._skip(connection, which, out)
        if side.waiting:
            self._gaps[connection.name, which] = connection
        else:
            self._gaps.pop((connection.name, which), None)

    def _wait(self, connection: Connection, side: _Side, one: _Waiting) -> None:
        """Put a segment in its place by sequence numbers."""
        at = len(side.waiting)
        while at and _behind(side.waiting[at - 1].sequence, one.sequence) > 0:
            at -= 1
        if at and side.waiting[at - 1].sequence == one.sequence and len(side.waiting[at - 1].data) >= len(one.data):
            self.again.add(connection.name)
            return  # it has come before
        if at < len(side.waiting):
            self.late.add(connection.name)
        side.waiting.insert(at, one)
        side.held += len(one.data)

    def _skip(self, connection: Connection, which: int, out: list[Packet]) -> None:
        """Give a gap up: what follows it, up to the next one, is handed over by packets of its own."""
        side = connection.sides[which]
        side.next = side.waiting[0].sequence
        self._miss(side)
        self._drain(connection, which, None, out)
        if not side.waiting:
            self._gaps.pop((connection.name, which), None)

    def _miss(self, side: _Side) -> None:
        side.lost = self.lost = True

    def _drain(self, connection: Connection, which: int, packet: Packet | None, out: list[Packet]) -> None:
        """Hand over what is in order. packet: that all of it counts to; None: the latest that it came in."""
        side = connection.sides[which]
        run = b""
        direction: Direction = "inbound" if which else "outbound"

        def hand(by: Packet) -> None:
            if run:
                out.append(
                    Packet(
                        number=by.number,
                        time_ns=by.time_ns,
                        data=run,
                        interface=by.interface,
                        direction=direction,
                        comment=by.comment,
                        link_type=by.link_type,
                        transport="tcp",
                        connection=connection.name,
                        after_gap=side.lost,
                    )
                )
                side.lost = False

        latest = packet
        while side.waiting and (old := -_behind(side.waiting[0].sequence, side.next)) >= 0:
            one = side.waiting.pop(0)
            side.held -= len(one.data)
            new = len(one.data) + one.missing - old
            if new <= 0:
                continue
            if packet is None:
                if run and latest is not None:
                    hand(latest)
                    run = b""
                latest = one.packet if latest is None or latest.number < one.packet.number else latest
            side.next = (side.next + new) % _SPACE
            run += one.data[old:]
            if one.missing and latest is not None:
                hand(latest)
                run = b""
                self._miss(side)
        if latest is not None:
            hand(latest)
