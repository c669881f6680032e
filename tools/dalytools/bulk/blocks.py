# SPDX-License-Identifier: GPL-2.0-or-later
"""pcapng to columns of packets: blocks of one size in a row at once, what is unlike its neighbours one by one.

    | 6 48 .. 48 | 6 48 .. 48 | 6 48 .. 48 | 6 60 .. flags .. 60 | 5 .. | 6 48 .. 48 |     type, length .. length
    |<------- a run: one look at all ----->|<- walked ->|        ^ the plain reader's

A packet block is taken here when its two lengths agree, its data fits, its interface is described, and it has no
option but flags. All else, and whatever is wrong, goes through the plain reader, whose words and errors it gives.
"""

from __future__ import annotations

import io
import struct
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from dalycapture.errors import CaptureError
from dalycapture.file_numbers import BYTE_ORDER_MAGIC, ENHANCED_PACKET, MAX_BLOCK
from dalycapture.pcapng import PcapngReader
from dalycapture.source import Source
from dalytools.bulk.equal import repeated
from dalytools.bulk.packets import SPARE, Gathered, Packets, gather

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from dalycapture.captured import Told
    from dalytools.bulk.arrays import Array, Bytes, Flags, Ints, Words, Words32
    from dalytools.bulk.packets import Interfaces

CHUNK: Final = 2 << 20
"""Bytes read at a time: of less, what is done once for each costs more; more does not stay in the processor's cache."""
_HEAD: Final = 7
"""Words of a packet block before its data."""
_LEAST: Final = 8
"""Words of a packet block without data."""
_FLAGS: Final = 2 | 4 << 16
"""Code and length of the option, as one little-endian word."""
_FIRST_GUESS: Final = 64
"""So many blocks are looked at first when they are unlike those before."""
_SHORT_RUN: Final = 16
_WALKED: Final = 128
"""So many blocks are walked one by one after a short run."""


class BlockReader:
    """Reads one pcapng file."""

    def __init__(self, source: Source, interfaces: Interfaces, told: Told, *, chunk: int = CHUNK) -> None:
        """interfaces: takes those that the file describes. chunk: bytes read at a time."""
        self._source = source
        self._interfaces = interfaces
        self._reader = PcapngReader(source, told)
        self._chunk = chunk
        self._parts: list[_Part] = []
        self._rows = Gathered()
        self._extra = bytearray()  # data of packets that the plain reader read
        self._extra_at = 0
        self._comments: dict[int, str] = {}
        self._buffer: Bytes = np.zeros(0, np.uint8)  # used again for each chunk
        self._data = memoryview(b"")  # the chunk at hand
        self._start = 0  # its first byte's offset in the file
        self._guess = _FIRST_GUESS

    def packets(self) -> Iterator[Packets]:
        """Yield the packets, some at a time: their `buffer` is written over when the next are asked for.

        Raises what ``read_pcapng`` raises, after the packets before.
        """
        left = 0
        while True:
            self._make_room(left)
            more = self._source.read_into(self._buffer.data[left : left + self._chunk])
            size = left + more
            self._start = self._source.offset - size
            self._data = self._buffer.data[:size]
            problem: CaptureError | None = None
            done = 0
            try:
                done = self._walk()
                if not more and done < size:
                    self._plain(done, size)  # says how it is cut off
                    done = size
            except CaptureError as error:
                problem = error
            packets = self._collected()
            if len(packets):
                yield packets
            if problem:
                raise problem
            if not more:
                return
            left = size - done
            self._buffer[:left] = self._buffer[done:size]

    def _make_room(self, left: int) -> None:
        """See to it that a chunk fits into the buffer behind what is left of the one before."""
        room = left + self._chunk
        self._extra_at = room + -room % 4
        if len(self._buffer) < self._extra_at + SPARE:
            larger = np.zeros(self._extra_at + SPARE + left, np.uint8)  # a long block takes more than one chunk
            larger[:left] = self._buffer[:left]
            self._buffer = larger

    def _walk(self) -> int:
        """Take all blocks of the chunk that are whole; return the offset of the first that is not."""
        words: Words32 = self._buffer[: len(self._data) // 4 * 4].view("<u4")
        if self._reader.order == ">":
            words = words.byteswap()
        end = len(words)
        at = 0
        while at + 3 <= end:
            at = self._packet_blocks(words, at)
            if at + 3 > end:
                break
            size = self._size(at)
            if size > end - at:
                break
            order = self._reader.order
            self._plain(4 * at, 4 * (at + size))
            at += size
            if self._reader.order != order:
                words = words.byteswap()
        return 4 * at

    def _size(self, at: int) -> int:
        """Return the size, in words, of the block at word `at`; of one that can not be, as much as shows it."""
        kind, total, magic = struct.unpack_from(self._reader.order + "III", self._data, 4 * at)
        if kind == 0x0A0D0D0A and magic != BYTE_ORDER_MAGIC:
            total = int.from_bytes(total.to_bytes(4, "little"), "big")
        return total // 4 if 12 <= total <= MAX_BLOCK and total % 4 == 0 else 3

    def _packet_blocks(self, words: Words32, at: int) -> int:
        """Take packet blocks that follow each other from word `at` on; return the word behind them."""
        found: list[Ints] = []
        end = len(words)
        guess = self._guess
        look = words.data
        while at + _LEAST <= end and look[at] == ENHANCED_PACKET:
            total = look[at + 1]
            size = total >> 2
            if total & 3 or size < _LEAST or total > MAX_BLOCK:
                break
            count = min((end - at) // size, guess)
            if not count:
                break
            # Type and length are one number of 64 bits.
            heads = np.ndarray((count,), np.uint64, words, 4 * at, (total,)).copy()
            alike = heads == (ENHANCED_PACKET | total << 32)
            alike &= words[at + size - 1 : at + count * size : size] == total
            run = count if alike.all() else int(alike.argmin())
            guess = min(guess * 8, 1 << 20) if run == count else _FIRST_GUESS
            if run < _SHORT_RUN:
                at, starts = _walked(look, at, _WALKED)
                if not starts:
                    break
                found.append(np.array(starts, np.int64))
                continue
            if found or not self._take_run(words, at, run, size):
                found.append(np.arange(at, at + run * size, size))
            at += run * size
        self._guess = guess
        if found:
            self._take(words, found[0] if len(found) == 1 else np.concatenate(found))
        return at

    def _take_run(self, words: Words32, at: int, count: int, size: int) -> bool:
        """Take packet blocks of one size, if in all of them what stands before and behind the data has one form."""
        reader = self._reader
        sides = reader.sides
        rows = words[at : at + count * size].reshape(count, size)
        length = int(rows[0, 5])
        options = _HEAD + ((length + 3) >> 2)
        left = size - 1 - options
        if left < 0 or not sides or not (rows[:, 5] == length).all():
            return False
        number = int(rows[0, 2])
        one = bool((rows[:, 2] == number).all())
        if one and number < len(sides):
            side = sides[number]
            interface = repeated(side.number, count)
        else:
            if rows[:, 2].max() >= len(sides):
                return False
            interface = np.array([side.number for side in sides], np.int64)[rows[:, 2]]
        if any(side.resolution != 9 or side.offset_s for side in ([sides[number]] if one else sides)):
            return False
        # The halves of the time stand the other way round.
        ticks = np.ndarray((count,), np.uint64, words, 4 * (at + 3), (4 * size,)).copy()
        high = ticks << np.uint64(32)
        ticks >>= np.uint64(32)
        ticks |= high
        if ticks.max() >= 1 << 61:  # else the time may be too large for us
            return False
        flags = repeated(0, count)
        if left:
            if reader.order == ">" or left != 3 or not (rows[:, options] == _FLAGS).all():
                return False
            if (rows[:, options + 2] & 0xFFFF).any():
                return False
            flags = (rows[:, options + 1] & 3).astype(np.int64)
            flags[flags == 3] = 0
        offset = np.arange(4 * (at + _HEAD), 4 * (at + _HEAD + count * size), 4 * size)
        self._add((ticks.view(np.int64), interface, flags, offset, repeated(length, count)))
        return True

    def _add(self, columns: tuple[Ints, ...]) -> None:
        """Take time, interface, side, offset and length of packets that follow each other."""
        self._close_rows()
        _, _, _, offset, _ = columns
        number = np.arange(self._reader.number + 1, self._reader.number + 1 + len(offset))
        self._parts.append(_Part((number, *columns), gather(self._buffer, offset)))
        self._reader.number += len(offset)

    def _take(self, words: Words32, starts: Ints) -> None:
        """Take packet blocks whose sizes are right."""
        reader = self._reader
        sides = reader.sides
        first, size = int(starts[0]), int(words[starts[0] + 1]) >> 2
        last = int(starts[-1])
        alike = int(words[last + 1]) >> 2 == size and (starts[1:] - starts[:-1] == size).all()
        block = words[first : last + size].reshape(-1, size) if alike else words[starts[:, None] + np.arange(6)]
        sizes = block[:, 1].astype(np.int64) >> 2
        interface = block[:, 2]
        high = block[:, 3]
        low = block[:, 4]
        length = block[:, 5].astype(np.int64)
        options = _HEAD + ((length + 3) >> 2)
        left = sizes - 1 - options
        good = (left >= 0) & (interface < len(sides)) & (high < 1 << 29)  # else the time may be too large for us
        flags = np.zeros(len(starts), np.uint32)
        if left.any():
            where = starts + np.where(good & (left > 0), options, 0)
            first = words[where]
            single = good & (left == 3) & (first == _FLAGS)
            flags[single] = words[where[single] + 1]
            nothing = (first & 0xFFFF) == 0
            ended = np.zeros(len(starts), np.bool_)
            ended[single] = (words[where[single] + 2] & 0xFFFF) == 0
            good &= (left == 0) | ended | nothing
            flags[~good] = 0
            if reader.order == ">":
                good &= left == 0  # there the two halves of a word stand the other way round
        ticks = high.astype(np.int64) << 32 | low.astype(np.int64)
        time_ns = self._times(ticks, interface, good)
        side = (flags & 3).astype(np.int64)
        side[side == 3] = 0
        numbers_over_file = np.array([side.number for side in sides], np.int64)
        interface = numbers_over_file[np.where(good, interface, 0)] if sides else interface.astype(np.int64)
        columns = (time_ns, interface, side, 4 * (starts + _HEAD), length)
        begin = 0
        for odd in (*np.flatnonzero(~good).tolist(), len(starts)):
            if odd > begin:
                self._add(tuple(column[begin:odd] for column in columns))
            if odd < len(starts):
                self._plain(4 * int(starts[odd]), 4 * int(starts[odd] + sizes[odd]))
            begin = odd + 1

    def _times(self, ticks: Ints, interface: Words32, good: Flags) -> Ints:
        """Return ns since 1970; clear in `good` what is to be calculated one by one."""
        out = ticks
        for index, side in enumerate(self._reader.sides):
            if side.resolution == 9 and not side.offset_s:
                continue
            mine = interface == index
            if not mine.any():
                continue
            if side.resolution > 9 or abs(side.offset_s) >= 1 << 31:
                good &= ~mine
                continue
            factor = 10 ** (9 - side.resolution)
            good &= ~(mine & (ticks > (1 << 62) // factor))
            out = np.where(mine & good, ticks * factor + side.offset_s * 1_000_000_000, out)
            good &= out >= 0  # before 1970: the plain reader has its word for it
        return out

    def _plain(self, start: int, stop: int) -> None:
        """Have the plain reader read some of the chunk."""
        source = Source(io.BytesIO(self._data[start:stop]), self._source.name)
        source.offset = self._start + start
        self._reader.source = source
        try:
            for packet in self._reader.packets():
                self._rows.add(packet, self._extra_at + len(self._extra))
                self._extra += packet.data + bytes(-len(packet.data) % 4)
                if packet.comment:
                    self._comments[packet.number] = packet.comment
        finally:
            known = self._interfaces
            for side in self._reader.sides:
                if side.number == len(known.link_type):
                    known.link_type.append(side.link_type)
                    known.description.append(side.description)

    def _close_rows(self) -> None:
        rows = self._rows
        if rows.number:
            offset = np.array(rows.offset, np.int64)
            extra = np.frombuffer(bytes(self._extra) + bytes(SPARE), np.uint8)
            columns = (rows.number, rows.time_ns, rows.interface, rows.side, rows.offset, rows.length)
            words = gather(extra, offset - self._extra_at)
            self._parts.append(_Part(tuple(np.array(column, np.int64) for column in columns), words))
            self._rows = Gathered()

    def _collected(self) -> Packets:
        """Return what was taken of the chunk."""
        self._close_rows()
        parts, comments = self._parts, self._comments
        columns: tuple[Ints, ...] = (np.zeros(0, np.int64),) * 6
        words = np.zeros((0, 2), np.uint64)
        if parts:
            columns = tuple(_joined(column) for column in zip(*(part.columns for part in parts), strict=True))
            words = _joined([part.words for part in parts])
        buffer = self._buffer[: self._extra_at + SPARE]
        if self._extra:
            extra = np.frombuffer(bytes(self._extra) + bytes(SPARE), np.uint8)
            buffer = np.concatenate((buffer[: self._extra_at], extra))
        self._parts, self._comments = [], {}
        self._extra.clear()
        number, time_ns, interface, side, offset, length = columns
        return Packets(buffer, number, time_ns, interface, side.astype(np.uint8), offset, length, words, comments)


class _Part(NamedTuple):
    """Some packets: number, time, interface, side, offset, length; and the first sixteen bytes of each."""

    columns: tuple[Ints, ...]
    words: Words


def _joined(arrays: Sequence[Array]) -> Array:
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _walked(look: memoryview, at: int, most: int) -> tuple[int, list[int]]:
    """Walk packet blocks one by one: (the word behind them, where they begin)."""
    starts: list[int] = []
    end = len(look)
    while at + _LEAST <= end and len(starts) < most and look[at] == ENHANCED_PACKET:
        total = look[at + 1]
        stop = at + (total >> 2)
        if total & 3 or total < 4 * _LEAST or total > MAX_BLOCK or stop > end or look[stop - 1] != total:
            break
        starts.append(at)
        at = stop
    return at, starts
