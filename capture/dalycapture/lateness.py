# SPDX-License-Identifier: GPL-2.0-or-later
"""How late we may have been to fetch bytes that were there: busy, not given a processor, or stopped.

The kernel counts how long this thread was ready and had to wait for a processor (``/proc/thread-self/schedstat``, the
second number, ns); reading it costs a microsecond. Where it is not there, a constant stands for it.
"""

from __future__ import annotations

import os
import time
from typing import Final

HANDLING_NS: Final = 300_000  # from a byte in the kernel to our clock, on a machine that is not busy
UNKNOWN_NS: Final = 2_000_000  # for waiting for a processor, where the kernel does not count it
OVERSLEPT_NS: Final = 50_000_000


class Lateness:
    """Of one thread that waits for bytes. Used in that thread alone."""

    def __init__(self) -> None:
        try:
            self._fd = os.open("/proc/thread-self/schedstat", os.O_RDONLY | getattr(os, "O_CLOEXEC", 0))
        except OSError:
            self._fd = -1
        self._delayed_ns = self._run_delay()
        self._woken_ns = time.monotonic_ns()
        self.stopped = False  # set by whoever learns that we were stopped (SIGCONT)

    def _run_delay(self) -> int:
        if self._fd < 0:
            return 0
        return int(os.pread(self._fd, 64, 0).split()[1])

    def woken(self, waited_from_ns: int, timeout_ns: int) -> tuple[int, int]:
        """Note that a wait ended: (now, for how long bytes may have lain unread), in ns.

        waited_from_ns: when it began; what was done between the wait before and this one counts as lateness.
        """
        now = time.monotonic_ns()
        if self._fd < 0:
            late = HANDLING_NS + UNKNOWN_NS
        else:
            delayed = self._run_delay()
            late = HANDLING_NS + delayed - self._delayed_ns
            self._delayed_ns = delayed
        late += waited_from_ns - self._woken_ns
        if self.stopped or now - waited_from_ns > timeout_ns + OVERSLEPT_NS:
            late += now - waited_from_ns
            self.stopped = False
        self._woken_ns = now
        return now, late

    def close(self) -> None:
        """Let the kernel's table go."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1
