# SPDX-License-Identifier: GPL-2.0-or-later
"""The toolbar that Wireshark shows while our capture runs, over its two control pipes (only the window has them).

A message, both ways (extcap(4))::

    0      1                4         5         6
    | 'T'  | length, 3 bytes, big-endian | control | command | payload ...     length = payload + 2

Commands: 0 Wireshark is ready; 1 set, 2 add text to a control; 6 text in the status bar; 8 warn.
"""

from __future__ import annotations

import contextlib
import os
import threading
from typing import TYPE_CHECKING, Final

from dalycapture.extcap_names import HEARD, LOG, MARK, MARK_TEXT

if TYPE_CHECKING:
    from collections.abc import Callable

_READY, _SET, _ADD, _STATUS, _WARN = 0, 1, 2, 6, 8
_HEAD: Final = 6
_MOST: Final = 32768  # bytes of a payload
_MOST_WAITING: Final = 1 << 16


def message(control: int, command: int, text: str) -> bytes:
    """Lay out a message to Wireshark."""
    payload = text.encode("utf-8", "replace")[:_MOST]
    return b"T" + (len(payload) + 2).to_bytes(3, "big") + bytes((control, command)) + payload


class Toolbar:
    """Tells Wireshark what happens, and hears the user's marks. Nothing here waits for Wireshark, or fails with it.

    outward, inward: paths of the control pipes; empty: there are none, and all is silence. on_mark: called with the
    text of a mark, in a thread of this class's own.
    """

    def __init__(self, outward: str, inward: str, on_mark: Callable[[str], None]) -> None:
        self._on_mark = on_mark
        self._text = ""
        self._waiting = bytearray()
        self._lock = threading.Lock()
        self._out = -1
        # In this order, as Wireshark opens them: to us first.
        if inward:
            threading.Thread(target=self._hear, args=(inward,), name="toolbar", daemon=True).start()
        if outward:
            with contextlib.suppress(OSError):
                self._out = os.open(outward, os.O_RDWR | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))

    def log(self, text: str) -> None:
        """Add a line to the log window."""
        self._send(message(LOG, _ADD, f"{text}\n"))

    def heard(self, text: str) -> None:
        """Show the counters."""
        self._send(message(HEARD, _SET, text))

    def status(self, text: str) -> None:
        """Show a line in the status bar."""
        self._send(message(LOG, _STATUS, text))

    def warn(self, text: str) -> None:
        """Show a window with a warning."""
        self._send(message(LOG, _WARN, text))

    def _send(self, data: bytes) -> None:
        with self._lock:
            if self._out < 0 or len(self._waiting) + len(data) > _MOST_WAITING:
                return
            self._waiting += data
            try:
                while self._waiting:
                    del self._waiting[: os.write(self._out, self._waiting)]
            except BlockingIOError:
                pass
            except OSError:
                os.close(self._out)
                self._out = -1

    def _hear(self, path: str) -> None:
        with contextlib.suppress(OSError), open(path, "rb", buffering=0) as pipe:  # noqa: PTH123 - a pipe of Wireshark's
            while head := _exactly(pipe.read, _HEAD):
                size = int.from_bytes(head[1:4], "big") - 2
                if head[:1] != b"T" or not 0 <= size <= _MOST:
                    return
                payload = _exactly(pipe.read, size)
                self._on_message(head[4], head[5], payload.decode("utf-8", "replace"))

    def _on_message(self, control: int, command: int, text: str) -> None:
        if control == MARK_TEXT and command == _SET:
            self._text = text
        elif control == MARK and command == _SET:
            self._on_mark(self._text)


def _exactly(read: Callable[[int], bytes | None], size: int) -> bytes:
    data = b""
    while len(data) < size and (piece := read(size - len(data))):
        data += piece
    return data if len(data) == size else b""
