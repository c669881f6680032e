# SPDX-License-Identifier: GPL-2.0-or-later
"""A third reading of docs/wires.md, 4, for tests: TCP byte by byte, as slow and as plain as can be.

It shares nothing with the reference but the page: no scapy, headers by hand, a dict of single bytes. Left to the
reference's own tests: IP fragments, and how much may wait.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

SECOND_NS = 1_000_000_000
TURN = 1 << 32
FAR = 65536

Ends = frozenset[tuple[bytes, bytes]]


class Given(NamedTuple):
    """Bytes of one packet, in order."""

    number: int
    connection: int
    source: tuple[bytes, bytes]
    data: bytes
    divided: bool
    """Nothing goes on into them."""


class Seen(NamedTuple):
    """A TCP segment."""

    source: tuple[bytes, bytes]
    ends: Ends
    sequence: int
    acknowledged: int | None
    syn: bool
    reset: bool
    data: bytes
    length: int
    """Of the data, before the capture cut it off."""


def headers(link_type: int, packet: bytes) -> Seen | None:
    """Read a packet: Ethernet with VLAN tags, Linux cooked 1 and 2, raw IP."""
    if link_type == 1:
        at = 12
        while packet[at : at + 2] in (b"\x81\x00", b"\x88\xa8"):
            at += 4
        packet = packet[at + 2 :]
    else:
        packet = packet[{101: 0, 113: 16, 276: 20}[link_type] :]
    if packet[0] >> 4 == 4:
        head, total = 4 * (packet[0] & 15), int.from_bytes(packet[2:4])
        protocol, source, destination = packet[9], packet[12:16], packet[16:20]
    else:
        head, total = 40, 40 + int.from_bytes(packet[4:6])
        protocol, source, destination = packet[6], packet[8:24], packet[24:40]
    if protocol != 6:
        return None
    tcp = packet[head:total]
    offset, flags = 4 * (tcp[12] >> 4), tcp[13]
    one, other = (source, tcp[:2]), (destination, tcp[2:4])
    return Seen(
        one,
        frozenset((one, other)),
        int.from_bytes(tcp[4:8]),
        int.from_bytes(tcp[8:12]) if flags & 16 else None,
        bool(flags & 2),
        bool(flags & 4),
        tcp[offset:],
        total - head - offset,
    )


@dataclass
class Direction:
    """What came in one direction. Bytes by place: sequence numbers that go on after 2^32."""

    bytes_at: dict[int, tuple[int, int] | None] = field(default_factory=dict[int, "tuple[int, int] | None"])
    """Of places not handed over: the byte and its packet; None: cut off."""
    done: set[int] = field(default_factory=set[int])
    next: int | None = None
    floor: int = 0
    opened: int | None = None
    ack: int | None = None
    since: dict[int, int] = field(default_factory=dict[int, int])
    """When what waits at a place came, be it only a segment without bytes."""
    covered: dict[int, int] = field(default_factory=dict[int, int])
    """When it was seen that the other side has all before a place where something waits."""
    divided: bool = False

    def place(self, number: int) -> int:
        near = self.next if self.next is not None else number + TURN
        return min((near // TURN * TURN + number + turn for turn in (-TURN, 0, TURN)), key=lambda at: abs(at - near))

    @property
    def first_waiting(self) -> int | None:
        return min(self.since, default=None)


class Witness:
    """Takes packets; `given` is what they bring, in the order in which it became certain."""

    def __init__(self) -> None:
        self.given: list[Given] = []
        self._now: dict[Ends, tuple[int, dict[tuple[bytes, bytes], Direction]]] = {}
        self._names = 0

    def feed(self, number: int, time_ns: int, link_type: int, packet: bytes) -> None:
        """Take a packet."""
        for ends in self._now:
            self._give_up(ends, time_ns)
        seen = headers(link_type, packet)
        if seen is None:
            return
        sides = self._sides(seen)
        mine = sides.setdefault(seen.source, Direction())
        (peer,) = seen.ends - {seen.source}
        theirs = sides.setdefault(peer, Direction())
        if seen.acknowledged is not None:
            before = theirs.ack
            if before is None or (seen.acknowledged - before) % TURN < TURN // 2:
                theirs.ack = seen.acknowledged
            self._cover(theirs, time_ns)
        start = mine.place(seen.sequence)
        if seen.syn:
            mine.opened = seen.sequence
            start += 1
        if mine.next is None:
            mine.next = start
            mine.floor = start - (0 if mine.opened is not None else FAR)
        if not seen.reset:
            self._bytes(seen, mine, start, number, time_ns)

    def finish(self) -> list[Given]:
        """Take the end of the capture."""
        for ends in self._now:
            self._give_up(ends, None)
        return sorted(self.given, key=lambda one: one.number)

    def _sides(self, seen: Seen) -> dict[tuple[bytes, bytes], Direction]:
        known = self._now.get(seen.ends)
        if known is not None:
            mine = known[1].get(seen.source, Direction())
            others = [side for source, side in known[1].items() if source != seen.source and side.next is not None]
            new = False
            if seen.syn and mine.opened is not None:
                new = mine.opened != seen.sequence
            elif seen.syn and mine.next is not None:
                new = mine.floor + FAR != mine.place((seen.sequence + 1) % TURN)
            elif seen.syn:
                new = any(side.opened is None or side.done or side.bytes_at for side in others)
            elif mine.next is not None and seen.length and not seen.reset:
                new = mine.place(seen.sequence) < mine.next - FAR
            if new:
                self._give_up(seen.ends, None)
                known = None
        if known is None:
            self._names += 1
            known = self._now[seen.ends] = (self._names, {})
        return known[1]

    def _bytes(self, seen: Seen, mine: Direction, start: int, number: int, time_ns: int) -> None:
        assert mine.next is not None
        late: list[tuple[int, int]] = []
        keep_alive = seen.length == 1 and start + 1 == mine.next
        for at in range(start, start + seen.length):
            byte = seen.data[at - start] if at - start < len(seen.data) else None
            if at in mine.done or at < mine.floor or at in mine.bytes_at or (keep_alive and at < mine.next):
                continue
            if at < mine.next:
                if byte is not None:
                    late.append((at, byte))
                    mine.done.add(at)
                continue
            mine.bytes_at[at] = None if byte is None else (byte, number)
            mine.since[at] = time_ns
        for index, (at, byte) in enumerate(late):
            follows = index > 0 and late[index - 1][0] == at - 1
            self._hand(seen.ends, mine, number, bytes((byte,)), divided=not follows, joins=follows)
        mine.divided = mine.divided or bool(late)
        if not seen.length and start > max(mine.next, *(at + (at in mine.bytes_at) for at in mine.since), mine.next):
            mine.since[start] = time_ns
        self._in_order(seen.ends, mine, number)
        self._cover(mine, time_ns)

    def _in_order(self, ends: Ends, mine: Direction, number: int | None) -> None:
        """Hand over what comes next. number: of the packet that it counts to, else of its own or a later one."""
        assert mine.next is not None
        latest, joins = 0, False
        while mine.next in mine.bytes_at:
            held = mine.bytes_at.pop(mine.next)
            mine.since.pop(mine.next, None)
            mine.covered.pop(mine.next, None)
            if held is None:
                mine.divided, joins = True, False
            else:
                mine.done.add(mine.next)
                counts = number if number is not None else max(latest, held[1])
                joins = joins and counts == latest
                latest = counts
                self._hand(ends, mine, counts, bytes((held[0],)), divided=mine.divided, joins=joins)
                mine.divided, joins = False, True
            mine.next += 1
        for at in [at for at in mine.since if at <= mine.next]:
            del mine.since[at]
            mine.covered.pop(at, None)

    def _cover(self, side: Direction, time_ns: int) -> None:
        if side.ack is not None:
            for at in side.since:
                if side.place(side.ack) >= at:
                    side.covered.setdefault(at, time_ns)

    def _give_up(self, ends: Ends, now_ns: int | None) -> None:
        for side in self._now[ends][1].values():
            while (first := side.first_waiting) is not None:
                due = min(side.since.values()) + 60 * SECOND_NS
                if first in side.covered:
                    due = min(due, side.covered[first] + SECOND_NS)
                if now_ns is not None and now_ns <= due:
                    break
                side.next, side.divided = first, True
                self._in_order(ends, side, None)

    def _hand(self, ends: Ends, side: Direction, number: int, data: bytes, *, divided: bool, joins: bool) -> None:
        name, sides = self._now[ends]
        (source,) = [source for source, each in sides.items() if each is side]
        last = self.given[-1] if self.given else None
        if joins and last is not None and (last.number, last.connection, last.source) == (number, name, source):
            self.given[-1] = last._replace(data=last.data + data)
        else:
            self.given.append(Given(number, name, source, data, divided))
