# SPDX-License-Identifier: GPL-2.0-or-later
"""A serial device of Linux or macOS, opened by hand: read-only, without waiting for a carrier, and then

    flock, TIOCEXCL     nobody else may take our bytes (either alone has holes: root passes TIOCEXCL)
    termios             raw, the asked speed and format, CLOCAL, no HUPCL, at once (TCSANOW); PARMRK where it pays
    TIOCGICOUNT         error counters, read
    TIOCMGET            RTS and DTR, read
    TIOCMBIC            only with ``modem_lines="drop"``: RTS and DTR are lowered, once
    TIOCSSERIAL         only with ``low_latency``

and nothing else: no flush, no other modem-line call, no break, no write. The kernel itself raises DTR and RTS when a
port is opened; no program can stop that. The settings are not put back at the end: with HUPCL back on, closing would
drop the lines.
"""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from dalycapture.adapters import adapter_of, serial_ports
from dalycapture.errors import PortError, reason
from dalycapture.line import Counts, KernelLine, Line
from dalycapture.port import ASSUMED, PROMPT, READ_SIZE, Facts, Port, gone, latency_of

if TYPE_CHECKING:
    from dalycapture.settings import Settings

COMMON_RATES: Final = "1200, 2400, 4800, 19200, 38400, 57600, 115200"


class _Device:
    """A serial device, polled and read directly."""

    def __init__(self, fd: int, name: str, facts: Facts, line: Line) -> None:
        self.name = name
        self.facts = facts
        self._line = line
        self._fd = fd

    def fileno(self) -> int:
        return self._fd

    def read(self) -> bytes | None:
        try:
            data = os.read(self._fd, READ_SIZE)
        except BlockingIOError:
            return None
        except OSError as error:
            raise gone(self.name, "" if error.errno == errno.EIO else reason(error)) from None
        if not data:  # a hung-up line reads as end of file
            raise gone(self.name)
        return data

    def counts(self) -> Counts | None:
        return self._line.counts(self._fd)

    def retune(self, settings: Settings) -> None:
        """Change speed and format; nothing else is touched. Raises PortError."""
        rate = _rate(self.name, settings.baud)
        _make_raw(self._fd, self.name, rate, settings, marked=self.facts.marked)

    def close(self) -> None:
        import fcntl
        import termios

        if self._fd < 0:
            return
        # A pty outlives our closing, and would stay closed to others (a kill leaves it so; real ports forget).
        with contextlib.suppress(OSError):
            fcntl.ioctl(self._fd, termios.TIOCNXCL)
        os.close(self._fd)
        self._fd = -1


def open_device(name: str, settings: Settings, line: Line | None = None) -> Port:
    """Open a device to listen. Raises PortError."""
    rate = _rate(name, settings.baud)
    line = line or KernelLine()
    try:
        mode = Path(name).stat().st_mode
        if not stat.S_ISCHR(mode):
            raise PortError(_not_serial(name, mode))
        fd = os.open(name, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise _not_opened(name, error) from None
    try:
        _claim(fd, name)
        return _Device(fd, name, _set_up(fd, name, rate, settings, line), line)
    except BaseException:
        os.close(fd)
        raise


def _rate(name: str, baud: int) -> int:
    import termios

    rate: int | None = getattr(termios, f"B{baud}", None) if baud > 0 else None
    if rate is None:
        raise PortError(f"{name}: baud rate {baud} is not possible; Daly's is 9600, others are {COMMON_RATES}")
    return rate


def _claim(fd: int, name: str) -> None:
    import fcntl
    import termios

    if not os.isatty(fd):
        raise PortError(f"{name} is not a serial device; {_what_ports()}")
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise PortError(_busy(name)) from None
    except OSError:  # no locks here; TIOCEXCL remains
        pass
    fcntl.ioctl(fd, termios.TIOCEXCL)


def _set_up(fd: int, name: str, rate: int, settings: Settings, line: Line) -> Facts:
    remarks: list[str] = []
    if settings.modem_lines == "drop" and not line.drop(fd):  # first: an adapter that drives the bus stops it
        remarks.append("RTS and DTR could not be dropped")
    marked = settings.error_marks == "on" or (settings.error_marks == "auto" and line.counts(fd) is not None)
    granted = _make_raw(fd, name, rate, settings, marked=marked)
    if granted != settings.line_format:
        remarks.append(f"asked {settings.line_format}, granted {granted}")
    if settings.low_latency:
        remarks.append("low latency granted" if line.low_latency(fd) else "low latency refused")
    remarks.append("line errors marked" if marked else "line errors not marked")
    if line.counts(fd) is None:
        remarks.append("no error counters")
    state = line.modem_state(fd)
    remarks.append(f"{state} ({settings.modem_lines})" if state else f"RTS and DTR not known ({settings.modem_lines})")
    adapter = adapter_of(name)  # after low latency: it sets the latency timer
    default = PROMPT if os.path.realpath(name).startswith("/dev/pts/") else ASSUMED
    return Facts(adapter, latency_of(adapter, settings, default), marked, granted, tuple(remarks))


def _make_raw(fd: int, name: str, rate: int, settings: Settings, *, marked: bool) -> str:
    """Set speed and format; return the format that was granted."""
    import termios

    sizes = {7: termios.CS7, 8: termios.CS8}
    parity = {"N": 0, "E": termios.PARENB, "O": termios.PARENB | termios.PARODD}
    character = sizes[settings.data_bits] | parity[settings.parity] | (termios.CSTOPB if settings.stop_bits == 2 else 0)
    marks = termios.PARMRK | termios.INPCK if marked else 0
    try:
        attributes = termios.tcgetattr(fd)
        controls: list[Any] = attributes[6]
        controls[termios.VMIN], controls[termios.VTIME] = 1, 0
        raw = [marks, 0, character | termios.CREAD | termios.CLOCAL, 0, rate, rate, controls]
        termios.tcsetattr(fd, termios.TCSANOW, raw)
        got = termios.tcgetattr(fd)
    except termios.error as error:
        raise PortError(f"{name} does not take its settings ({error.args[-1]}); is the adapter all right?") from None
    if got[5] != rate:
        raise PortError(f"{name} can not do {settings.baud} baud; use another adapter")
    control: int = got[2]
    letter = "N" if not control & termios.PARENB else "O" if control & termios.PARODD else "E"
    bits = next((bits for bits, size in sizes.items() if control & termios.CSIZE == size), "?")
    return f"{bits}{letter}{2 if control & termios.CSTOPB else 1}"


def _not_opened(name: str, error: OSError) -> PortError:
    if error.errno in {errno.ENOENT, errno.ENOTDIR, errno.ENXIO, errno.ENODEV}:
        return PortError(f"{name} is not there; {_what_ports()}")
    if error.errno in {errno.EACCES, errno.EPERM}:
        group = _group(name)
        whose = f"; it belongs to group {group}: sudo usermod -aG {group} $USER, then log in again" if group else ""
        return PortError(f"no permission to read {name}{whose}")
    if error.errno == errno.EBUSY:
        return PortError(_busy(name))
    return PortError(f"{name} can not be opened: {reason(error)}; {_what_ports()}")


def _not_serial(name: str, mode: int) -> str:
    if stat.S_ISREG(mode):
        return f"{name} is a file, not a serial device; to look at a capture: dalyshark decode {name}"
    if stat.S_ISDIR(mode):
        return f"{name} is a directory, not a serial device; {_what_ports()}"
    return f"{name} is not a serial device; {_what_ports()}"


def _busy(name: str) -> str:
    holder = _holder(name)
    return (
        f"{name} is in use by {holder or 'another program'}; two readers would steal each other's bytes: stop it first"
    )


def _holder(name: str) -> str:
    """Find who has the device locked, else who has it open, as far as /proc tells: ``screen (process 123)``."""
    device = os.path.realpath(name)
    lockers: list[str] = []
    others: list[str] = []
    with contextlib.suppress(OSError):
        inode = Path(device).stat().st_ino
        # 1: FLOCK  ADVISORY  WRITE 14516 00:18:3 0 EOF
        for words in map(str.split, Path("/proc/locks").read_text(encoding="ascii").splitlines()):
            if len(words) > 5 and words[1] == "FLOCK" and words[5].endswith(f":{inode}"):
                lockers.append(words[4])
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if any(os.path.realpath(link) == device for link in (process / "fd").iterdir()):
                others.append(process.name)
    for pid in [pid for pid in others if pid in lockers] + others:
        with contextlib.suppress(OSError):
            if int(pid) != os.getpid():
                return f"{(Path('/proc') / pid / 'comm').read_text().strip()} (process {pid})"
    return ""


def _group(name: str) -> str:
    import grp

    try:
        return grp.getgrgid(Path(name).stat().st_gid).gr_name
    except (OSError, KeyError):
        return ""


def _what_ports() -> str:
    ports = serial_ports()
    if not ports:
        return "there is no serial port on this machine: is the adapter plugged in?"
    return f"serial ports here: {', '.join(ports)}"
