# SPDX-License-Identifier: GPL-2.0-or-later
"""Packets to records, in the order of the file: clean frames at once, all else through the plain decoder's splitter.

    packets   F F F F F F J F F F s f F F F F F E F F F        F clean, J junk, s f a frame cut in two, E event
    at once   <--------->     <->     <----------------->
    plain                <--->   <----->                       until nothing is held any more

As long as no byte is held, a packet that is a clean frame is a record by itself on any stream. From one that is not,
every packet is fed to ``dalyref.file_order`` until nothing is held again.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref import a5
from dalyref.file_order import FileOrder
from dalyref.kinds import Dialect, Kind
from dalyref.packet import SERIAL_LINK_TYPES
from dalyref.streams import Located
from dalytools.bulk.equal import all_equal
from dalytools.bulk.frames import Stands, stands, whole
from dalytools.bulk.packets import SIDES
from dalytools.bulk.unlike import NotSerialError, UnlikeError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dalyref.options import Options
    from dalytools.bulk.arrays import Array, Bytes, Flags, Ints, Words
    from dalytools.bulk.packets import Interfaces, Packets

KINDS: Final = tuple(Kind)
"""What a number in the column `kind` means."""
FRAME, EVENT = KINDS.index(Kind.FRAME), KINDS.index(Kind.EVENT)
DIALECTS: Final = (None, Dialect.A5, Dialect.D2, Dialect.P81)
"""What a number in the column `dialect` means."""
_A5: Final = 1
_MOST_INTERFACES: Final = 1000
_LATEST_NS: Final = 1 << 62
"""Sums of later times and of what something lasts may not fit a column."""


@dataclass(slots=True)
class Records:
    """Some records in the order of the file, a row each."""

    number: Ints
    """Of the packet in which it ends."""
    time_ns: Ints
    """When its first byte began."""
    end_ns: Ints
    kind: Bytes
    """Index into KINDS."""
    dialect: Bytes
    """Index into DIALECTS."""
    interface: Ints
    side: Bytes
    words: Words
    """The thirteen bytes of what is 13 bytes in the form of an A5 frame: dialect A5."""
    others: dict[int, bytes]
    """The bytes of other records, by row."""
    comments: dict[int, str]
    """Of packets, by number."""

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.number)

    def data(self, row: int) -> bytes:
        """Return the bytes of one."""
        other = self.others.get(row)
        return self.words[row].tobytes()[: a5.SIZE] if other is None else other


class Cutter:
    """Makes records of the packets of one file."""

    def __init__(self, options: Options, interfaces: Interfaces) -> None:
        self._interfaces = interfaces
        self._lasts_ns = options.characters_ns(a5.SIZE)
        self._quiet_ns = options.limit_ns(options.quiet)
        self._order = FileOrder[Located](options)
        self._passed: dict[tuple[int, int], int] = {}  # by interface and side: end of its last frame, not told yet

    def take(self, packets: Packets) -> Records:
        """Take the next packets; return the records that are certain."""
        self._refuse_others(packets)
        words = packets.words
        streams = _Streams(packets)
        at_once = self._clean(packets, words, streams)
        if not packets.length.all():
            at_once |= packets.length == 0
        held = self._cut(packets, at_once, streams)
        records = self._frames(packets, words, at_once)
        self._note_passed(packets, at_once, streams)
        return _merged(records, self._plain(held)) if held else records

    def finish(self) -> Records:
        """Take the end of the file; return what was held."""
        return self._plain(list(self._order.finish()))

    def _refuse_others(self, packets: Packets) -> None:
        known = self._interfaces.link_type
        serial = np.array([link_type in SERIAL_LINK_TYPES for link_type in known], np.bool_)
        if not serial.all() and not serial[packets.interface].all():
            raise NotSerialError("holds packets that are not of a serial line")
        if len(packets) and packets.time_ns.max() >= _LATEST_NS:
            raise UnlikeError("times after the year 2116")
        if len(known) > _MOST_INTERFACES:
            raise UnlikeError("more than a thousand interfaces")

    def _clean(self, packets: Packets, words: Words, streams: _Streams) -> Flags:
        """Tell which packets are a record by themselves, when nothing is held before."""
        frame, doubtful = whole(words)
        frame &= packets.length == a5.SIZE
        doubtful = doubtful[frame[doubtful]]
        if not len(doubtful):
            return frame
        out = frame.copy()
        raw = words[doubtful].tobytes()
        verdicts = [stands(raw[at : at + a5.SIZE]) for at in range(0, len(raw), 16)]
        out[doubtful] = [verdict is Stands.ALONE for verdict in verdicts]
        before_frame = doubtful[[verdict is Stands.BEFORE_FRAME for verdict in verdicts]]
        if len(before_frame):
            behind = streams.after(before_frame)
            silence_ns = packets.time_ns[behind] - packets.time_ns[before_frame]
            out[before_frame] = (behind >= 0) & (frame[behind] | (silence_ns > self._lasts_ns + self._quiet_ns))
        return out

    def _cut(self, packets: Packets, at_once: Flags, streams: _Streams) -> list[Located]:
        """Feed what can not be taken at once, and clear it in `at_once`; return the records it made."""
        order, count = self._order, len(packets)
        out: list[Located] = []
        unclean: list[int] = np.flatnonzero(~at_once).tolist()
        fed: dict[tuple[int, int], int] = {}  # by stream: the last row that went this way
        row, following = 0, 0
        while True:
            if order.idle:
                following = bisect_left(unclean, row, following)
                if following == len(unclean):
                    break
                row = unclean[following]
            if row == count:
                break
            at_once[row] = False
            key = (int(packets.interface[row]), int(packets.side[row]))
            before = streams.before(key, row)
            if before > fed.get(key, -1) and at_once[before]:
                order.passed(key[0], SIDES[key[1]], a5.SIZE, int(packets.time_ns[before]) + self._lasts_ns)
            elif key not in fed and key in self._passed:
                order.passed(key[0], SIDES[key[1]], a5.SIZE, self._passed[key])
            self._passed.pop(key, None)
            fed[key] = row
            order.feed(packets.packet(row, self._interfaces))
            out += order.released()
            row += 1
        return out

    def _note_passed(self, packets: Packets, at_once: Flags, streams: _Streams) -> None:
        """Note the end of each stream's last frame, where it was taken at once."""
        for key in streams.present():
            last = streams.before(key, len(packets))
            if last >= 0 and at_once[last]:
                self._passed[key] = int(packets.time_ns[last]) + self._lasts_ns

    def _frames(self, packets: Packets, words: Words, at_once: Flags) -> Records:
        """Make the records of packets that are one each."""
        kind = np.full(len(packets), FRAME, np.uint8)
        dialect = np.full(len(packets), _A5, np.uint8)
        end_ns = packets.time_ns + self._lasts_ns
        others: dict[int, bytes] = {}
        if not packets.length.all():
            event = packets.length == 0
            kind[event] = EVENT
            dialect[event] = 0
            end_ns[event] -= self._lasts_ns
            others = dict.fromkeys(np.flatnonzero(event[at_once]).tolist(), b"")
        some: slice | Ints = slice(None) if at_once.all() else np.flatnonzero(at_once)
        return Records(
            packets.number[some],
            packets.time_ns[some],
            end_ns[some],
            kind[some],
            dialect[some],
            packets.interface[some],
            packets.side[some],
            words[some],
            others,
            packets.comments,
        )

    def _plain(self, located: Iterable[Located]) -> Records:
        """Make columns of records that were cut the plain way."""
        numbers: list[tuple[int, int, int, int]] = []
        small: list[tuple[int, int, int]] = []
        frames = bytearray()
        others: dict[int, bytes] = {}
        comments: dict[int, str] = {}
        for row, item in enumerate(located):
            packet, record = item.packet, item.record
            kind, dialect, data = Kind.EVENT, None, b""
            if record is not None:
                kind, dialect, data = record.kind, record.dialect, record.data
            numbers.append((packet.number, item.start_ns, item.end_ns, packet.interface))
            small.append((KINDS.index(kind), DIALECTS.index(dialect), SIDES.index(packet.direction)))
            if dialect is Dialect.A5:
                frames += data + bytes(16 - a5.SIZE)
            else:
                others[row] = data
                frames += bytes(16)
            if packet.comment:
                comments[packet.number] = packet.comment
        number, time_ns, end_ns, interface = np.array(numbers, np.int64).reshape(-1, 4).T
        kinds, dialects, sides = np.array(small, np.uint8).reshape(-1, 3).T
        words = np.frombuffer(bytes(frames), np.uint64).reshape(-1, 2)
        return Records(number, time_ns, end_ns, kinds, dialects, interface, sides, words, others, comments)


class _Streams:
    """Where the packets with data of each stream are, found when asked for."""

    def __init__(self, packets: Packets) -> None:
        self._packets = packets
        self._rows: dict[tuple[int, int], Sequence[int]] = {}
        interface, side = packets.interface, packets.side
        self._one = bool(len(packets) and packets.length.all() and all_equal(interface) and all_equal(side))

    def present(self) -> list[tuple[int, int]]:
        """Return all streams: (interface, side)."""
        packets = self._packets
        if self._one:
            return [(int(packets.interface[0]), int(packets.side[0]))]
        present = np.bincount(packets.interface << 2 | packets.side)
        return [(key >> 2, key & 3) for key in np.flatnonzero(present).tolist()]

    def before(self, key: tuple[int, int], row: int) -> int:
        """Return the last row of a stream before `row`, -1: none."""
        rows = self._of(key)
        at = bisect_left(rows, row)
        return rows[at - 1] if at else -1

    def after(self, rows: Ints) -> Ints:
        """Return of each row the next of its stream, -1: none."""
        if self._one:
            return np.where(rows + 1 < len(self._packets), rows + 1, -1)
        interface, side = self._packets.interface, self._packets.side
        found: list[int] = []
        for row in rows.tolist():
            same = self._of((int(interface[row]), int(side[row])))
            at = bisect_right(same, row)
            found.append(same[at] if at < len(same) else -1)
        return np.array(found, np.int64)

    def _of(self, key: tuple[int, int]) -> Sequence[int]:
        if self._one:
            return range(len(self._packets))
        rows = self._rows.get(key)
        if rows is None:
            packets = self._packets
            mine = (packets.interface == key[0]) & (packets.side == key[1]) & (packets.length > 0)
            found: list[int] = np.flatnonzero(mine).tolist()
            rows = self._rows[key] = found
        return rows


def _merged(first: Records, second: Records) -> Records:
    """Put two lots of records in the order of their numbers; no packet has records in both."""
    where = np.searchsorted(first.number, second.number)
    place_second = where + np.arange(len(second))
    place_first = np.arange(len(first)) + np.searchsorted(second.number, first.number)
    total = len(first) + len(second)

    def both(one: Array, other: Array) -> Array:
        out = np.empty((total, *one.shape[1:]), one.dtype)
        out[place_first], out[place_second] = one, other
        return out

    others = {int(place_first[row]): data for row, data in first.others.items()}
    others |= {int(place_second[row]): data for row, data in second.others.items()}
    return Records(
        both(first.number, second.number),
        both(first.time_ns, second.time_ns),
        both(first.end_ns, second.end_ns),
        both(first.kind, second.kind),
        both(first.dialect, second.dialect),
        both(first.interface, second.interface),
        both(first.side, second.side),
        both(first.words, second.words),
        others,
        first.comments | second.comments,
    )
