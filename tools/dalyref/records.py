# SPDX-License-Identifier: GPL-2.0-or-later
"""From a stream of bytes to records (docs/records.md, sections 2 to 4).

From the left, the good window that ends first is a frame; of two that end together, the one that begins first:

    bytes     x x A5 40 90 08 .. 7D A5 01 90 08 .. 5D x
    records   junk|---- frame -----|----- frame -----|junk

One exception. A good A5 window W with the start of another good one, V, inside is taken only if a good window or the
end of the segment follows it directly, for a frame cut off and the one behind it can sum up right by accident:

    W         A5 01 95 08 .. (rest lost)A5 01 96 08 .. sum
    V                                   A5 01 96 08 .. .. .. .. sum
"""

from __future__ import annotations

from dalyref import a5, bluetooth_module, heads, modbus
from dalyref.gaps import LONGEST_JUNK, Gap
from dalyref.kinds import Dialect, Kind, Record

__all__ = ["Dialect", "Kind", "Record", "Splitter", "split"]

_SHORTEST = 5
"""Bytes of the shortest window, a Modbus exception."""


def _window(data: bytes, at: int, end: int) -> tuple[int, bool]:
    """Look at the head at `at`: (end of its good window or 0, whether bytes behind `end` could still make one)."""
    if data[at] != a5.START:
        return modbus.window(data, at, end)
    if end - at < a5.SIZE:
        return 0, True
    return (at + a5.SIZE if a5.is_good(data, at) else 0), False


def _stands(data: bytes, start: int, end: int, *, closed: bool) -> bool | None:
    """Tell whether the good A5 window at `start` may be taken (the exception); None: the next bytes must tell."""
    behind = start + a5.SIZE
    inner = waiting = False
    at = start
    while found := heads.WHOLE.search(data, at + 1, end):
        at = found.start()
        if at >= behind:
            break
        if data[at] == a5.START:
            stop, more = _window(data, at, end)
            inner = inner or stop > 0
            waiting = waiting or more
    if not inner and (closed or not waiting):
        return True
    if behind == end:
        return True if closed else None
    if heads.ANY.match(data, behind, end):
        stop, more = _window(data, behind, end)
        if stop:
            return True
        if more and not closed:
            return None
    return False if inner else None


def _choose(data: bytes, start: int, end: int, *, closed: bool, decide: bool) -> tuple[int, int]:
    """Choose the first frame that begins at `start` or later: (its first byte, its end).

    Without one: (the first position where one could still begin, 0). `closed`: the segment ends at `end`.
    `decide`: so it does for a good window that waits for its neighbour.
    """
    barred: set[int] = set()
    while True:
        first, first_end, open_from = -1, end + 1, end
        at = start - 1
        while found := heads.ANY.search(data, at + 1, end):
            at = found.start()
            if first >= 0 and at + _SHORTEST >= first_end:  # it could not end earlier
                break
            if at in barred:
                continue
            stop, more = _window(data, at, end)
            if stop and stop < first_end:
                first, first_end = at, stop
            if more:
                open_from = min(open_from, at)
        if first < 0:
            return (end if closed else open_from), 0
        if data[first] == a5.START:
            stands = _stands(data, first, end, closed=closed or decide)
            if stands is None:
                return min(open_from, first), 0
            if not stands:
                barred.add(first)
                continue
        return first, first_end


def _dialect(head: int) -> Dialect:
    if head == a5.START:
        return Dialect.A5
    return Dialect.D2 if head == 0xD2 else Dialect.P81


def _frame(start: int, window: bytes) -> Record:
    """Make the record of a good window."""
    dialect = _dialect(window[0])
    if dialect is not Dialect.A5 and bluetooth_module.is_modbus(window):
        return Record(start, window, Kind.FOREIGN, foreign=bluetooth_module.NAME)
    return Record(start, window, Kind.FRAME, dialect)


class Splitter:
    """Cuts one stream that comes in pieces. However it is cut into pieces, the records are the same.

    A record is handed over as soon as no later byte can change it, and in order. What is held is bounded: an undecided
    gap is cut at 4096 bytes (``pending`` stays below 9000).
    """

    __slots__ = ("_base", "_data", "_gap", "_scan")

    def __init__(self) -> None:
        self._data = b""  # what is in no record yet
        self._base = 0  # its offset in the stream
        self._scan = 0  # no frame begins before this
        self._gap = Gap()

    @property
    def pending(self) -> int:
        """Number of bytes held because later ones may change their record."""
        return len(self._data)

    @property
    def begun(self) -> bool:
        """Tell whether the bytes so far end in what may still become a frame."""
        return self._scan < len(self._data)

    def feed(self, data: bytes, *, decide: bool = False) -> list[Record]:
        """Take the next bytes of the stream; return the records that are now certain.

        decide: a good frame does not wait for its neighbour's bytes, and a gap is handed over whole (docs/wires.md, 4).
        """
        self._data = self._data + data if self._data else bytes(data)
        return self._advance(closed=False, decide=decide)

    def passed(self, count: int) -> None:
        """Take note of `count` bytes, whole frames, that were cut elsewhere while nothing was held."""
        self._base += count
        self._gap.shift(count)

    def event(self) -> None:
        """Note that an event lies at the present position: junk and foreign records end there, frames do not."""
        self._gap.event(len(self._data))

    def flush(self) -> list[Record]:
        """Silence, or the end of the stream: return all that is held. The next bytes begin a new segment."""
        out = self._advance(closed=True)
        self._gap = Gap()
        self._scan = 0
        return out

    def _advance(self, *, closed: bool, decide: bool = False) -> list[Record]:
        out: list[Record] = []
        data, base = self._data, self._base
        end = len(data)
        at, scan = 0, self._scan
        ambiguous = heads.WHOLE.search
        while True:
            # The clean frame, which is nearly all there is: no other window can begin in it.
            while (
                end - at >= 13
                and data[at] == 0xA5
                and data[at + 3] == 8
                and sum(data[at : at + 12]) & 0xFF == data[at + 12]
                and ambiguous(data, at + 1, at + 13) is None
            ):
                out.append(Record(base + at, data[at : at + 13], Kind.FRAME, Dialect.A5))
                at += 13
            if at == end:
                scan = at
                break
            start, stop = _choose(data, max(at, scan), end, closed=closed, decide=decide)
            if not stop:
                scan = start
                if not decide or start - at > LONGEST_JUNK:
                    at = self._gap.cut(data, at, start, base, out, closed=closed)
                break
            if start > at:
                self._gap.cut(data, at, start, base, out, closed=True)
            out.append(_frame(base + start, data[start:stop]))
            at = scan = stop
        if at:
            self._gap.shift(at)
            self._data = data[at:]
            self._base = base + at
        self._scan = scan - at
        return out


def split(data: bytes) -> list[Record]:
    """Cut a whole stream (one segment) into records."""
    splitter = Splitter()
    return splitter.feed(data) + splitter.flush()
