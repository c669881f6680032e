# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark capture``: sniff a bus to a file or a pipe. It listens only; nothing is ever sent to the bus."""

from __future__ import annotations

import argparse
import contextlib
import signal
import sys
from typing import TYPE_CHECKING

from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import bus_name
from dalycapture.linktype import DEFAULT_LINK_TYPE, check_link_type
from dalycapture.rotation import FileSeries
from dalycapture.sniffer import End, Sniffer, Tally
from dalycapture.writer import counted
from dalytools import __version__, file_options, stop_options
from dalytools.adapter_list import list_adapters
from dalytools.capture_summary import summary, write_statistics
from dalytools.detection import detect_settings
from dalytools.keys import Keys
from dalytools.listening import Tap, add_listening_options, named, open_sides, taps_of
from dalytools.port_options import checked, settings_of
from dalytools.problem import Problem
from dalytools.status_line import StatusLine
from dalytools.stop_options import positive

if TYPE_CHECKING:
    from dalycapture.rotation import Keeping
    from dalycapture.sniffer import Limits
    from dalycapture.writer import CaptureWriter


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Listen to a serial port and write every record to a capture file. Ctrl-C ends it. Nothing is sent to the bus."
    )
    parser.epilog = (
        "While it runs: m or Enter, or the signal SIGUSR2, puts a mark of yours into the file; SIGUSR1 begins the next "
        "file. Exit status: 0 fine, 2 could not run, records were lost, or the port went away for good."
    )
    parser.add_argument("--list", action="store_true", help="list the serial adapters, without opening any, and end")
    parser.add_argument(
        "--detect",
        action="store_true",
        help="find the speed and format of PORT by listening (24 s at most where nothing is heard), and end",
    )
    parser.add_argument("-w", dest="output", metavar="FILE", help="capture file; - is standard output")
    stop_options.add_arguments(parser)
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
    parser.add_argument("--stats", metavar="FILE", help="write the summary as JSON, at the end")
    add_listening_options(parser)
    file_options.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Capture until Ctrl-C, SIGTERM, a limit or the end of the port."""
    if args.list:
        return list_adapters()
    taps = taps_of(args)
    if not taps:
        raise Problem("say which PORT to listen to; dalyshark capture --list shows what is there")
    if args.detect:
        if len(taps) != 1:
            raise Problem("--detect listens to one PORT")
        try:
            return detect_settings(taps[0].port, settings_of(args))
        except CaptureError as error:
            raise Problem(str(error)) from None
    if not args.output:
        raise Problem("say where the capture goes: -w FILE, or -w - for standard output")
    limits, files = stop_options.read(args)
    try:
        tally, sink = _capture(args, taps, limits, file_options.read(args, stop_after=files))
    except CaptureError as error:
        raise Problem(str(error)) from None
    tally.notes += sink.notes
    if not args.quiet:
        print(summary(tally, named(taps), _where(sink, args.output), args.baud), file=sys.stderr)  # noqa: T201 - for the terminal
    if args.stats:
        write_statistics(args.stats, tally, {"output": args.output})
    if sink.lost:
        raise Problem(
            f"{counted(sink.lost, 'record')} of {tally.records} could not be written: {'; '.join(sink.notes)}"
        )
    if tally.end is End.PORT_LOST:
        raise Problem(tally.problem)
    return 0


def _capture(
    args: argparse.Namespace, taps: list[Tap], limits: Limits, keeping: Keeping
) -> tuple[Tally, CaptureWriter]:
    with contextlib.ExitStack() as stack:
        sides = open_sides(args, taps)
        for side in sides:
            stack.callback(side.close)
        # After the port: a wrong port does not cost an older capture of the same name.
        sink = open_writer(args.output, args.file_format, application=f"dalyshark {__version__}", keeping=keeping)
        status = None if args.quiet or not sys.stderr.isatty() else StatusLine()
        sniffer = Sniffer(sides, [sink], limits=limits, ticker=status, verbose=args.verbose)
        if status:
            stack.callback(status.clear)
            keys = stack.enter_context(Keys(sniffer.mark))
            status.hint = f"  {'m marks, ' if keys.there else ''}Ctrl-C ends"
        return sniffer.run(stop_signals=(signal.SIGINT, signal.SIGTERM), user_signals=True), sink


def _where(sink: CaptureWriter, asked: str) -> str:
    """Name the file that was written; of several the last."""
    output = sink.output
    if not isinstance(output, FileSeries) or output.name == asked:
        return asked
    return f"{output.name}, the last of {counted(output.number, 'file')}"


def _link_type(text: str) -> int:
    number = positive(text)
    try:
        return check_link_type(number)
    except CaptureError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
