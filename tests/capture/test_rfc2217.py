# SPDX-License-Identifier: GPL-2.0-or-later
"""A port behind a server that takes speed and format (RFC 2217): pyserial's own server, over a port that is made up."""

from __future__ import annotations

import select
import socket
import threading
from typing import Any, Final

import pytest

from dalycapture.opening import open_port
from dalycapture.settings import ModemLines, Settings

LINE: Final = bytes.fromhex("a5 40 90 08 0000000000000000 7d ff fd ff")  # FF has a meaning of its own in Telnet


class Line:
    """What pyserial's server drives: notes what is set."""

    def __init__(self) -> None:
        self.settings: dict[str, Any] = {}
        self.cts = self.dsr = self.cd = True
        self.ri = False
        self.baudrate, self.bytesize, self.parity, self.stopbits = 115200, 7, "E", 2

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "settings":
            self.settings[name] = value
        super().__setattr__(name, value)

    def reset_input_buffer(self) -> None:
        """Have nothing to throw away."""

    def reset_output_buffer(self) -> None:
        """Have nothing to throw away."""


class Server:
    """Takes one connection; the bytes for the line that come over it are in ``written``."""

    def __init__(self) -> None:
        self.line = Line()
        self.written: list[bytes] = []
        self._server = socket.create_server(("127.0.0.1", 0))
        self._lock = threading.Lock()
        self._connected = threading.Event()
        self.url = f"rfc2217://127.0.0.1:{self._server.getsockname()[1]}"
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def write(self, data: bytes) -> None:
        """Send to the client; pyserial's server answers with it too."""
        with self._lock:
            self._connection.sendall(data)

    def hear(self, data: bytes) -> None:
        """Hand on bytes of the line, as a server does once it has been asked for the settings."""
        assert self._connected.wait(5)
        self.write(b"".join(self._manager.escape(data)))

    def _serve(self) -> None:
        from serial.rfc2217 import PortManager

        self._connection, _ = self._server.accept()
        line: Any = self.line
        connection: Any = self
        self._manager: Any = PortManager(line, connection)
        self._connected.set()
        with self._connection:
            while data := self._connection.recv(1024):
                self.written += self._manager.filter(data)

    def close(self) -> None:
        """Wait for the client's end."""
        self._thread.join(5)
        self._server.close()


@pytest.mark.parametrize(("modem_lines", "state"), [("leave", True), ("drop", False)])
def test_bytes_come_and_none_go(modem_lines: ModemLines, state: bool) -> None:
    server = Server()
    port = open_port(server.url, Settings(9600, modem_lines=modem_lines))
    server.hear(LINE)
    poll, got = select.poll(), b""
    poll.register(port.fileno(), select.POLLIN)
    while len(got) < len(LINE):
        assert poll.poll(5000)
        got += port.read() or b""
    port.close()
    server.close()
    assert got == LINE
    assert server.written == []
    line = server.line
    assert (line.baudrate, line.bytesize, line.parity, line.stopbits) == (9600, 8, "N", 1)
    assert (line.settings["rts"], line.settings["dtr"]) == (state, state)
