# SPDX-License-Identifier: GPL-2.0-or-later
"""Wait for several descriptors at once: ``poll`` where there is one (it takes any descriptor), else ``select``.

At 9600 baud a byte comes every millisecond and each wakes us, so this is kept thin.
"""

from __future__ import annotations

import select


class Waiter:
    """Descriptors to wait for. Errors and hang-ups are always waited for (``poll`` only)."""

    def __init__(self) -> None:
        self._masks: dict[int, int] = {}
        self._poll = select.poll() if hasattr(select, "poll") else None

    def watch(self, fd: int, *, read: bool = False, write: bool = False) -> None:
        """Wait for this descriptor from now on: to be readable, writable, or (neither) broken."""
        mask = read | write << 1
        if self._masks.get(fd) == mask:
            return
        self._masks[fd] = mask
        if self._poll:
            self._poll.register(fd, (select.POLLIN if read else 0) | (select.POLLOUT if write else 0))

    def forget(self, fd: int) -> None:
        """Wait for it no longer."""
        if self._masks.pop(fd, None) is not None and self._poll:
            self._poll.unregister(fd)

    def wait(self, timeout: float | None) -> list[int]:
        """Wait up to timeout seconds (None: for ever); the descriptors that are ready, or broken."""
        if self._poll:
            return [fd for fd, _ in self._poll.poll(None if timeout is None else max(0.0, timeout) * 1000)]
        reading = [fd for fd, mask in self._masks.items() if mask & 1]
        writing = [fd for fd, mask in self._masks.items() if mask & 2]
        readable, writable, _ = select.select(reading, writing, [], timeout)
        return readable + writable
