# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark capture``: sniff a bus to a file or a pipe. It listens only; nothing is ever sent to the bus."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from dataclasses import replace
from typing import TYPE_CHECKING

from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import bus_name, tap_of
from dalycapture.linktype import DEFAULT_LINK_TYPE, check_link_type
from dalycapture.port import open_port
from dalycapture.sniffer import End, Limits, Side, Sniffer, Tally
from dalycapture.writer import counted
from dalyref.kinds import Kind
from dalytools import __version__, file_options
from dalytools.adapter_list import list_adapters
from dalytools.port_options import PORT_HELP, add_port_options, checked, settings_of
from dalytools.problem import Problem

if TYPE_CHECKING:
    from dalycapture.framing import TimedRecord
    from dalycapture.rotation import Keeping
    from dalycapture.writer import CaptureWriter

STATUS_EVERY_S = 0.25


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Listen to a serial port and write every record to a capture file. Ctrl-C ends it. Nothing is sent to the bus."
    )
    parser.add_argument("port", metavar="PORT", nargs="?", help=PORT_HELP)
    parser.add_argument("--list", action="store_true", help="list the serial adapters, without opening any, and end")
    parser.add_argument("-w", dest="output", metavar="FILE", help="capture file; - is standard output")
    parser.add_argument(
        "-a",
        dest="limits",
        metavar="CONDITION",
        action="append",
        default=[],
        type=_limit,
        help="stop after duration:SECONDS, packets:N, filesize:KB (1000 bytes) or, with -b, files:N; may be given more "
        "than once",
    )
    parser.add_argument("-c", dest="packets", metavar="N", type=_positive, help="stop after N records")
    parser.add_argument("--bus", type=checked(bus_name), default="main", help="name of the bus (default: %(default)s)")
    parser.add_argument(
        "-F",
        dest="file_format",
        choices=["pcapng", "pcap"],
        default="pcapng",
        help="file format (default: %(default)s)",
    )
    parser.add_argument("--pcap", dest="file_format", action="store_const", const="pcap", help="the same as -F pcap")
    parser.add_argument(
        "--link-type",
        type=_link_type,
        default=DEFAULT_LINK_TYPE,
        metavar="N",
        help="147, 148 or 150..162 (default: %(default)s); 149 is taken by another dissector in Wireshark",
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="no status line and no summary")
    add_port_options(parser)
    file_options.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Capture until Ctrl-C, SIGTERM, a limit or the end of the port."""
    if args.list:
        return list_adapters()
    if not args.port:
        raise Problem("say which PORT to listen to; dalyshark capture --list shows what is there")
    if not args.output:
        raise Problem("say where the capture goes: -w FILE, or -w - for standard output")
    limits, files = Limits(), None
    for name, value in args.limits:
        if name == "files":
            files = value
        else:
            limits = replace(limits, **{name: value})
    if args.packets is not None:
        limits = replace(limits, packets=args.packets)
    status = None if args.quiet or not sys.stderr.isatty() else _Status()
    try:
        tally, sink = _capture(args, limits, file_options.read(args, stop_after=files), status)
    except CaptureError as error:
        raise Problem(str(error)) from None
    finally:
        if status:
            status.clear()
    tally.notes += sink.notes
    if not args.quiet:
        print(summary(tally, args.port, args.output, args.baud), file=sys.stderr)  # noqa: T201 - it is for the terminal
    if sink.lost:
        raise Problem(
            f"{counted(sink.lost, 'record')} of {tally.records} could not be written: {'; '.join(sink.notes)}"
        )
    if tally.end is End.PORT_LOST:
        raise Problem(tally.problem)
    return 0


def _capture(
    args: argparse.Namespace, limits: Limits, keeping: Keeping, status: _Status | None
) -> tuple[Tally, CaptureWriter]:
    settings = settings_of(args)
    port = open_port(args.port, settings)
    try:
        interface = tap_of(port, settings, bus=args.bus, link_type=args.link_type)
        # After the port: a wrong port does not cost an older capture of the same name.
        sink = open_writer(args.output, args.file_format, application=f"dalyshark {__version__}", keeping=keeping)
        sniffer = Sniffer([Side(port, interface, settings=settings)], [sink], limits=limits, listener=status)
        if status:
            status.show(sniffer.tally)
        return sniffer.run(stop_signals=(signal.SIGINT, signal.SIGTERM)), sink
    finally:
        port.close()


class _Status:
    """A line on the terminal that counts along, a few times a second."""

    def __init__(self) -> None:
        self._tally: Tally | None = None
        self._next = 0.0

    def show(self, tally: Tally) -> None:
        """Show this tally from now on."""
        self._tally = tally
        text = f"{counted(tally.records, 'record')}, {tally.good} good, {tally.bad} bad, {counted(tally.bytes, 'byte')}"
        print(f"\r{text}; Ctrl-C ends\x1b[K", end="", file=sys.stderr, flush=True)  # noqa: T201 - it is for the terminal

    def __call__(self, _: TimedRecord) -> None:
        now = time.monotonic()
        if self._tally and now >= self._next:
            self._next = now + STATUS_EVERY_S
            self.show(self._tally)

    def clear(self) -> None:
        """Take the line away."""
        if self._tally:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)  # noqa: T201 - it is for the terminal


def summary(tally: Tally, port: str, output: str, baud: int) -> str:
    """Say in a paragraph what was heard, and what it looks like when it looks wrong."""
    kinds = tally.kinds
    parts = [f"{tally.good} good"]
    for kind, name in (
        (Kind.BAD_CHECKSUM, "bad checksum"),
        (Kind.SHORT, "cut short"),
        (Kind.FOREIGN, "foreign"),
        (Kind.JUNK, "junk"),
    ):
        if kinds[kind]:
            parts.append(f"{kinds[kind]} {name}")
    where = "standard output" if output == "-" else output
    text = (
        f"{where}: {counted(tally.records, 'record')} ({', '.join(parts)}), {counted(tally.bytes, 'byte')} "
        f"in {tally.seconds:.1f} s from {port} at {baud} baud; ended: {tally.end}."
    )
    if not tally.bytes:
        text += " Nothing was heard: is somebody talking on this bus, and is the adapter's receiver wired to A and B?"
    elif not tally.good and tally.bytes >= 26:
        text += " No good frame: wrong baud rate, or A and B swapped?"
    return " ".join([text, *tally.notes])


def _positive(text: str) -> int:
    """Read a whole number from 1 up."""
    if not text.isascii() or not text.isdecimal() or not 0 < int(text[:19]) <= 10**18:
        message = f"{text!r} is not a whole number from 1 up"
        raise argparse.ArgumentTypeError(message)
    return int(text)


def _limit(text: str) -> tuple[str, float | int]:
    """Read one of dumpcap's stop conditions: (field of Limits, value)."""
    name, colon, value = text.partition(":")
    if colon and name == "duration":
        try:
            seconds = float(value)
        except ValueError:
            seconds = -1.0
        if 0 < seconds < 1e9:
            return name, seconds
        message = f"{value!r} is not a number of seconds above 0"
        raise argparse.ArgumentTypeError(message)
    if colon and name in {"packets", "files"}:
        return name, _positive(value)
    if colon and name == "filesize":
        return name, _positive(value) * 1000
    message = f"{text!r} is not a stop condition; use duration:SECONDS, packets:N, filesize:KB or files:N"
    raise argparse.ArgumentTypeError(message)


def _link_type(text: str) -> int:
    number = _positive(text)
    try:
        return check_link_type(number)
    except CaptureError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
