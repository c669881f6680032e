# SPDX-License-Identifier: GPL-2.0-or-later
"""Bytes as they were read become records with the time at which each began on the wire.

What a record is, dalyref.records decides, by content; when it began, dalycapture.timing. Here the two meet.

Quiet of 250 ms closes what is incomplete (docs/records.md, 1). Whoever reads the port calls ``flush`` when its timer
says so; ``feed`` sees it too when the next bytes come after such a pause.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dalycapture.timing import Timing
from dalyref.records import Splitter

if TYPE_CHECKING:
    from dalycapture.port import Latency
    from dalyref.records import Record

BITS_PER_BYTE: Final = 10  # 8N1: start, eight data, stop
SILENCE_NS: Final = 250_000_000
A5_START: Final = 0xA5
A5_SIZE: Final = 13
KNOWN_NS: Final = 1_000_000  # a start that is known so well gets no better by watching every byte;
KNOWN_BYTES: Final = 2  # nor so well, in byte times: two reads pin it to one, and those that follow do no more


@dataclass(slots=True)
class TimedRecord:
    """A record, and when its first byte began on the wire, in ns: on the clock of the reads it was fed with.

    The sniffer hands records on with nanoseconds since 1970 (UTC). bound_ns: the truth lies within so much of it.
    consistent: the reads agreed; else the bound is a guess. side: which tapped side, from 0.

    Not to be changed; frozen, it would cost four times as much to make.
    """

    time_ns: int
    record: Record
    bound_ns: int = 0
    consistent: bool = True
    side: int = 0


class Framer:
    """One stream of bytes, one tapped side.

    baud: bits per second, of the wire (not of the adapter's cable); silence_ns: quiet that closes what is incomplete;
    bits_per_byte: by the character format; latency: for how long the adapter holds bytes back (None: not at all); side:
    what its records say in ``side``.
    """

    def __init__(
        self,
        baud: int = 9600,
        silence_ns: int = SILENCE_NS,
        *,
        bits_per_byte: int = BITS_PER_BYTE,
        latency: Latency | None = None,
        side: int = 0,
    ) -> None:
        self.side = side
        self._splitter = Splitter()
        self._ahead = b""  # not yet shown to the splitter
        self._byte_ns = bits_per_byte * 1_000_000_000 / baud
        self._silence_ns = silence_ns
        self._known_ns = max(KNOWN_NS, round(KNOWN_BYTES * self._byte_ns))
        self.timing = Timing(self._byte_ns, latency)

    @property
    def pending(self) -> bool:
        """True while bytes are held back: call ``flush`` after quiet."""
        return self.timing.last_ns is not None

    def feed(self, data: bytes, read_ns: int, late_ns: int = 0, *, more: bool = False) -> list[TimedRecord]:
        """Take the bytes of one read, which returned at read_ns; the records that are complete now.

        late_ns, more: as in Timing.add.
        """
        timed: list[TimedRecord] = []
        timing = self.timing
        if (last_ns := timing.last_ns) and timing.begin_ns(read_ns, len(data)) > last_ns + self._silence_ns:
            timed = self.flush()
        if not data:
            return timed
        timing.add(len(data), read_ns, late_ns, more=more)
        # A byte a read is what a UART gives. A frame of 13 that has just begun needs no look before it can be whole:
        # how the bytes are cut into pieces makes no difference to the records.
        self._ahead += data
        if self._ahead[0] == A5_START and len(self._ahead) < A5_SIZE and not self._splitter.pending:
            return timed
        ahead, self._ahead = self._ahead, b""
        return timed + [self._timed(record) for record in self._splitter.feed(ahead)]

    def event(self) -> list[TimedRecord]:
        """Note that an event lies here: junk ends at it (docs/records.md, 4). The records that are complete by it."""
        ahead, self._ahead = self._ahead, b""
        records = [self._timed(record) for record in self._splitter.feed(ahead)] if ahead else []
        self._splitter.event()
        return records

    def flush(self) -> list[TimedRecord]:
        """Close what is incomplete: the bus is quiet, or the capture ends."""
        ahead, self._ahead = self._ahead, b""
        return [self._timed(record) for record in self._splitter.feed(ahead) + self._splitter.flush()]

    def rest_until_ns(self) -> int:
        """Tell until when nothing is gained by looking at the port: a frame is on its way, its start is known.

        0: look. A byte a read wakes a computer 960 times a second, for nothing.
        """
        if not self._ahead or self._ahead[0] != A5_START or self._splitter.pending:
            return 0
        lowest, highest = self.timing.so_far()
        if not 0 <= highest - lowest <= self._known_ns:
            return 0
        return highest + round((A5_SIZE - 1) * self._byte_ns)

    def _timed(self, record: Record) -> TimedRecord:
        start_ns, bound_ns, consistent = self.timing.estimate(record.start, len(record.data))
        return TimedRecord(start_ns, record, bound_ns, consistent, self.side)
