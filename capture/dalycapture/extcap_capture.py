# SPDX-License-Identifier: GPL-2.0-or-later
"""A capture that Wireshark has started: the sniffer into its fifo, and into our own mirror file.

Ends by SIGTERM or SIGINT (Wireshark's stop), when the reader of the fifo is gone, on a silent bus too, and when the
port is gone for good. Whatever goes wrong, the fifo is opened and closed, for tshark waits for that for ever; then one
line on stderr, which is shown to the user, and where nothing is to be written else.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import time
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Final, Protocol, cast

from dalycapture.adapters import serial_ports
from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.extcap_names import FILTERS, INTERFACE
from dalycapture.interface import bus_name, tap_of
from dalycapture.opening import open_port
from dalycapture.output import PipeOutput
from dalycapture.pcapng import PcapngWriter
from dalycapture.rotation import Keeping
from dalycapture.settings import Settings, line_format
from dalycapture.sniffer import Side, Sniffer
from dalycapture.tally import End
from dalycapture.toolbar import Toolbar
from dalycapture.writer import CaptureWriter, counted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalycapture.port import Port
    from dalycapture.settings import ModemLines
    from dalycapture.tally import Tally

PATIENCE_S: Final = 20.0  # for Wireshark to open its end of the fifo
GOODBYE_S: Final = 0.2  # for its reader to take the rest
SHOW_S: Final = 1.0


def capture(options: dict[str, str]) -> int:
    """Capture until told to stop; exit status, which Wireshark does not look at. Never leaves tshark hanging."""
    fifo = options.get("fifo", "")
    if fifo in {"", "true"}:
        return _fail("no --fifo was given: this is started by Wireshark, see dalyshark install")
    if _word(options, "extcap-capture-filter"):
        return _fail(FILTERS, fifo)
    try:
        settings, bus = _settings(options), bus_name(_word(options, "bus") or "main")
        port = open_port(_port_name(options), settings)
    except CaptureError as error:
        return _fail(str(error), fifo)
    try:
        return _capture(fifo, port, settings, bus, options)
    finally:
        port.close()


def _capture(fifo: str, port: Port, settings: Settings, bus: str, options: dict[str, str]) -> int:
    try:
        mirror = _mirror(options)
    except CaptureError as error:
        return _fail(str(error), fifo)
    toolbar_pipes = _word(options, "extcap-control-out"), _word(options, "extcap-control-in")
    marks: list[Sniffer] = []

    def on_mark(text: str) -> None:
        for sniffer in marks:
            sniffer.mark(text)

    toolbar = Toolbar(*toolbar_pipes, on_mark)
    fd = _open_fifo(fifo)
    if fd is None:
        return _fail(f"{fifo}: Wireshark did not open it")
    view = _View(toolbar, PipeOutput(fd, "Wireshark", goodbye_s=GOODBYE_S), application=_application())
    sinks: list[CaptureWriter] = [view, *mirror]
    side = Side(port, tap_of(port, settings, bus=bus), settings=settings, wait_s=None)
    reporter = _Reporter(toolbar, sinks, port.name)
    sniffer = Sniffer([side], sinks, ticker=reporter, verbose=_is_on(options, "verbose"))
    reporter.stop_when_gone = sniffer
    marks.append(sniffer)
    try:
        tally = sniffer.run(stop_signals=(signal.SIGINT, signal.SIGTERM), user_signals=True)
    except CaptureError as error:
        return _fail(str(error))
    notes = [note for sink in mirror for note in sink.notes if sink.lost or sink.failure]
    if tally.end is End.PORT_LOST:
        notes.append(tally.problem)
    return _fail("; ".join(notes)) if notes else 0


class _View(PcapngWriter):
    """The capture as Wireshark gets it; its events stand in the log window too."""

    def __init__(self, toolbar: Toolbar, output: PipeOutput, *, application: str) -> None:
        super().__init__(output, application=application)
        self._toolbar = toolbar

    def write_packet(self, time_ns: int, data: bytes, *, comment: str = "", **more: int) -> None:
        if not data:
            self._toolbar.log(f"{_now()} {comment}")
        super().write_packet(time_ns, data, comment=comment, **more)


class _Stoppable(Protocol):
    def stop(self) -> None: ...


class _Reporter:
    """Tells the toolbar what happens, once a second; ends all when Wireshark is gone, though a mirror is written."""

    def __init__(self, toolbar: Toolbar, sinks: Sequence[CaptureWriter], port: str) -> None:
        self.stop_when_gone: _Stoppable | None = None
        self._toolbar, self._view, self._sinks = toolbar, sinks[0], sinks
        self._next = 0.0
        self._lost = 0
        self._text = ""
        mirrors = "".join(f", mirror file {sink.output.name}" for sink in sinks[1:])
        toolbar.log(f"{_now()} listening to {port}{mirrors}")

    def __call__(self, tally: Tally) -> None:
        if self._view.failure and self.stop_when_gone:
            self.stop_when_gone.stop()
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + SHOW_S
        boards = f", boards {' '.join(map(str, sorted(tally.boards)))}" if tally.boards else ""
        text = f"{counted(tally.records, 'record')}, {tally.bad} bad, {tally.junk} junk{boards}, lost {tally.lost}"
        if text != self._text:
            self._text = text
            self._toolbar.heard(text)
        for sink in self._sinks[1:]:
            if sink.lost != self._lost:
                if not self._lost:
                    self._toolbar.status(f"{sink.output.name} can not be written: is the disk full?")
                self._lost = sink.lost
                self._toolbar.log(f"{_now()} {sink.output.name}: {counted(sink.lost, 'record')} could not be written")


def _mirror(options: dict[str, str]) -> list[CaptureWriter]:
    """Open the mirror file. It is added to, for Wireshark starts each capture with the same options."""
    path = _word(options, "mirror")
    if not path:
        return []
    keeping = Keeping(append=True, checksum=_is_on(options, "mirror-sha256"), wait_when_full=True)
    return [open_writer(os.path.expanduser(path), application=_application(), keeping=keeping)]  # noqa: PTH111


def _settings(options: dict[str, str]) -> Settings:
    """Read the port's options; what tshark leaves out has its default here. Raises CaptureError."""
    baud = _word(options, "baud") or "9600"
    if not baud.isascii() or not baud.isdecimal() or not 0 < int(baud[:9]) <= 10**8:
        raise CaptureError(f"baud rate {baud!r} is not a number such as 9600")
    lines = _word(options, "modem-lines") or "leave"
    if lines not in {"leave", "drop"}:
        raise CaptureError(f"RTS and DTR: {lines!r} is not known; use leave or drop")
    return Settings(
        baud=int(baud),
        line_format=line_format(_word(options, "format") or "8N1"),
        modem_lines=cast("ModemLines", lines),
        low_latency=_is_on(options, "low-latency"),
    )


def _port_name(options: dict[str, str]) -> str:
    """Return the port: that of the interface, or of the option; of one adapter alone it need not be said."""
    interface = _word(options, "extcap-interface")
    if interface not in {"", INTERFACE}:
        return interface
    if name := _word(options, "address") or _word(options, "port"):
        return name
    ports = serial_ports()
    if len(ports) == 1:
        return ports[0]
    if not ports:
        raise CaptureError("there is no serial adapter on this machine: is it plugged in?")
    raise CaptureError(f"several adapters are here; choose one in the options of the interface: {', '.join(ports)}")


def _word(options: dict[str, str], name: str) -> str:
    """Return a value; an option without one says nothing."""
    value = options.get(name, "")
    return "" if value == "true" else value.strip()


def _is_on(options: dict[str, str], name: str) -> bool:
    """Tell a flag, alone or with a value (older versions send one)."""
    return options.get(name, "false").lower() in {"true", "1", "yes"}


def _open_fifo(path: str) -> int | None:
    """Open the fifo for writing, once Wireshark has it open; None: it never came."""
    if os.name == "nt":  # a named pipe that is there, or is not
        return os.open(path, os.O_WRONLY | getattr(os, "O_BINARY", 0))
    until = time.monotonic() + PATIENCE_S
    while True:
        try:
            return os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            if error.errno != errno.ENXIO or time.monotonic() > until:
                return None
        time.sleep(0.01)


def _fail(why: str, fifo: str = "") -> int:
    """Say what is wrong, to whoever waits for this fifo to be opened; said before it is closed, it is surely seen."""
    fd = _open_fifo(fifo) if fifo else None
    sys.stderr.write(f"{why}\n")
    sys.stderr.flush()
    if fd is not None:
        os.close(fd)
    return 1


def _application() -> str:
    try:
        return f"dalyshark {version('dalyshark')} extcap"
    except PackageNotFoundError:
        return "dalyshark extcap"


def _now() -> str:
    return time.strftime("%H:%M:%S")
