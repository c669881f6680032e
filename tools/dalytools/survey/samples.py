# SPDX-License-Identifier: GPL-2.0-or-later
"""Some payloads of a long series, in bounded memory: runs of successive ones, spread evenly over the capture.

    payloads  ################################################################     short: all
              ####....####....####....####....####....####....####....####....     longer: every second run ...
              '--'  a run: what follows what is kept, so a lag of some polls can still be seen

With each payload goes what was known of the battery at that moment.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from typing import Final

RUN: Final = 64
MOST_RUNS: Final = 16


@dataclass(slots=True)
class Run:
    """Successive payloads."""

    times: array[int] = field(default_factory=lambda: array("q"))
    """ns since 1970 UTC."""
    data: bytearray = field(default_factory=bytearray)
    """One payload behind the other."""
    known: array[float] = field(default_factory=lambda: array("d"))
    """``known.COUNT`` values a payload."""

    def extend(self, other: Run) -> None:
        """Add a run that followed this one at once."""
        self.times.extend(other.times)
        self.data += other.data
        self.known.extend(other.known)


class Samples:
    """Takes payload after payload."""

    __slots__ = ("_now", "_runs", "_skip", "_stride")

    def __init__(self) -> None:
        self._runs: list[Run] = []
        self._now = Run()
        self._stride = 1
        self._skip = 0

    def add(self, time_ns: int, data: bytes, known: array[float]) -> None:
        """Take the next payload, and what is known when it comes."""
        if self._skip:
            self._skip -= 1
            return
        now = self._now
        now.times.append(time_ns)
        now.data += data
        now.known.extend(known)
        if len(now.times) < RUN:
            return
        self._runs.append(now)
        self._now = Run()
        if len(self._runs) >= MOST_RUNS:
            self._runs = self._runs[::2]
            self._stride *= 2
        self._skip = (self._stride - 1) * RUN

    def runs(self) -> list[Run]:
        """Return the runs that were kept; one, where nothing was left out."""
        runs = [*self._runs, self._now] if self._now.times else list(self._runs)
        if self._stride > 1 or len(runs) < 2:
            return runs
        whole = Run()
        for run in runs:
            whole.extend(run)
        return [whole]
