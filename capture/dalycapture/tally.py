# SPDX-License-Identifier: GPL-2.0-or-later
"""What a capture has heard, lost and been told: counts that may be read while it runs, and as JSON at its end."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Final

from dalycapture.kind_counts import KindCounts
from dalyref.kinds import Dialect, Kind

if TYPE_CHECKING:
    from dalycapture.framing import TimedRecord
    from dalycapture.line import Counts

_STEP_BITS: Final = 5  # a bucket for each 32nd of an octave: 3 % at most
_LEAST_NS: Final = 1000
MOST_GAPS: Final = 1000  # that are kept one by one
LAST_BOARD: Final = 16


class End(StrEnum):
    """Why a capture ended."""

    STOPPED = "stopped"
    DURATION = "duration reached"
    PACKETS = "number of packets reached"
    FILESIZE = "file size reached"
    FILES = "number of files reached"
    PORT_LOST = "port lost"
    READER_GONE = "reader of the pipe went away"


class Spread:
    """How some times are spread: quantiles to 3 %, in memory that does not grow."""

    def __init__(self) -> None:
        self.largest_ns = 0
        self.count = 0
        self._buckets: Counter[int] = Counter()

    def add(self, ns: int) -> None:
        """Take one."""
        self.count += 1
        self.largest_ns = max(self.largest_ns, ns)
        ns = max(ns, _LEAST_NS)
        coarse = ns.bit_length() - _STEP_BITS - 1
        self._buckets[(coarse << _STEP_BITS + 1) + (ns >> coarse)] += 1

    def quantile_ms(self, share: float) -> float:
        """Return the time that this share of them does not exceed, in ms; 0 where there was none."""
        left = share * self.count
        for bucket, count in sorted(self._buckets.items()):
            left -= count
            if left <= 0:
                coarse, fine = divmod(bucket, 1 << _STEP_BITS + 1)
                return min((fine + 1) << coarse, self.largest_ns) / 1e6
        return 0.0


@dataclass(slots=True)
class SideTally:
    """What one tapped side has heard."""

    name: str = ""
    bytes: int = 0
    records: int = 0
    kinds: KindCounts = field(default_factory=KindCounts)
    boards: set[int] = field(default_factory=set[int])  # that answered in the A5 dialect
    marked: int = 0  # bytes marked as received with an error
    breaks: int = 0
    counts: Counts | None = None  # what the driver has counted since the capture began; None: it does not count
    away: bool = False  # the port is waited for
    gaps_s: list[float] = field(default_factory=list[float])  # the port was away for so long
    gaps: int = 0
    bounds: Spread = field(default_factory=Spread)  # of the records' times
    contradictory: int = 0  # records whose reads contradict each other

    @property
    def lost(self) -> int:
        """Bytes that the UART or the kernel lost, at least."""
        return self.counts.lost if self.counts else 0

    def add(self, timed: TimedRecord) -> None:
        """Count a record."""
        record = timed.record
        self.records += 1
        self.kinds[record.kind] += 1
        self.bounds.add(timed.bound_ns)
        if not timed.consistent:
            self.contradictory += 1
        if record.kind is Kind.FRAME and record.dialect is Dialect.A5 and 1 <= record.data[1] <= LAST_BOARD:
            self.boards.add(record.data[1])

    def gap(self, seconds: float) -> None:
        """Count a time without the port."""
        self.gaps += 1
        if len(self.gaps_s) < MOST_GAPS:
            self.gaps_s.append(seconds)

    def as_json(self) -> dict[str, Any]:
        """Lay out for --stats; times in ms, gaps in s."""
        return {
            "port": self.name,
            "bytes": self.bytes,
            "records": self.records,
            "kinds": {str(kind): number for kind, number in sorted(self.kinds.items())},
            "line_errors": {
                "marked_bytes": self.marked,
                "breaks": self.breaks,
                "counters": None if self.counts is None else self.counts._asdict(),
            },
            "bytes_lost_before_us": self.lost if self.counts else None,
            "gaps": {
                "count": self.gaps,
                "seconds": [round(gap, 3) for gap in self.gaps_s],
                "away_at_the_end": self.away,
            },
            "time_bound_ms": {
                "p50": round(self.bounds.quantile_ms(0.5), 3),
                "p99": round(self.bounds.quantile_ms(0.99), 3),
                "max": round(self.bounds.largest_ns / 1e6, 3),
                "contradictory_records": self.contradictory,
            },
        }


@dataclass(slots=True)
class Tally:
    """What a capture has heard so far."""

    seconds: float = 0.0
    end: End = End.STOPPED
    problem: str = ""  # one line, when the port was lost
    notes: list[str] = field(default_factory=list[str])  # pipes that broke or fell behind
    events: int = 0
    marks: int = 0  # the user's
    clock_steps: int = 0
    written: int = 0  # bytes, to the first output
    unwritten: int = 0  # records that an output did not take
    sides: list[SideTally] = field(default_factory=list[SideTally])

    @property
    def bytes(self) -> int:
        """Bytes heard."""
        return sum(side.bytes for side in self.sides)

    @property
    def records(self) -> int:
        """Records that were written."""
        return sum(side.records for side in self.sides)

    @property
    def kinds(self) -> KindCounts:
        """Records of each kind."""
        kinds = KindCounts()
        for side in self.sides:
            kinds.update(side.kinds)
        return kinds

    @property
    def boards(self) -> set[int]:
        """Boards that answered in the A5 dialect."""
        return set[int]().union(*(side.boards for side in self.sides))

    @property
    def good(self) -> int:
        """Frames with right checksum."""
        return self.kinds.good

    @property
    def bad(self) -> int:
        """Records that are damaged Daly frames, whole or cut off."""
        return self.kinds.bad

    @property
    def junk(self) -> int:
        """Records that are no Daly frame at all."""
        return self.kinds.junk

    @property
    def lost(self) -> int:
        """Records that no file has, and bytes that were lost before us."""
        return self.unwritten + sum(side.lost for side in self.sides)

    def as_json(self) -> dict[str, Any]:
        """Lay out for --stats."""
        return {
            "seconds": round(self.seconds, 3),
            "ended": str(self.end),
            "bytes": self.bytes,
            "records": self.records,
            "kinds": {str(kind): number for kind, number in sorted(self.kinds.items())},
            "boards": sorted(self.boards),
            "events": self.events,
            "marks": self.marks,
            "clock_steps": self.clock_steps,
            "file_bytes": self.written,
            "records_unwritten": self.unwritten,
            "notes": self.notes,
            "sides": [side.as_json() for side in self.sides],
        }
