# SPDX-License-Identifier: GPL-2.0-or-later
"""One pseudo-terminal that others open as if it were a serial port.

What is sent while nobody has it open is gone, as on a wire: whoever opens it hears the present, not a backlog.
What a listener is too slow to read is lost to that listener; sending never waits.
"""

from __future__ import annotations

import contextlib
import errno
import os
import select
import termios
import tty
from typing import TYPE_CHECKING

from dalytools.problem import Problem

if TYPE_CHECKING:
    from pathlib import Path

_READ_SIZE = 4096


class Terminal:
    """A pseudo-terminal in raw mode. ``path`` is what others open: its device, or the stable link to it."""

    def __init__(self, link: Path | None = None) -> None:
        """Make the pseudo-terminal, and the link where one is wanted. Raises Problem."""
        self._link = link
        self._linked = ""
        self.fd = -1
        self._listened = False
        self._open()

    def _open(self) -> None:
        try:
            self.fd, peer = os.openpty()
        except OSError as error:
            raise Problem(f"no pseudo-terminal to be had ({error.strerror}): is /dev/pts mounted?") from error
        os.set_blocking(self.fd, False)
        tty.setraw(peer)
        self._device = os.ttyname(peer)
        os.close(peer)  # from now on poll() says "hung up" whenever nobody listens
        self._poll = select.poll()
        self._poll.register(self.fd, 0)
        if self._link is not None:
            self._make_link(self._link)

    def _make_link(self, link: Path) -> None:
        if link.exists() and not link.is_symlink():
            raise Problem(f"{link} exists and is no link: remove it, or choose another folder for --link")
        beside = link.with_name(f".{link.name}.{os.getpid()}")
        try:
            link.parent.mkdir(parents=True, exist_ok=True)
            beside.unlink(missing_ok=True)
            beside.symlink_to(self._device)
            beside.replace(link)
        except OSError as error:
            raise Problem(
                f"cannot make the link {link} ({error.strerror}): choose another folder for --link"
            ) from error
        self._linked = self._device

    @property
    def path(self) -> str:
        """What to open."""
        return self._device if self._link is None else str(self._link)

    def listened(self) -> bool:
        """Whether somebody has it open now."""
        present = not self._poll.poll(0)
        if self._listened and not present:
            self._listened = False
            self._sweep()
        self._listened = present
        return present

    def _sweep(self) -> None:
        """After a listener left: throw away what it did not read, and make the device open for the next one."""
        try:
            peer = os.open(self._device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as error:
            if error.errno == errno.EBUSY:  # it was opened exclusively and left so: only a new device helps
                os.close(self.fd)
                self._open()
            return
        with contextlib.suppress(OSError):
            # What was sent may still be on its way in the kernel: that is dropped from this side, the rest from the
            # listener's; what the listener wrote stays.
            termios.tcflush(self.fd, termios.TCOFLUSH)
            tty.setraw(peer, termios.TCSAFLUSH)
        os.close(peer)

    def send(self, data: bytes) -> None:
        """Put bytes on it; without a listener, or with one that does not read, they are lost."""
        if self.listened():
            with contextlib.suppress(OSError):
                os.write(self.fd, data)

    def received(self) -> bytes:
        """Take what a listener has written since last asked."""
        try:
            return os.read(self.fd, _READ_SIZE)
        except OSError:  # nothing there, or nobody
            return b""

    def close(self) -> None:
        """Hang up and remove the link, if it is still this one's."""
        if self._link is not None:
            with contextlib.suppress(OSError):
                if self._link.is_symlink() and str(self._link.readlink()) == self._linked:
                    self._link.unlink()
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1
