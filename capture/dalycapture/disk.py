# SPDX-License-Identifier: GPL-2.0-or-later
"""What is slow about a disk, in a thread of its own: the listener never waits for it.

    write --dirty--> thread: once a second, and at once after an event, fdatasync
    close ---------> thread: fdatasync, close, then what belongs to a closed file (its checksum, its name told)

A write has reached the kernel when it returns, so a kill of the program loses nothing. What the disk does later is for
the case that the whole machine dies: then at most the last second is missing.
"""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

SYNC_S: Final = 1.0

_NOTHING_TO_SYNC: Final = frozenset((errno.EINVAL, errno.EROFS, errno.ENOTSUP))  # not that kind of file


class DiskThread:
    """Looks after one open file. ``problem`` is what the disk refused after it had seemed to take it.

    every_s: seconds between two syncs while something was written, 0: never. at_end: called after the file was closed.
    """

    def __init__(self, fd: int, path: Path | None, every_s: float, at_end: Callable[[], None]) -> None:
        self.problem: OSError | None = None
        self._fd = fd
        self._path = path
        self._every_s = every_s
        self._at_end = at_end
        self._dirty = False
        self._wanted = threading.Event()  # there is something to sync
        self._now = threading.Event()  # and it does not wait for the second
        self._ending = False
        self._thread: threading.Thread | None = None

    def dirty(self) -> None:
        """Something was written."""
        if self._dirty:
            return
        self._dirty = True
        if self._every_s:
            self._start()
            self._wanted.set()

    def sync_soon(self) -> None:
        """Have what was written on the disk as soon as the disk can."""
        if self._every_s:
            self.dirty()
            self._now.set()

    def end(self) -> None:
        """Close the file; ``join`` waits for it. Nothing may be written after."""
        self._ending = True
        self._start()
        self._now.set()
        self._wanted.set()

    def join(self) -> None:
        """Wait until the file is closed and all is told."""
        if self._thread:
            self._thread.join()

    def _start(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name="disk", daemon=True)
            self._thread.start()

    def _work(self) -> None:
        if self._every_s and self._path:
            _sync_folder(self._path)
        while not self._ending:
            self._wanted.wait()
            self._now.wait(self._every_s or None)
            self._wanted.clear()
            self._now.clear()
            self._sync()
        self._sync()
        try:
            os.close(self._fd)
        except OSError as error:
            self.problem = self.problem or error
        self._at_end()

    def _sync(self) -> None:
        if not self._dirty or not self._every_s:
            return
        self._dirty = False  # before: what is written meanwhile is for the next time
        try:
            getattr(os, "fdatasync", os.fsync)(self._fd)
        except OSError as error:
            if error.errno not in _NOTHING_TO_SYNC:
                self.problem = self.problem or error


def _sync_folder(path: Path) -> None:
    """Make the name of a new file last."""
    with contextlib.suppress(OSError):  # Windows opens no folders
        fd = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(fd)
        finally:
            os.close(fd)
