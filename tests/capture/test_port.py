# SPDX-License-Identifier: GPL-2.0-or-later
"""Ports: settings as asked, and one clear line for everything that can be wrong."""

from __future__ import annotations

import errno
import os
import re
import select
import socket
import stat
import subprocess
import sys
import termios
from typing import TYPE_CHECKING, Any

import pytest
from tests.capture.bus import Bus

from dalycapture import port as module
from dalycapture.errors import CaptureError, PortError
from dalycapture.port import Port, open_port, serial_ports

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture
def bus() -> Iterator[Bus]:
    with Bus() as one:
        yield one


def refused(name: str, baud: int = 9600) -> str:
    with pytest.raises(PortError) as caught:
        open_port(name, baud)
    message = str(caught.value)
    assert "\n" not in message
    assert isinstance(caught.value, CaptureError)
    return message


def wait_and_read(port: Port) -> bytes:
    poll = select.poll()
    poll.register(port.fileno(), select.POLLIN)
    data = None
    while data is None:
        assert poll.poll(5000)
        data = port.read()
    return data


def test_settings(bus: Bus) -> None:
    slave = os.open(bus.port, os.O_RDWR | os.O_NOCTTY)
    try:
        before = termios.tcgetattr(slave)
        before[3] |= termios.ECHO | termios.ICANON  # as a shell would have left it
        before[2] |= termios.HUPCL
        termios.tcsetattr(slave, termios.TCSANOW, before)
        port = open_port(bus.port, 19200)
        attributes: list[Any] = termios.tcgetattr(slave)
        assert attributes[:2] == [0, 0]
        assert attributes[2] & (termios.CSIZE | termios.PARENB | termios.CSTOPB) == termios.CS8
        assert attributes[2] & termios.CLOCAL
        assert not attributes[2] & termios.HUPCL
        assert attributes[3] == 0
        assert attributes[4:6] == [termios.B19200, termios.B19200]
        bus.send(bytes(range(256)))
        assert wait_and_read(port) == bytes(range(256))  # no byte is special
        assert port.read() is None
        port.close()
    finally:
        os.close(slave)


def test_bytes_that_came_before_are_kept(bus: Bus) -> None:
    """No flush: what the kernel holds is evidence too."""
    bus.send(b"before")
    port = open_port(bus.port)
    assert wait_and_read(port) == b"before"
    port.close()


def test_it_can_not_be_written(bus: Bus) -> None:
    port = open_port(bus.port)
    with pytest.raises(OSError, match="Bad file descriptor"):
        os.write(port.fileno(), b"\xa5")
    port.close()
    assert bus.heard() == b""


def test_it_can_be_opened_again(bus: Bus) -> None:
    for _ in range(2):
        open_port(bus.port).close()


def test_missing() -> None:
    message = refused("/dev/ttyUSB99")
    assert message.startswith("/dev/ttyUSB99 is not there; ")
    assert "serial port" in message


def test_the_ports_there_are_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "serial_ports", lambda: ["/dev/ttyUSB1", "/dev/ttyACM0"])
    assert refused("/dev/ttyUSB99") == "/dev/ttyUSB99 is not there; serial ports here: /dev/ttyUSB1, /dev/ttyACM0"
    monkeypatch.setattr(module, "serial_ports", list)
    assert "no serial port on this machine: is the adapter plugged in?" in refused("/dev/ttyUSB99")


def test_listing_opens_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> int:
        raise AssertionError("a port was opened")

    monkeypatch.setattr("os.open", fail)
    assert all(name.startswith("/dev/") for name in serial_ports())


def test_no_permission_names_the_group(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """Root may open anything, so the refusal is made. A pty belongs to group tty."""
    import grp

    def refuse(*_: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr("os.open", refuse)
    group = grp.getgrgid(os.stat(bus.port).st_gid).gr_name  # noqa: PTH116 - the name is a plain string
    assert refused(bus.port) == (
        f"no permission to read {bus.port}; it belongs to group {group}: "
        f"sudo usermod -aG {group} $USER, then log in again"
    )


def test_busy_names_who_has_it(bus: Bus) -> None:
    code = (
        "import sys; from dalycapture.port import open_port\n"
        "port = open_port(sys.argv[1]); print('open', flush=True); sys.stdin.read(); port.close()"
    )
    other = subprocess.Popen([sys.executable, "-c", code, bus.port], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert other.stdin
    assert other.stdout
    assert other.stdout.readline() == b"open\n"
    message = refused(bus.port)
    assert re.match(rf"{bus.port} is in use by .* \(process {other.pid}\); .*: stop it first$", message)
    other.stdin.close()
    other.wait(10)
    other.stdout.close()
    open_port(bus.port).close()


def test_exclusive_to_the_kernel(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> int:
        raise OSError(errno.EBUSY, "Device or resource busy")

    monkeypatch.setattr("os.open", refuse)
    assert " is in use by " in refused(bus.port)


def test_not_a_serial_device(tmp_path: Path) -> None:
    file = tmp_path / "x.pcapng"
    file.write_bytes(b"x")
    assert refused(str(file)) == f"{file} is a file, not a serial device; to look at a capture: dalyshark decode {file}"
    assert f"{tmp_path} is a directory, not a serial device" in refused(str(tmp_path))
    assert "/dev/null is not a serial device" in refused("/dev/null")
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    assert "is not a serial device" in refused(str(fifo))


@pytest.mark.parametrize("baud", [0, -1, 9601, 7])
def test_baud_rates_that_can_not_be(bus: Bus, baud: int) -> None:
    message = refused(bus.port, baud)
    assert f"baud rate {baud} is not possible; Daly's is 9600" in message


def test_a_hung_up_line_is_gone(bus: Bus) -> None:
    port = open_port(bus.port)
    bus.unplug()
    with pytest.raises(PortError, match=r"went away; check the adapter and its cable, then start again"):
        wait_and_read(port)
    port.close()


def test_socket_url() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        number = server.getsockname()[1]
        port = open_port(f"socket://127.0.0.1:{number}")
        peer, _ = server.accept()
        peer.sendall(b"\xa5\x40")
        assert wait_and_read(port) == b"\xa5\x40"
        assert port.read() is None
        peer.close()
        with pytest.raises(PortError, match=r"went away; check the network and the server"):
            wait_and_read(port)
        port.close()
    assert "no connection" in refused(f"socket://127.0.0.1:{number}")


def test_urls_that_are_none() -> None:
    assert "write it as socket://HOST:PORT" in refused("socket://host")
    assert "write it as socket://HOST:PORT" in refused("socket://host:99999999")
    assert "loop:// is not known" in refused("loop://")
    assert "can not be opened" in refused("rfc2217://127.0.0.1:1")


def test_pyserial_is_not_imported_for_a_device(bus: Bus) -> None:
    code = (
        "import sys; from dalycapture.port import open_port; open_port(sys.argv[1]).close()\n"
        "print(sorted({'serial', 'rich', 'scapy'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, bus.port], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout == "[]\n"


def test_pyserial_port_is_pumped(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """What rfc2217 and Windows go through, with pyserial's own driver for a pty in its place."""
    import serial

    def local(*_: object, **settings: Any) -> serial.Serial:
        return serial.Serial(bus.port, **settings)

    monkeypatch.setattr(serial, "serial_for_url", local)
    port = open_port("rfc2217://somewhere:1")
    bus.send(b"\xa5\x01\x90")
    got = b""
    while len(got) < 3:
        got += wait_and_read(port)
    assert got == b"\xa5\x01\x90"
    port.close()
