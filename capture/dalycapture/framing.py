# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes as they were read become records with the time at which each began on the wire.

What a record is, dalyref.records decides, by content. Here is only time. A byte takes ten bits (8N1), c = 10 / baud::

    wire   ...|<------------- record, n bytes ------------->|<- behind ->|
    reads              ^ t1: k1 bytes of it so far                       ^ t2: n bytes of it and m bytes behind it

A read at t2 that delivered the bytes up to n + m behind a record's start says: it began no later than
t2 - (n + m) * c. So does every read that carried a piece of it; the earliest of these bounds is the estimate. It is
never before the end of the record before it, and never later than the read in which its first byte came.
Adapters hold bytes back (FTDI: up to 16 ms), so the truth may lie that much earlier (capture notes on latency timers).

Quiet of 250 ms closes what is incomplete (docs/records.md, 1). Whoever reads the port calls ``flush`` when its timer
says so; ``feed`` sees it too when the next bytes come after such a pause.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

from dalyref.records import Splitter

if TYPE_CHECKING:
    from dalyref.records import Record

BITS_PER_BYTE: Final = 10  # 8N1: start, eight data, stop
SILENCE_NS: Final = 250_000_000
A5_START: Final = 0xA5
A5_SIZE: Final = 13


@dataclass(frozen=True, slots=True)
class TimedRecord:
    """A record and when its first byte began on the wire, in nanoseconds since 1970 (UTC)."""

    time_ns: int
    record: Record


class _Read(NamedTuple):
    """One read: it ended at this offset of the stream, at this time."""

    end: int
    time_ns: int


class Framer:
    """One stream of bytes, one tapped side.

    baud: bits per second, of the wire (not of the adapter's cable); silence_ns: quiet that closes what is incomplete.
    """

    def __init__(self, baud: int = 9600, silence_ns: int = SILENCE_NS) -> None:
        self._splitter = Splitter()
        self._ahead = b""  # not yet shown to the splitter
        self._byte_ns = BITS_PER_BYTE * 1_000_000_000 / baud
        self._silence_ns = silence_ns
        self._reads: deque[_Read] = deque()  # those that carried bytes of records yet to come
        self._fed = 0  # bytes
        self._free_ns = 0  # the record before had ended by then

    @property
    def pending(self) -> bool:
        """True while bytes are held back: call ``flush`` after quiet."""
        return bool(self._reads)

    def feed(self, data: bytes, read_ns: int) -> list[TimedRecord]:
        """Take the bytes of one read, which returned at read_ns; the records that are complete now."""
        timed: list[TimedRecord] = []
        if self._reads and self._wire_ns(read_ns, len(data)) > self._reads[-1].time_ns + self._silence_ns:
            timed = self.flush()
        if not data:
            return timed
        self._fed += len(data)
        self._reads.append(_Read(self._fed, read_ns))
        # A byte a read is what a UART gives. A frame of 13 that has just begun needs no look before it can be whole:
        # how the bytes are cut into pieces makes no difference to the records.
        self._ahead += data
        if self._ahead[0] == A5_START and len(self._ahead) < A5_SIZE and not self._splitter.pending:
            return timed
        ahead, self._ahead = self._ahead, b""
        return timed + [self._timed(record) for record in self._splitter.feed(ahead)]

    def flush(self) -> list[TimedRecord]:
        """Close what is incomplete: the bus is quiet, or the capture ends."""
        ahead, self._ahead = self._ahead, b""
        return [self._timed(record) for record in self._splitter.feed(ahead) + self._splitter.flush()]

    def _wire_ns(self, read_ns: int, length: int) -> int:
        """When ``length`` bytes began, the last of which had ended at read_ns."""
        return read_ns - round(length * self._byte_ns)

    def _timed(self, record: Record) -> TimedRecord:
        end = record.start + len(record.data)
        while self._reads[0].end <= record.start:
            self._reads.popleft()
        start_ns = self._wire_ns(self._reads[0].time_ns, self._reads[0].end - record.start)
        last_ns = self._reads[0].time_ns
        for read in self._reads:
            start_ns = min(start_ns, self._wire_ns(read.time_ns, read.end - record.start))
            last_ns = read.time_ns
            if read.end >= end:
                break
        start_ns = min(max(start_ns, self._free_ns), self._reads[0].time_ns)
        self._free_ns = min(start_ns + round(len(record.data) * self._byte_ns), last_ns)
        while self._reads and self._reads[0].end <= end:
            self._reads.popleft()
        return TimedRecord(start_ns, record)
