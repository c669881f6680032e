# SPDX-License-Identifier: GPL-2.0-or-later
"""When a record began on the wire: an estimate, and by how much it may be wrong at most.

A byte takes c = bits / baud, and a record is sent without a pause. Every read says two things about each of its bytes::

    wire    ...|<-------- record, n bytes, from T -------->|<- behind ->|
    reads           ^ read 1: its bytes had ended by then        ^ read 2
                      (T <= time - bytes so far * c)
                    and the first byte of read 2 ended after the adapter had sent off read 1, and no longer before
                    read 2 than the adapter holds bytes back (T >= that - bytes so far * c)

All of them speak of the same T, so T lies where they overlap. A record that is split between two reads is pinned to one
byte time, however long the adapter holds bytes back; one that is not, by having fitted between two of them. This is the
interval intersection of the capture notes (section 2).

What is taken for granted: the sender does not pause within a record, the adapter holds nothing back longer than its
latency, no UART clock is off by more than 1 %. A latency that was assumed is corrected upwards when more bytes come at
once than it allows. Where the reads contradict each other something was not so: it is counted, and only what the first
byte says is used.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from dalycapture.port import Latency

CLOCK_TOLERANCE: Final = 0.01  # of a UART's bit clock
FASTEST: Final = 1 - CLOCK_TOLERANCE
MOST_LEARNED_NS: Final = 50_000_000
HALF_BIT: Final = 0.05  # of a byte: a UART hands a byte over in the middle of its stop bit
USUAL_NS: Final = 50_000  # from a byte in the kernel to our clock: 30 us on a busy processor, 130 on one that slept


class Estimate(NamedTuple):
    """A start in ns; the truth is within ``bound_ns`` of it; or not, where the reads contradict each other."""

    start_ns: int
    bound_ns: int
    consistent: bool


@dataclass(slots=True)
class _Read:
    """One read: its bytes begin and end at these offsets of the stream; it returned at time_ns.

    usual_ns: its bytes had come so long before, usually. floor_ns: its first byte did not end before. mail_ns: nor did
    the first byte of the next read end before this.
    """

    begin: int
    end: int
    time_ns: int
    usual_ns: int
    floor_ns: int
    mail_ns: int


class Timing:
    """The reads of one stream, as far as they carry bytes of records that are still to come."""

    def __init__(self, byte_ns: float, latency: Latency | None = None) -> None:
        self._byte_ns = byte_ns
        self._reads: deque[_Read] = deque()
        self._end = 0  # of the stream so far
        self._mail_ns = 0
        self._free_ns = 0  # the record before had ended by then
        self._free_floor_ns = 0  # and not before this
        self._set_latency(latency)

    def _set_latency(self, latency: Latency | None) -> None:
        """Take an adapter's habits from now on; None: bytes come at once."""
        self._hold_ns = round(latency.hold_ms * 1e6) if latency else 0
        self._way_ns = round(latency.way_ms * 1e6) if latency else 0
        self._told_ns = self._hold_ns + self._way_ns
        self._learns = latency is not None and latency.learns

    def opened(self, now_ns: int, latency: Latency | None) -> None:
        """Note that the port was opened again now, perhaps as another adapter: nothing that comes began before."""
        self._set_latency(latency)
        self._free_ns = self._mail_ns = now_ns
        self._free_floor_ns = now_ns - self.delay_ns

    @property
    def delay_ns(self) -> int:
        """For how long a byte may be on its way to us."""
        return self._hold_ns + self._way_ns

    @property
    def last_ns(self) -> int | None:
        """When the newest read returned; None where no bytes wait."""
        return self._reads[-1].time_ns if self._reads else None

    @property
    def floor_ns(self) -> int | None:
        """The oldest byte that waits did not begin before this; None where none waits."""
        return self._reads[0].floor_ns - round(2 * self._byte_ns) if self._reads else None

    def begin_ns(self, read_ns: int, length: int) -> int:
        """When ``length`` bytes began, the last of which had ended at read_ns."""
        return read_ns - round(length * self._byte_ns)

    def add(self, length: int, read_ns: int, late_ns: int, *, more: bool = False) -> None:
        """Take a read. late_ns: for how long its bytes may have lain here unread; more: it left some behind."""
        if self._learns and not more:  # so many bytes take their time on the wire, and came at once
            seen_ns = round((length - 1) * self._byte_ns) - late_ns
            if self._hold_ns < seen_ns:
                self._hold_ns = min(seen_ns, MOST_LEARNED_NS)
        floor = max(read_ns - self._hold_ns - self._way_ns - late_ns, self._mail_ns)
        if not more:  # else the next read brings what had come by now: nothing is known of its first byte but this
            self._mail_ns = read_ns - self._way_ns - late_ns
        usual = min(late_ns, USUAL_NS)
        self._reads.append(_Read(self._end, self._end + length, read_ns, usual, floor, self._mail_ns))
        self._end += length

    def so_far(self) -> tuple[int, int]:
        """Bounds of the start of the oldest waiting byte, lowest and highest. Only where one waits."""
        first = self._reads[0]
        highest = min(self.begin_ns(read.time_ns, read.end - first.begin) for read in self._reads)
        lowest = max(self.begin_ns(read.floor_ns, read.begin - first.begin + 1) for read in self._reads)
        return lowest, highest

    def estimate(self, start: int, length: int) -> Estimate:
        """Estimate when the record of these bytes began. Records are asked for in order."""
        reads, c = self._reads, self._byte_ns
        end = start + length
        while reads[0].end <= start:
            reads.popleft()
        first = reads[0]
        zero = last_ns = first.time_ns  # all below is relative to it: floating point has no room for 1970
        high = highest = inf
        low = lowest = -inf
        # Written out, for this is done for every record: a call of min or max costs as much as all else in its line.
        for read in reads:
            if read.begin >= end:
                break
            last_ns = read.time_ns
            span = (read.end - start) * c
            if (ended := last_ns - read.usual_ns - zero - span) < high:
                high = ended
            if (ended := last_ns - zero - span * FASTEST) < highest:
                highest = ended
            span = (read.begin - start + 1) * c
            began = read.floor_ns - zero - span
            low = max(low, began)
            if (began := began - abs(span) * CLOCK_TOLERANCE) > lowest:
                lowest = began
        highest += HALF_BIT * c
        if (free := self._free_floor_ns - zero) > lowest:
            lowest = free
        consistent = lowest <= highest
        if not consistent:  # the sender paused, or the adapter holds bytes back longer than it says
            if self._learns and not self._told_ns:  # a pseudo-terminal, whose writer was late himself
                self._hold_ns = min(self._hold_ns + round(lowest - highest), MOST_LEARNED_NS)
            low = lowest = first.floor_ns - zero - (first.begin - start + 1) * c
            if lowest > highest:  # it did hold this byte back longer, by so much at least
                lowest = highest - (lowest - highest) - self.delay_ns
        if (spread := high - low) > self._told_ns:
            spread = self._told_ns
        best = round(high - spread / 2 if spread > 0 else high)
        if best < (free := self._free_ns - zero):
            best = free
        best = min(best, 0)
        bound = highest - best
        bound = max(bound, best - lowest)
        span = length * c
        free = zero + best + round(span)
        self._free_ns = free if free < last_ns else last_ns
        free = zero + round(lowest + span * FASTEST)
        self._free_floor_ns = free if free < last_ns else last_ns
        while reads and reads[0].end <= end:
            reads.popleft()
        return Estimate(zero + best, round(bound) if bound > 0 else 0, consistent)
