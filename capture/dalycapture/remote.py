# SPDX-License-Identifier: GPL-2.0-or-later
"""Ports behind a network (``socket://``, ``rfc2217://``), and Windows: bytes that come over a connection."""

from __future__ import annotations

import contextlib
import socket
import threading
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import urlsplit

from dalycapture.adapters import Adapter, adapters
from dalycapture.errors import PortError, reason
from dalycapture.port import ASSUMED, NETWORK, READ_SIZE, Facts, Port, gone, latency_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalycapture.settings import Settings

CONNECT_TIMEOUT_S: Final = 5.0


def open_remote(name: str, settings: Settings) -> Port:
    """Open a URL, or a port of Windows. Raises PortError."""
    if "://" not in name:
        return _open_pyserial(name, settings)
    scheme = name.split("://", 1)[0].lower()
    if scheme == "socket":
        return _open_socket(name, settings)
    if scheme == "rfc2217":
        return _open_pyserial(name, settings)
    raise PortError(f"{name}: {scheme}:// is not known; use a device, socket://HOST:PORT or rfc2217://HOST:PORT")


class _Socket:
    """A connection that carries the bytes of a port."""

    def __init__(
        self, connection: socket.socket, name: str, facts: Facts, closing: Callable[[], None] = lambda: None
    ) -> None:
        self.name = name
        self.facts = facts
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
            raise gone(self.name, reason(error)) from None
        if not data:
            raise gone(self.name)
        return data

    def counts(self) -> None:
        """Tell of no counters: a connection has none."""

    def close(self) -> None:
        self._closing()
        self._connection.close()


def _open_socket(url: str, settings: Settings) -> Port:
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
    adapter = Adapter(url)
    remarks = ("speed and format as the server has them", "line errors not marked", "RTS and DTR not known")
    return _Socket(connection, url, Facts(adapter, latency_of(adapter, settings, NETWORK), remarks=remarks))


def _open_pyserial(name: str, settings: Settings) -> Port:
    """Let pyserial read in a thread of its own, and hand the bytes over on a socket, which can be polled."""
    import serial

    try:
        device: Any = serial.serial_for_url(
            name,
            baudrate=settings.baud,
            bytesize=settings.data_bits,
            parity=settings.parity,
            stopbits=settings.stop_bits,
            timeout=0.1,
            do_not_open=True,
        )
        device.rts = device.dtr = settings.modem_lines == "leave"  # pyserial sets them when it opens
        device.open()
    except (serial.SerialException, ValueError, OSError) as error:
        if "RFC2217" in str(error):  # it listens, and does not answer; pyserial's text has its own objects in it
            raise PortError(
                f"{name}: the server does not take speed and format (RFC 2217); if it has them set already, "
                "use socket://HOST:PORT"
            ) from None
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

    adapter = next((one for one in adapters() if one.device == name), Adapter(name))
    state = "on" if settings.modem_lines == "leave" else "off"
    remarks = (f"opened by pyserial, RTS and DTR set {state}", "line errors not marked", "no error counters")
    latency = latency_of(adapter, settings, NETWORK if "://" in name else ASSUMED)
    return _Socket(ours, name, Facts(adapter, latency, granted=settings.line_format, remarks=remarks), close)
