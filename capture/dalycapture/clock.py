# SPDX-License-Identifier: GPL-2.0-or-later
"""Two clocks: all is measured on the monotonic one, which never jumps; files have the time of day.

What lies between them is looked at once a second. It changes when somebody sets the clock, when a computer without a
battery learns the time from the network, and when the computer slept. The sniffer tells each change as an event, and
takes it over where no record is under way.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable

LEAST_STEP_NS: Final = 1_000_000  # less can not be told from a computer that is busy between two looks at the clock


class Step(NamedTuple):
    """The wall clock went forward (or back) by so many ns; of these the computer slept so many."""

    ns: int
    slept_ns: int

    def __str__(self) -> str:
        if self.slept_ns > LEAST_STEP_NS and abs(self.ns - self.slept_ns) < max(LEAST_STEP_NS, self.slept_ns // 10):
            return f"the computer slept for {self.slept_ns / 1e9:.3f} s"
        way = "forward" if self.ns > 0 else "back"
        return f"clock step: the wall clock was set {way} by {abs(self.ns) / 1e9:.3f} s; times before it are as it was"


def _asleep_ns() -> int:
    """How long the computer has slept since it was started, in ns and a constant; 0 where the system can't tell."""
    boot = getattr(time, "CLOCK_BOOTTIME", None)
    return 0 if boot is None else time.clock_gettime_ns(boot) - time.monotonic_ns()


class WallClock:
    """Turns monotonic nanoseconds into those since 1970 (UTC)."""

    def __init__(
        self,
        wall: Callable[[], int] = time.time_ns,
        monotonic: Callable[[], int] = time.monotonic_ns,
        asleep: Callable[[], int] = _asleep_ns,
    ) -> None:
        self._wall, self._monotonic, self._asleep = wall, monotonic, asleep
        self.offset_ns, _ = self._measure()
        self._next_ns = self.offset_ns
        self._slept_ns = asleep()

    def _measure(self) -> tuple[int, int]:
        """Measure the difference of the clocks: (ns, how far it may be off)."""
        best = (0, 1 << 62)
        for _ in range(3):
            before = self._monotonic()
            wall = self._wall()
            after = self._monotonic()
            if after - before < best[1]:
                best = wall - (before + after) // 2, after - before
        return best

    def step(self) -> Step | None:
        """Look whether the wall clock was set since last asked. ``adopt`` takes it over."""
        offset, doubt = self._measure()
        change = offset - self._next_ns
        if abs(change) <= max(LEAST_STEP_NS, doubt):
            return None
        self._next_ns = offset
        slept = self._asleep()
        step = Step(change, slept - self._slept_ns)
        self._slept_ns = slept
        return step

    @property
    def stepped(self) -> bool:
        """Whether a step was told of and is not taken over yet."""
        return self._next_ns != self.offset_ns

    def adopt(self) -> None:
        """Go by the newest difference from now on."""
        self.offset_ns = self._next_ns

    def time_ns(self, monotonic_ns: int) -> int:
        """Return the time of day at this moment."""
        return monotonic_ns + self.offset_ns
