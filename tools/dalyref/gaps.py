# SPDX-License-Identifier: GPL-2.0-or-later
"""What is left between two frames: foreign, bad_checksum, short, junk (docs/records.md, section 4).

    | frame |  junk  | A5 . . 08 ... bad | junk | A5 40 90 08 00 | frame |
                       bad_checksum                short
            |<----------------- gap ----------------------------->|

An event divides a gap into pieces. A piece that is, whole, other people's traffic is foreign; the pieces between
are cut as if the foreign one were a frame.
"""

from __future__ import annotations

from dalyref import a5, foreign, heads, modbus
from dalyref.kinds import Dialect, Kind, Record

LONGEST_JUNK = 4096


def _left(data: bytes, at: int, end: int, *, closed: bool) -> tuple[Kind, int] | None:
    """Say what begins at `at` and where it ends, or None where bytes behind `end` must tell.

    A head (``heads.ANY``) stands at `at`. `closed`: the gap ends at `end`.
    """
    there = end - at
    if data[at] == a5.START:
        if there >= a5.SIZE:
            return Kind.BAD_CHECKSUM, at + a5.SIZE
        cut_off, begun = True, there >= 4
    else:
        begun = there >= 2
        cut_off = not begun or modbus.forms(data, at, end)[-1:] > [there]
    if not cut_off:
        return Kind.JUNK, at + 1
    if not closed:
        return None
    return (Kind.SHORT, end) if begun else (Kind.JUNK, at + 1)


class Gap:
    """The gap that is open at present. All positions count in the buffer that the caller holds."""

    __slots__ = ("_events", "_foreign", "_junk", "_piece", "_plain", "_start")

    def __init__(self) -> None:
        self._events: list[int] = []  # where events lie, in order
        self._restart(0)

    def _restart(self, start: int) -> None:
        self._start = start  # the first byte that is in no record yet
        self._junk = start  # from _start up to here it is junk
        self._next_piece(start)

    def _next_piece(self, start: int) -> None:
        self._piece = start  # where the piece that is looked at begins
        self._plain = False  # it is known not to be foreign
        self._foreign = foreign.Run()

    def event(self, at: int) -> None:
        """Note that an event lies at `at`."""
        if self._events[-1:] != [at]:  # many events at one place are one border
            self._events.append(at)

    def shift(self, count: int) -> None:
        """Drop `count` bytes, all of them in records, from the buffer's left."""
        self._start -= count
        self._junk -= count
        self._piece -= count
        if self._events:
            self._events = [event - count for event in self._events if event > count]

    def cut(self, data: bytes, start: int, known: int, base: int, out: list[Record], *, closed: bool) -> int:
        """Append what has become certain of the gap that begins at `start` to `out`; return the first byte left over.

        ``data[start:known]`` is known to be in no frame; `closed`: the gap ends at `known`. `base` is the stream offset
        of ``data[0]``.
        """
        if self._start != start:
            self._restart(start)
        while True:
            event = next((event for event in self._events if event > self._piece), None)
            ended = closed
            limit = known
            if event is not None and event <= known:
                ended, limit = True, event
            if limit <= self._piece:
                break
            if not self._plain:
                name = self._foreign.judge(data, self._piece, limit, ended=ended)
                if name is None:
                    break
                if name:
                    self._divide(data, self._piece, base, out, closed=True)
                    out.append(Record(base + self._piece, data[self._piece : limit], Kind.FOREIGN, foreign=name))
                    self._restart(limit)
                    continue
                self._plain = True
            if not ended:
                self._divide(data, limit, base, out, closed=False)
                return self._start
            self._next_piece(limit)
        self._divide(data, self._piece, base, out, closed=closed)
        return self._start

    def _divide(self, data: bytes, end: int, base: int, out: list[Record], *, closed: bool) -> None:
        """Cut what is not foreign, up to `end`, from the left."""
        while self._junk < end:
            head = heads.ANY.search(data, self._junk, end)
            self._junk = at = head.start() if head else end
            self._put_junk(data, base, out, closed=False)
            if at == end:
                break
            verdict = _left(data, at, end, closed=closed)
            if verdict is None:
                return
            kind, stop = verdict
            self._junk = stop
            if kind is Kind.JUNK:
                continue
            self._junk = at
            self._put_junk(data, base, out, closed=True)
            dialect = Dialect.A5 if kind is Kind.BAD_CHECKSUM else None
            out.append(Record(base + at, data[at:stop], kind, dialect))
            self._start = self._junk = stop
        self._put_junk(data, base, out, closed=closed)

    def _put_junk(self, data: bytes, base: int, out: list[Record], *, closed: bool) -> None:
        """Write the junk from _start to _junk down, as far as it is complete; `closed`: it ends at _junk."""
        while self._start < self._junk:
            stop = self._start + LONGEST_JUNK
            event = next((event for event in self._events if event > self._start), stop)
            stop = min(stop, event)
            if stop > self._junk:
                if not closed:
                    return
                stop = self._junk
            out.append(Record(base + self._start, data[self._start : stop], Kind.JUNK))
            self._start = stop
