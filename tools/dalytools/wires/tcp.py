# SPDX-License-Identifier: GPL-2.0-or-later
"""TCP connections of serial servers: segments in order, what comes again dropped (docs/wires.md, 4).

    segments     1000 ..  1013 ..  1039 ..  1026 ..          by sequence number
    handed over  1000     1013              1026+1039        of the packet that closed the gap

A gap that stays open divides the stream: what is behind it is handed over as packets of its own, ``after_gap``; so is
what comes later of the gap itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from dalyref.packet import Packet
from dalytools.wires.network import RST, SYN, Network

if TYPE_CHECKING:
    from dalyref.packet import Direction
    from dalytools.wires.choice import Numbers
    from dalytools.wires.network import Segment

MOST_HELD: Final = 65536
"""Bytes of one direction that wait behind a gap; and how far back a segment may reach."""
RECEIVED_WAIT_NS: Final = 1_000_000_000
"""How long bytes that were acknowledged, and so arrived, may still come in this capture."""
LONGEST_WAIT_NS: Final = 60_000_000_000
"""How long others may: a sender waits a second at least before it sends again, and longer each time (RFC 6298)."""
MOST_CONNECTIONS: Final = 1024
_MOST_SEGMENTS: Final = 1024  # that wait behind a gap
_MOST_SKIPPED: Final = 64  # gaps that were given up, remembered for what comes of them later
_SPACE: Final = 1 << 32
_NEVER: Final = 1 << 63


@dataclass(slots=True)
class _Piece:
    """Bytes of a segment, and the packet it came in. Places are sequence numbers that do not begin anew."""

    start: int
    data: bytes
    end: int
    """Behind the data, or behind what the capture cut off of it."""
    packet: Packet
    received_ns: int | None = None
    """When it was known that the other side has all before it."""

    def part(self, start: int, end: int) -> _Piece:
        return _Piece(start, self.data[start - self.start : end - self.start], end, self.packet)


@dataclass(slots=True)
class _Side:
    """One direction of a connection."""

    first: int | None = None
    """The place of the first byte, as far as is known."""
    opened: int | None = None
    """The sequence number of its SYN."""
    next: int = 0
    """The place of the next byte to hand over."""
    acknowledged: int | None = None
    """Sequence number before which the other side has everything."""
    lost: bool = False
    """Bytes before the next one are missing."""
    waiting: list[_Piece] = field(default_factory=list[_Piece])
    """In order; none has a byte of another."""
    held: int = 0
    waits_from_ns: int = 0
    """When the first of those that wait came."""
    skipped: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    """Places of bytes that were given up: from, to."""

    def place(self, number: int) -> int:
        """Return the place of a sequence number: that next to what is expected."""
        return self.next + (number - self.next + _SPACE // 2) % _SPACE - _SPACE // 2

    @property
    def deadline_ns(self) -> int:
        """When what waits is handed over without what is missing before it."""
        longest, received_ns = self.waits_from_ns + LONGEST_WAIT_NS, self.waiting[0].received_ns
        return longest if received_ns is None else min(longest, received_ns + RECEIVED_WAIT_NS)


@dataclass(slots=True)
class Connection:
    """One TCP connection."""

    name: str
    sides: tuple[_Side, _Side] = field(default_factory=lambda: (_Side(), _Side()))


class Tcp:
    """Takes the packets of a network, in order."""

    def __init__(self, ports: Numbers) -> None:
        self._network = Network(ports)
        self._connections: dict[tuple[tuple[str, int], tuple[str, int]], Connection] = {}  # latest used last
        self._gaps: dict[tuple[str, int], Connection] = {}  # open ones, by the connection's name and side
        self._due_ns = _NEVER  # when the first of them may have to be given up
        self._names = 0
        self.late: set[str] = set()
        """Connections, by name, with segments out of order, or with old bytes and new ones."""
        self.again: set[str] = set()
        """Connections, by name, with segments that brought what had come before."""
        self.latest = ""
        """The connection of the latest segment."""
        self.cut = False
        """The snap length cut bytes off the latest segment."""
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
        segment = self._network.segment(packet.link_type, packet.data, packet.time_ns)
        if segment is not None:
            connection, which = self._connection(segment, out)
            self.latest, self.cut = connection.name, segment.missing > 0
            self._acknowledge(connection, 1 - which, segment, packet)
            self._take(connection, which, segment, packet, out)
        return out

    def pass_time(self, time_ns: int) -> list[Packet]:
        """Take the time of a packet of whatever kind; return what waited for too long."""
        return self.give_up(now_ns=time_ns) if time_ns > self._due_ns else []

    def give_up(self, *, now_ns: int | None = None) -> list[Packet]:
        """Close the gaps whose time is over, or all."""
        out: list[Packet] = []
        self._due_ns = _NEVER
        for (_, which), connection in list(self._gaps.items()):
            side = connection.sides[which]
            while side.waiting and (now_ns is None or side.deadline_ns < now_ns):
                self._skip(connection, which, out)
            self._note(connection, which)
        return out

    def _connection(self, segment: Segment, out: list[Packet]) -> tuple[Connection, int]:
        """Return the connection of a segment, and the side that sent it."""
        ends = sorted((segment.source, segment.destination))
        key = (ends[0], ends[1])
        which = ends.index(segment.source)
        connection = self._connections.pop(key, None)
        unannounced = False
        if connection is not None and segment.flags & SYN:
            if not _may_open(segment.sequence, connection.sides[which], connection.sides[1 - which]):
                self._end(connection, out)
                connection = None
        elif connection is not None and _far_back(segment, connection.sides[which]):
            unannounced = True
            self._end(connection, out)
            connection = None
        if connection is None:
            if len(self._connections) >= MOST_CONNECTIONS:
                self._end(self._connections.pop(next(iter(self._connections))), out)
            self._names += 1
            connection = Connection(f"tcp {self._names}")
        self._connections[key] = connection
        if unannounced:  # for Wireshark it goes on
            self.late.add(connection.name)
            self.lost = True
        return connection, which

    def _end(self, connection: Connection, out: list[Packet]) -> None:
        for which in (0, 1):
            while connection.sides[which].waiting:
                self._skip(connection, which, out)
            self._note(connection, which)

    def _acknowledge(self, connection: Connection, which: int, segment: Segment, packet: Packet) -> None:
        """Take what a segment says of the bytes of the other direction, `which`."""
        side, number = connection.sides[which], segment.acknowledged
        if number is None:
            return
        known = side.acknowledged
        if known is None or (number - known) % _SPACE < _SPACE // 2:
            side.acknowledged = number
            if side.waiting:
                self._received(side, packet)
                self._note(connection, which)

    def _received(self, side: _Side, packet: Packet) -> None:
        """Note of those that wait when it is known that the other side has what is missing before them."""
        if side.acknowledged is None:
            return
        known = side.place(side.acknowledged)
        for one in side.waiting:
            if one.start > known:
                return
            if one.received_ns is None:
                one.received_ns = packet.time_ns

    def _take(self, connection: Connection, which: int, segment: Segment, packet: Packet, out: list[Packet]) -> None:
        side = connection.sides[which]
        if side.first is None:
            side.next = segment.sequence + _SPACE
        start = side.place(segment.sequence)
        if segment.flags & SYN:
            side.opened = segment.sequence
            start += 1
        if side.first is None:
            side.first = side.next = start
            if side.opened is None:
                side.skipped.append((start - MOST_HELD, start))
        one = _Piece(start, segment.data, start + len(segment.data) + segment.missing, packet)
        if segment.flags & RST:
            return
        if one.start < side.next:
            one = self._old(connection, which, one, out)
        if _brings_something(one, side):
            self._wait(connection, side, one)
        if side.waiting and side.waiting[0].start == side.next:
            self._drain(connection, which, packet, out)
        while side.held > MOST_HELD or len(side.waiting) > _MOST_SEGMENTS:
            self._skip(connection, which, out)
        self._note(connection, which)

    def _note(self, connection: Connection, which: int) -> None:
        """Note whether a side has a gap, and until when."""
        side = connection.sides[which]
        if side.waiting:
            self._gaps[connection.name, which] = connection
            self._due_ns = min(self._due_ns, side.deadline_ns)
        else:
            self._gaps.pop((connection.name, which), None)

    def _old(self, connection: Connection, which: int, one: _Piece, out: list[Packet]) -> _Piece:
        """Take a segment that begins before the next byte: hand over what had been given up; return what is new."""
        side = connection.sides[which]
        if one.data == b"" and one.end == one.start:
            return one
        if one.end > side.next:
            self.late.add(connection.name)
        else:
            self.again.add(connection.name)
        keep_alive = len(one.data) == 1 and one.end == side.next
        known_to = min(one.start + len(one.data), side.next)
        if not keep_alive and any(start < known_to and end > one.start for start, end in side.skipped):
            self.late.add(connection.name)
            self._miss(side)
            remaining: list[tuple[int, int]] = []
            for start, end in side.skipped:
                begin, stop = max(start, one.start), min(end, known_to)
                if begin >= stop:
                    remaining.append((start, end))
                    continue
                out.append(self._handed(connection, which, one.part(begin, stop).data, one.packet, after_gap=True))
                remaining += [(a, b) for a, b in ((start, begin), (stop, end)) if a < b]
            side.skipped = remaining
        return one.part(side.next, one.end) if one.end > side.next else one

    def _wait(self, connection: Connection, side: _Side, one: _Piece) -> None:
        """Put a segment in its place; what waits there already stays."""
        waiting = side.waiting
        if not waiting:
            side.waits_from_ns = one.packet.time_ns
        if not waiting or one.start >= waiting[-1].end:
            waiting.append(one)
            side.held += len(one.data)
        elif one.start < one.end:
            pieces: list[_Piece] = []
            start = one.start
            for other in waiting:
                if start < (stop := min(one.end, other.start)):
                    pieces.append(one.part(start, stop))
                start = max(start, other.end)
            if start < one.end:
                pieces.append(one.part(start, one.end))
            if pieces:
                self.late.add(connection.name)
            else:
                self.again.add(connection.name)
            side.held += sum(len(piece.data) for piece in pieces)
            waiting += pieces
            waiting.sort(key=lambda piece: (piece.start, piece.end))
        self._received(side, one.packet)

    def _skip(self, connection: Connection, which: int, out: list[Packet]) -> None:
        """Give a gap up: what follows it, up to the next one, is handed over by packets of its own."""
        side = connection.sides[which]
        self._miss(side, side.waiting[0].start)
        self._drain(connection, which, None, out)

    def _miss(self, side: _Side, until: int | None = None) -> None:
        """Note that bytes are lost, up to a place."""
        side.lost = self.lost = True
        if until is not None:
            start = side.skipped.pop()[0] if side.skipped and side.skipped[-1][1] == side.next else side.next
            side.skipped.append((start, until))
            del side.skipped[:-_MOST_SKIPPED]
            side.next = until

    def _drain(self, connection: Connection, which: int, packet: Packet | None, out: list[Packet]) -> None:
        """Hand over what is in order. packet: that all of it counts to; None: the latest that it came in."""
        side = connection.sides[which]
        run: list[bytes] = []
        by = packet

        def hand() -> None:
            if by is not None and (data := b"".join(run)):
                out.append(self._handed(connection, which, data, by, after_gap=side.lost))
                side.lost = False
            run.clear()

        while side.waiting and side.waiting[0].start == side.next:
            one = side.waiting.pop(0)
            side.held -= len(one.data)
            if packet is None and (by is None or by.number < one.packet.number):
                hand()
                by = one.packet
            run.append(one.data)
            side.next += len(one.data)
            if one.end > side.next:
                hand()
                self._miss(side, one.end)
        hand()
        if side.waiting:
            side.waits_from_ns = min(one.packet.time_ns for one in side.waiting)

    def _handed(self, connection: Connection, which: int, data: bytes, by: Packet, *, after_gap: bool) -> Packet:
        direction: Direction = "inbound" if which else "outbound"
        return Packet(
            number=by.number,
            time_ns=by.time_ns,
            data=data,
            interface=by.interface,
            direction=direction,
            comment=by.comment,
            link_type=by.link_type,
            transport="tcp",
            connection=connection.name,
            after_gap=after_gap,
        )


def _brings_something(one: _Piece, side: _Side) -> bool:
    """Tell whether a segment has bytes still to be handed over, or tells by its place alone that some are lost."""
    if one.start < one.end:
        return one.end > side.next
    return one.start > (side.waiting[-1].end if side.waiting else side.next)


def _may_open(number: int, side: _Side, other: _Side) -> bool:
    """Tell whether a SYN is the one that a connection began with, or sent again."""
    if side.opened is not None:
        return side.opened == number
    if side.first is not None:
        return side.first % _SPACE == (number + 1) % _SPACE
    return other.first is None or (other.opened is not None and other.next == other.first)


def _far_back(segment: Segment, side: _Side) -> bool:
    """Tell whether a segment's bytes lie too far back to be sent again: another connection, whose SYN is not here."""
    length = len(segment.data) + segment.missing
    return (
        side.first is not None
        and length > 0
        and not segment.flags & RST
        and side.place(segment.sequence) < side.next - MOST_HELD
    )
