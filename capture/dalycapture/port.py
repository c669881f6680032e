# SPDX-License-Identifier: GPL-2.0-or-later
"""Ports, opened to listen and never to speak.

A serial device is opened by hand: read-only, without waiting for a carrier, and then

    flock, TIOCEXCL     nobody else may take our bytes (either alone has holes: root passes TIOCEXCL)
    termios             raw, 8N1, the asked baud rate, CLOCAL, no HUPCL, at once (TCSANOW)

and nothing else: no flush, no modem-line call, no break, no write. The kernel itself raises DTR and RTS when a port is
opened; no program can stop that. The settings are not put back at the end: with HUPCL back on, closing would drop
the lines.

``socket://HOST:PORT`` is a TCP serial server, ``rfc2217://HOST:PORT`` one with settings (through pyserial, which talks
to the server to set it up). Windows goes through pyserial too.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
import stat
import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol
from urllib.parse import urlsplit

from dalycapture.errors import PortError
from dalycapture.output import reason

if TYPE_CHECKING:
    from collections.abc import Callable

READ_SIZE: Final = 4096  # the kernel's line discipline holds no more
CONNECT_TIMEOUT_S: Final = 5.0
COMMON_RATES: Final = "1200, 2400, 4800, 19200, 38400, 57600, 115200"


class Port(Protocol):
    """Something to listen to. ``fileno`` can be polled for reading."""

    name: str
    hardware: str  # what the adapter calls itself; empty where not known

    def fileno(self) -> int:
        """Return the descriptor to poll."""
        ...

    def read(self) -> bytes | None:
        """Read what is there, at most 4096 bytes; None: nothing yet. Raises PortError when the port is gone."""
        ...

    def close(self) -> None:
        """Close it."""
        ...


def open_port(name: str, baud: int = 9600) -> Port:
    """Open a device (``/dev/ttyUSB0``), or a ``socket://`` or ``rfc2217://`` URL, to listen at baud bits per second.

    Raises PortError, one line: not there, no permission, in use, not a serial device, baud rate not possible.
    """
    if "://" in name:
        scheme = name.split("://", 1)[0].lower()
        if scheme == "socket":
            return _open_socket(name)
        if scheme == "rfc2217":
            return _open_pyserial(name, baud)
        raise PortError(f"{name}: {scheme}:// is not known; use a device, socket://HOST:PORT or rfc2217://HOST:PORT")
    if os.name == "nt":
        return _open_pyserial(name, baud)
    return _open_device(name, baud)


class _Device:
    """A serial device, polled and read directly."""

    def __init__(self, fd: int, name: str, hardware: str) -> None:
        self.name = name
        self.hardware = hardware
        self._fd = fd

    def fileno(self) -> int:
        return self._fd

    def read(self) -> bytes | None:
        try:
            data = os.read(self._fd, READ_SIZE)
        except BlockingIOError:
            return None
        except OSError as error:
            raise _gone(self.name, error) from None
        if not data:  # a hung-up line reads as end of file
            raise _gone(self.name)
        return data

    def close(self) -> None:
        import fcntl
        import termios

        # A pty outlives our closing, and would stay closed to others (a kill leaves it so; real ports forget).
        with contextlib.suppress(OSError):
            fcntl.ioctl(self._fd, termios.TIOCNXCL)
        os.close(self._fd)


class _Socket:
    """A connection that carries the bytes of a port."""

    hardware = ""

    def __init__(self, connection: socket.socket, name: str, closing: Callable[[], None] = lambda: None) -> None:
        self.name = name
        self._connection = connection
        self._closing = closing

    def fileno(self) -> int:
        return self._connection.fileno()

    def read(self) -> bytes | None:
        try:
            data = self._connection.recv(READ_SIZE)
        except BlockingIOError:
            return None
        except OSError as error:
            raise _gone(self.name, error) from None
        if not data:
            raise _gone(self.name)
        return data

    def close(self) -> None:
        self._closing()
        self._connection.close()


def _gone(name: str, error: OSError | None = None) -> PortError:
    why = f" ({reason(error)})" if error and error.errno != errno.EIO else ""
    advice = "check the network and the server" if "://" in name else "check the adapter and its cable"
    return PortError(f"{name} went away{why}; {advice}, then start again")


def _open_device(name: str, baud: int) -> Port:
    import termios

    rate: int | None = getattr(termios, f"B{baud}", None) if baud > 0 else None
    if rate is None:
        raise PortError(f"{name}: baud rate {baud} is not possible; Daly's is 9600, others are {COMMON_RATES}")
    try:
        mode = Path(name).stat().st_mode
        if not stat.S_ISCHR(mode):
            raise PortError(_not_serial(name, mode))
        fd = os.open(name, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as error:
        raise _not_opened(name, error) from None
    try:
        _claim(fd, name)
        _make_raw(fd, name, baud, rate)
    except BaseException:
        os.close(fd)
        raise
    return _Device(fd, name, _hardware(name))


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


def _make_raw(fd: int, name: str, baud: int, rate: int) -> None:
    import termios

    try:
        attributes = termios.tcgetattr(fd)
        controls: list[Any] = attributes[6]
        controls[termios.VMIN], controls[termios.VTIME] = 1, 0
        raw = [0, 0, termios.CS8 | termios.CREAD | termios.CLOCAL, 0, rate, rate, controls]
        termios.tcsetattr(fd, termios.TCSANOW, raw)
        got = termios.tcgetattr(fd)
    except termios.error as error:
        raise PortError(f"{name} does not take its settings ({error.args[-1]}); is the adapter all right?") from None
    if got[5] != rate:
        raise PortError(f"{name} can not do {baud} baud; use another adapter")


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


def serial_ports() -> list[str]:
    """List the serial ports that have hardware behind them, by the kernel's own list; none is opened."""
    ports: list[str] = []
    for entry in sorted(Path("/sys/class/tty").glob("*")):
        if not (entry / "device" / "driver").exists():
            continue
        with contextlib.suppress(OSError):
            if (entry / "type").read_text().strip() == "0":  # a place for a UART, and none there
                continue
        ports.append(f"/dev/{entry.name}")
    return ports


def _hardware(name: str) -> str:
    """Name the USB adapter as it does itself (sysfs), without its serial number; empty where there is none."""
    with contextlib.suppress(OSError):
        folder = (Path("/sys/class/tty") / Path(os.path.realpath(name)).name / "device").resolve(strict=True)
        for level in (folder, *folder.parents[:3]):
            if (level / "idVendor").exists():
                keys = ("manufacturer", "product", "idVendor", "idProduct")
                maker, product, vendor, model = (_line(level / key) for key in keys)
                return f"{maker} {product} ({vendor}:{model})".strip()
    return ""


def _line(path: Path) -> str:
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    return "".join(letter for letter in text if letter.isprintable())[:80].strip()


def _open_socket(url: str) -> Port:
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise PortError(f"{url}: write it as socket://HOST:PORT, like socket://192.168.1.20:4001")
    try:
        connection = socket.create_connection((host, port), CONNECT_TIMEOUT_S)
    except OSError as error:
        raise PortError(
            f"{url}: no connection ({reason(error)}); check the address, and that the server runs"
        ) from None
    connection.setblocking(False)
    return _Socket(connection, url)


def _open_pyserial(name: str, baud: int) -> Port:
    """Let pyserial read in a thread of its own, and hand the bytes over on a socket, which can be polled."""
    import serial

    try:
        device: Any = serial.serial_for_url(name, baudrate=baud, timeout=0.1)
    except (serial.SerialException, ValueError, OSError) as error:
        raise PortError(f"{name} can not be opened: {str(error).splitlines()[0]}") from None
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    stopping = threading.Event()

    def pump() -> None:
        with theirs, contextlib.suppress(OSError, serial.SerialException):
            while not stopping.is_set():
                data: bytes = device.read(max(1, min(READ_SIZE, device.in_waiting)))
                if data:
                    theirs.sendall(data)
        with contextlib.suppress(OSError, serial.SerialException):
            device.close()

    thread = threading.Thread(target=pump, name=f"reader of {name}", daemon=True)
    thread.start()

    def close() -> None:
        stopping.set()
        thread.join(1)

    return _Socket(ours, name, close)
