# SPDX-License-Identifier: GPL-2.0-or-later
"""What only a driver of real hardware answers: error counters, modem lines, latency. One small object, so that tests
can put another in its place (a pseudo-terminal answers none of it).

Reading asks nothing of the bus. ``drop`` is the one call that moves a line, and only a user's wish makes it.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final, NamedTuple, Protocol

ASYNC_LOW_LATENCY: Final = 1 << 13  # linux/tty_flags.h
_TIOCGICOUNT: Final = 0x545D  # asm-generic/ioctls.h; termios does not name it
_COUNTERS = struct.Struct("11i9i")  # struct serial_icounter_struct
_FLAGS_AT: Final = 16  # of struct serial_struct: int type, int line, unsigned port, int irq, int flags
_SERIAL_STRUCT: Final = 128  # bytes; 72 on 64-bit machines


class Counts(NamedTuple):
    """The driver's counters since it was loaded (TIOCGICOUNT): characters and conditions."""

    rx: int = 0
    frame: int = 0  # stop bit missing
    overrun: int = 0  # the UART was not emptied in time: at least one byte lost each
    parity: int = 0
    breaks: int = 0
    buf_overrun: int = 0  # the kernel had no room: bytes lost

    def since(self, before: Counts) -> Counts:
        """Count what came since then. Counters are of 32 bits and may wrap."""
        return Counts(*((now - then) & 0xFFFFFFFF for now, then in zip(self, before, strict=True)))

    @property
    def lost(self) -> int:
        """Least number of bytes that the hardware or the kernel lost."""
        return self.overrun + self.buf_overrun

    def __str__(self) -> str:
        """Name what is not zero, in the kernel's words: ``frame 2, overrun 1``; nothing: empty."""
        names = ("", "framing errors", "overruns", "parity errors", "breaks", "buffer overruns")
        return ", ".join(f"{number} {name}" for number, name in zip(self, names, strict=True) if name and number)


@dataclass(frozen=True, slots=True)
class ModemState:
    """Whether the outputs are raised now."""

    rts: bool
    dtr: bool

    def __str__(self) -> str:
        return f"RTS {'on' if self.rts else 'off'}, DTR {'on' if self.dtr else 'off'}"


class Line(Protocol):
    """What is asked of the driver behind a descriptor."""

    def counts(self, fd: int, /) -> Counts | None:
        """Read the error counters; None: the driver has none."""
        ...

    def modem_state(self, fd: int, /) -> ModemState | None:
        """Read RTS and DTR; None: not known."""
        ...

    def drop(self, fd: int, /) -> bool:
        """Lower RTS and DTR; False: not possible."""
        ...

    def low_latency(self, fd: int, /) -> bool:
        """Ask for bytes at once; False: refused."""
        ...


class KernelLine:
    """The real one: ioctls of Linux. Elsewhere the counters are not known."""

    def counts(self, fd: int) -> Counts | None:
        """Read TIOCGICOUNT."""
        import fcntl
        import sys

        if not sys.platform.startswith("linux"):
            return None
        buffer = bytearray(_COUNTERS.size)
        try:
            fcntl.ioctl(fd, _TIOCGICOUNT, buffer)
        except OSError:
            return None
        _cts, _dsr, _rng, _dcd, rx, _tx, frame, overrun, parity, breaks, full, *_ = _COUNTERS.unpack(buffer)
        return Counts(rx, frame, overrun, parity, breaks, full)

    def modem_state(self, fd: int) -> ModemState | None:
        """Read TIOCMGET; it changes nothing."""
        import fcntl
        import termios

        try:
            bits: int = struct.unpack("i", fcntl.ioctl(fd, termios.TIOCMGET, bytes(4)))[0]
        except OSError:
            return None
        return ModemState(bool(bits & termios.TIOCM_RTS), bool(bits & termios.TIOCM_DTR))

    def drop(self, fd: int) -> bool:
        """Clear RTS and DTR by TIOCMBIC."""
        import fcntl
        import termios

        try:
            fcntl.ioctl(fd, termios.TIOCMBIC, struct.pack("i", termios.TIOCM_RTS | termios.TIOCM_DTR))
        except OSError:
            return False
        return True

    def low_latency(self, fd: int) -> bool:
        """Set ASYNC_LOW_LATENCY by TIOCGSERIAL and TIOCSSERIAL."""
        import fcntl
        import sys
        import termios

        if not sys.platform.startswith("linux"):
            return False
        buffer = bytearray(_SERIAL_STRUCT)
        try:
            fcntl.ioctl(fd, termios.TIOCGSERIAL, buffer)
            flags: int = struct.unpack_from("i", buffer, _FLAGS_AT)[0]
            struct.pack_into("i", buffer, _FLAGS_AT, flags | ASYNC_LOW_LATENCY)
            fcntl.ioctl(fd, termios.TIOCSSERIAL, buffer)
        except OSError:
            return False
        return True
