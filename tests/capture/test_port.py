# SPDX-License-Identifier: GPL-2.0-or-later
"""Ports: settings as asked, and one clear line for everything that can be wrong."""

from __future__ import annotations

import errno
import os
import re
import select
import socket
import stat
import struct
import subprocess
import sys
import termios
from typing import TYPE_CHECKING, Any

import pytest
from tests.capture.bus import Bus

from dalycapture import device as module
from dalycapture.adapters import serial_ports
from dalycapture.errors import CaptureError, PortError
from dalycapture.interface import tap_of
from dalycapture.line import Counts, KernelLine, ModemState
from dalycapture.opening import open_port
from dalycapture.settings import ErrorMarks, Settings, line_format

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from dalycapture.port import Port


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
        "import sys; from dalycapture.opening import open_port\n"
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


def test_a_server_that_does_not_speak_rfc2217(bus: Bus) -> None:
    """A plain TCP server hands bytes on, and answers no negotiation."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        place = f"127.0.0.1:{server.getsockname()[1]}"
        assert refused(f"rfc2217://{place}?timeout=0.3") == (
            f"rfc2217://{place}?timeout=0.3: the server does not take speed and format (RFC 2217); if it has them set "
            "already, use socket://HOST:PORT"
        )


def test_pyserial_is_not_imported_for_a_device(bus: Bus) -> None:
    code = (
        "import sys; from dalycapture.opening import open_port; open_port(sys.argv[1]).close()\n"
        "print(sorted({'serial', 'rich', 'scapy'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, bus.port], capture_output=True, text=True, timeout=60, check=True
    )
    assert done.stdout == "[]\n"


def test_pyserial_port_is_pumped(bus: Bus, monkeypatch: pytest.MonkeyPatch) -> None:
    """What rfc2217 and Windows go through, with pyserial's own driver for a pty in its place."""
    import serial

    def local(*_: object, do_not_open: bool, **settings: Any) -> serial.Serial:
        made = serial.Serial(None, **settings)  # a port that is named later is opened later
        made.port = bus.port
        return made

    monkeypatch.setattr(serial, "serial_for_url", local)
    port = open_port("rfc2217://somewhere:1")
    bus.send(b"\xa5\x01\x90")
    got = b""
    while len(got) < 3:
        got += wait_and_read(port)
    assert got == b"\xa5\x01\x90"
    port.close()


class FakeLine:
    """Answers as a driver of real hardware would; says what it was asked."""

    def __init__(self, *, counts: Counts | None = Counts(), refuses: bool = False) -> None:  # noqa: B008 - a tuple
        self.calls: list[str] = []
        self._counts, self._refuses = counts, refuses
        self._state = ModemState(rts=True, dtr=True)

    def counts(self, _: int) -> Counts | None:
        return self._counts

    def modem_state(self, _: int) -> ModemState | None:
        return self._state

    def drop(self, _: int) -> bool:
        self.calls.append("drop")
        if not self._refuses:
            self._state = ModemState(rts=False, dtr=False)
        return not self._refuses

    def low_latency(self, _: int) -> bool:
        self.calls.append("low latency")
        return not self._refuses


def described(port: Port, settings: Settings) -> str:
    return tap_of(port, settings).description


def test_a_pseudo_terminal_knows_little_and_that_is_said(bus: Bus) -> None:
    port = open_port(bus.port)
    assert described(port, Settings()) == (
        f"dalyshark bus=main 9600 8N1 {bus.port}; line errors not marked; no error counters; "
        "RTS and DTR not known (leave); bytes held back for up to 0 ms (pseudo-terminal)"
    )
    port.close()


def test_what_was_asked_and_granted_is_in_the_description(bus: Bus) -> None:
    settings = Settings(4800, "8E1", modem_lines="drop", low_latency=True, latency_ms=2)
    line = FakeLine()
    port = open_port(bus.port, settings, line=line)
    assert line.calls == ["drop", "low latency"]  # the bus is freed first
    # A pseudo-terminal has no parity (capture notes, section 4): what was asked is not what was granted.
    assert described(port, settings) == (
        f"dalyshark bus=main 4800 8E1 {bus.port}; asked 8E1, granted 8N1; low latency granted; line errors marked; "
        "RTS off, DTR off (drop); bytes held back for up to 2 ms (as given)"
    )
    port.close()


def test_what_was_refused_is_said_too(bus: Bus) -> None:
    settings = Settings(modem_lines="drop", low_latency=True, error_marks="off")
    port = open_port(bus.port, settings, line=FakeLine(counts=None, refuses=True))
    assert port.facts.remarks == (
        "RTS and DTR could not be dropped",
        "low latency refused",
        "line errors not marked",
        "no error counters",
        "RTS on, DTR on (drop)",
    )
    port.close()


def test_lines_are_left_alone_unless_asked(bus: Bus) -> None:
    line = FakeLine()
    port = open_port(bus.port, line=line)
    assert line.calls == []
    assert "RTS on, DTR on (leave)" in port.facts.remarks
    port.close()


@pytest.mark.parametrize(("marks", "counts", "marked"), [
    ("auto", Counts(), True), ("auto", None, False), ("on", None, True), ("off", Counts(), False),
])  # fmt: skip
def test_errors_are_marked_where_the_driver_counts_them(
    bus: Bus, marks: ErrorMarks, counts: Counts | None, marked: bool
) -> None:
    port = open_port(bus.port, Settings(error_marks=marks), line=FakeLine(counts=counts))
    slave = os.open(bus.port, os.O_RDONLY | os.O_NOCTTY) if os.geteuid() == 0 else port.fileno()
    wanted = termios.PARMRK | termios.INPCK if marked else 0
    assert termios.tcgetattr(slave)[0] == wanted
    assert port.facts.marked is marked
    if marked:  # then the kernel doubles every good FF (capture notes, section 2)
        bus.send(b"\xa5\xff\x00")
        assert wait_and_read(port) == b"\xa5\xff\xff\x00"
    if slave != port.fileno():
        os.close(slave)
    port.close()


def test_counters_of_the_kernel_s_struct() -> None:
    """struct serial_icounter_struct: cts dsr rng dcd rx tx frame overrun parity brk buf_overrun, nine reserved."""
    import fcntl

    def answer(fd: int, request: int, buffer: bytearray) -> int:
        assert request == 0x545D
        buffer[:] = struct.pack("20i", 1, 2, 3, 4, 500, 6, 7, 8, 9, 10, 11, *[0] * 9)
        return 0

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fcntl, "ioctl", answer)
        assert KernelLine().counts(0) == Counts(rx=500, frame=7, overrun=8, parity=9, breaks=10, buf_overrun=11)


def test_counters_wrap() -> None:
    assert Counts(rx=3, frame=1).since(Counts(rx=0x7FFFFFFF, frame=1)) == Counts(rx=0x80000004)
    assert str(Counts(rx=9, frame=2, overrun=1)) == "2 framing errors, 1 overruns"


@pytest.mark.parametrize(("text", "bits"), [("8N1", 10), ("8e1", 11), ("7O1", 10), ("8N2", 11)])
def test_formats(text: str, bits: int) -> None:
    assert Settings(line_format=line_format(text)).bits_per_byte == bits


@pytest.mark.parametrize("text", ["8N", "9N1", "8M1", "8N1.5", "", "8N11"])
def test_formats_that_are_none(text: str) -> None:
    with pytest.raises(PortError, match="is not known; Daly's is 8N1"):
        line_format(text)
