# SPDX-License-Identifier: GPL-2.0-or-later
"""Keys while a capture runs: ``m`` or Enter puts a mark into the file. Only where a person sits at the terminal."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import sys
import threading
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

_MARK = frozenset("mM\r\n")
_KEY = re.compile(rb"\x1b[\[O][0-9;]*[A-Za-z~]|[\x00-\xff]", re.DOTALL)
_NAMES = {b"\x1b[C": "right", b"\x1bOC": "right", b"\x1b[D": "left", b"\x1bOD": "left", b"\x1bOM": "\r"}


class Keys:
    """Reads the terminal's keys while the block runs; the terminal is as before afterwards.

    mark: called, in a thread of this class's own, for each key that marks. pressed: called with each other one: a
    character, ``left`` or ``right``; Ctrl-Z then does nothing, as there is a screen that would stay behind. Without a
    terminal nothing happens. A capture that was sent to the background is not stopped for its keys.
    """

    def __init__(self, mark: Callable[[], None], pressed: Callable[[str], None] | None = None) -> None:
        self._mark = mark
        self._pressed = pressed
        self._fd = -1
        self._before: list[Any] = []
        self._handlers: dict[signal.Signals, Any] = {}
        self._ending = threading.Event()
        self._waker = -1, -1

    @property
    def there(self) -> bool:
        """Whether keys are read."""
        return self._fd >= 0

    def __enter__(self) -> Self:
        if os.name != "posix" or not sys.stdin or not sys.stdin.isatty():
            return self
        import termios
        import tty

        fd = sys.stdin.fileno()
        with contextlib.suppress(OSError, termios.error):
            if os.tcgetpgrp(fd) != os.getpgrp():
                return self
            self._before = termios.tcgetattr(fd)
            for number in (signal.SIGTTIN, signal.SIGTTOU):
                self._handlers[number] = signal.signal(number, signal.SIG_IGN)
            tty.setcbreak(fd, termios.TCSANOW)
            if self._pressed:
                mode = termios.tcgetattr(fd)
                mode[6][termios.VSUSP] = os.fpathconf(fd, "PC_VDISABLE").to_bytes()
                termios.tcsetattr(fd, termios.TCSANOW, mode)
            self._fd = fd
            self._waker = os.pipe()
            threading.Thread(target=self._read, name="keys", daemon=True).start()
        return self

    def _read(self) -> None:
        import select

        poll = select.poll()
        poll.register(self._fd, select.POLLIN)
        poll.register(self._waker[0], select.POLLIN)
        while not self._ending.is_set():
            poll.poll()
            if self._ending.is_set():
                return
            try:
                keys = os.read(self._fd, 64)
            except OSError:  # in the background: the keys are somebody else's now
                self._ending.wait(1)
                continue
            if not keys:  # the terminal is gone
                return
            for found in _KEY.findall(keys):
                key = _NAMES.get(found) or found.decode("latin-1")
                if key in _MARK:
                    self._mark()
                elif self._pressed:
                    self._pressed(key)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._fd < 0:
            return
        import termios

        self._ending.set()
        os.write(self._waker[1], b"!")
        with contextlib.suppress(OSError, termios.error):
            if os.tcgetpgrp(self._fd) == os.getpgrp():
                termios.tcsetattr(self._fd, termios.TCSANOW, self._before)
        for number, handler in self._handlers.items():
            signal.signal(number, handler)
