# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark reframe``: an old capture, cut anyhow, or a raw log, becomes a capture with one packet a record.

Exit status: 0 all of it, 1 the input ends too early or is damaged (what came before is in the output), 2 could not run.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from dalycapture.create import new_capture
from dalycapture.errors import CaptureError
from dalycapture.interface import bus_name
from dalycapture.reader import read_capture
from dalycapture.reframe import Reframed, Reframer, raw_packets
from dalytools import __version__, wire_times
from dalytools.port_options import checked
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.terminal_text import counted, plain

if TYPE_CHECKING:
    import argparse
    from collections.abc import Iterator

    from dalycapture.captured import CapturedPacket


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Cut an old capture into records again, by the rules of today: pcapng, pcap, RTAC serial, packets cut "
        "anywhere; or a raw log. Times, directions, comments, events, losses and interfaces are kept. IN is only read."
    )
    parser.epilog = "Exit status: 0 all of it, 1 IN is damaged (what came before is in OUT), 2 could not run."
    parser.add_argument("input", metavar="IN", help="capture file; - is standard input")
    parser.add_argument("-w", dest="output", metavar="OUT", required=True, help="capture file; - is standard output")
    parser.add_argument("-F", dest="file_format", choices=["pcapng", "pcap"], default="pcapng", help="format of OUT")
    parser.add_argument(
        "--raw",
        action="store_true",
        help="IN is no capture but the bytes of a port, one after the other, no times",
    )
    parser.add_argument(
        "--bus",
        type=checked(bus_name),
        help="name of the bus that all interfaces of IN are on, where IN does not say (default: each is its own)",
    )
    wire_times.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Reframe; print a line of what came of it."""
    if args.output != "-" and args.input != "-" and Path(args.output).exists():
        if not Path(args.input).exists():
            raise Problem(f"{args.input}: there is no such file")
        if os.path.samefile(args.input, args.output):  # noqa: PTH121 - they are words of the user
            raise Problem("IN and OUT are the same file; the old capture is evidence, give another name with -w")
    application = f"dalyshark {__version__} reframe"
    try:
        with new_capture(args.output, args.file_format, application=application) as writer:
            writer.origin = f"reframed from {Path(args.input).name}"
            reframer = Reframer(writer, wire_times.read(args), bus=args.bus or "")
            broken = _feed(reframer, args)
            result = reframer.finish()
    except CaptureError as error:
        raise Problem(str(error)) from None
    print(_said(result, "standard output" if args.output == "-" else args.output), file=sys.stderr)  # noqa: T201
    if broken:
        print(f"dalyshark reframe: {plain(broken)}", file=sys.stderr)  # noqa: T201
    return 1 if broken else 0


def _feed(reframer: Reframer, args: argparse.Namespace) -> str:
    """Feed all packets; return what is wrong where IN breaks off. Raises CaptureError where nothing can be read."""
    packet: CapturedPacket | None = None
    with progress_bar("reframe") as advance:
        packets = _packets(reframer, args)
        while True:
            try:
                packet = next(packets, None)
            except CaptureError as error:  # of the input: the output's are raised below
                if not reframer.result.packets and not reframer.result.others:
                    if str(error).endswith("give a pcapng or pcap file"):
                        raise CaptureError(f"{error}, or --raw where it is the bytes of a port") from None
                    raise
                return f"{error}; what came before is in the output"
            if packet is None:
                return ""
            reframer.feed(packet)
            if packet.number % 1024 == 0:
                advance(packet.number)


def _packets(reframer: Reframer, args: argparse.Namespace) -> Iterator[CapturedPacket]:
    if not args.raw:
        return read_capture(args.input, reframer.told)
    if args.input == "-":
        raise Problem("--raw needs a file; - is for captures")
    return raw_packets(Path(args.input), wire_times.read(args), reframer.told)


def _said(result: Reframed, where: str) -> str:
    kinds = ", ".join(f"{count} {kind}" for kind, count in result.kinds.most_common())
    text = f"{where}: {counted(result.packets, 'packet')} became {counted(result.records, 'record')}"
    text += f" ({kinds})" if kinds else ""
    text += f", {counted(result.bytes, 'byte')}"
    if result.events:
        text += f"; {counted(result.events, 'event')}"
    if result.others:
        text += f"; {counted(result.others, 'packet')} of other link types as they were"
    return plain(text)
