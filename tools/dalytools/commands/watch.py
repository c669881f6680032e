# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark watch``: sniff a bus, keep the capture, show every record decoded by tshark as it comes, sum up, check.

    bus --> sniffer --+--> capture file --> summary, check
                      +--> tshark with our dissector --> a line a record

Without a port it watches a simulated bus: a real session first, then boards that are simulated.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import time
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import bus_name, tap
from dalycapture.port import open_port
from dalycapture.reader import read_capture
from dalycapture.sniffer import End, Limits, Sniffer, Tally
from dalyref.decoder import decode
from dalytools import __version__
from dalytools.commands.check import SHOWN, counted
from dalytools.comparison import compare
from dalytools.live_view import LiveView
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.summary import Summary
from dalytools.terminal_text import plain
from dalytools.tshark import Tshark, dissector_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dalytools.simulator.scenario import Scenario

SIMULATED_S = 20.0
APPLICATION = f"dalyshark {__version__}"

_COLOURS = (  # of a line, by what is in it
    ("Bad checksum", "bold red"),
    ("Cut-off", "red"),
    ("Junk", "bright_black"),
    ("Not Daly", "blue"),
    ("Event", "bold yellow"),
    ("Echo ", "yellow"),
    ("[retry]", "yellow"),
    ("Request ", "cyan"),
    ("Modbus ", "magenta"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Listen to a Daly bus, write the capture file and show every record as it comes, decoded by tshark. "
        "Ctrl-C ends it. Nothing is sent to the bus. Without PORT: a simulated bus, for 20 s."
    )
    parser.epilog = "Exit status: 0 fine, 1 the two decoders differ, 2 could not run or the port was lost."
    parser.add_argument(
        "port", metavar="PORT", nargs="?", help="device, socket://HOST:PORT or rfc2217://HOST:PORT"
    )
    parser.add_argument("-w", dest="output", metavar="FILE", help="capture file (default: captures/daly-TIME.pcapng)")
    parser.add_argument("--duration", type=_seconds, metavar="S", help="stop after so many seconds")
    parser.add_argument("--baud", type=_baud, default=9600, help="bits per second (default: %(default)s)")
    parser.add_argument("--bus", default="main", help="name of the bus (default: %(default)s)")
    parser.add_argument("-q", "--quiet", action="store_true", help="do not show records, only the summary")


def run(args: argparse.Namespace) -> int:
    """Watch until Ctrl-C, SIGTERM, the time is over or the port is lost; sum up and check."""
    try:
        bus_name(args.bus)
        path = _output(args.output)
        with Tshark() as tshark:
            with _bus(args.port) as (port_name, simulated):
                duration = args.duration or (SIMULATED_S if simulated else None)
                tally = _watch(args, tshark, port_name, path, duration)
            return _sum_up(tshark, path, tally)
    except CaptureError as error:
        raise Problem(str(error)) from None


@contextlib.contextmanager
def _bus(port: str | None) -> Iterator[tuple[str, bool]]:
    """Give the port to listen to, and whether it is a simulated one, which runs as long as this lasts."""
    if port is not None:
        yield port, False
        return
    from dalytools.simulator.live import SimulatedBus

    print("No PORT given: a simulated bus. First a real session is played back, then simulated boards take over.")  # noqa: T201
    bus = SimulatedBus(_scenario(), replay=_real_session())
    with bus:
        print(f"Clients can talk to these boards on {bus.client}")  # noqa: T201
        yield bus.tap, True


def _scenario() -> Scenario:
    """Two boards, one of which has a fault that comes and goes."""
    from dalytools.simulator.scenario import Board, Event, Pack, Scenario

    return Scenario(
        boards=(
            Board(1, pack=Pack(cells=16, sensors=2, speed=4)),
            Board(2, pack=Pack(cells=8, sensors=1, start_soc=80.0, speed=4)),
        ),
        events=(
            Event(4.0, "fault", 2, "cell_volt_high_level_1"),
            Event(10.0, "clear", 2, "cell_volt_high_level_1"),
        ),
    )


def _real_session() -> Path | None:
    """Return the capture of a real poll cycle: in an installed package, else in the repository; None: not there."""
    name = "real-poll-cycle.pcapng"
    for folder in (
        Path(str(resources.files("dalytools"))) / "samples",
        Path(__file__).resolve().parents[3] / "pcap_samples",
    ):
        if (folder / name).is_file():
            return folder / name
    return None


def _output(asked: str | None) -> Path:
    if asked == "-":
        raise Problem("watch keeps a file of evidence, so -w - is not possible; use: dalyshark capture PORT -w -")
    if asked:
        return Path(asked)
    folder = Path("captures")
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise Problem(f"cannot make the folder captures here ({error.strerror}); name a file: -w FILE") from None
    stem = time.strftime("daly-%Y%m%d-%H%M%S")
    number = 0
    while True:
        path = folder / f"{stem}{f'-{number}' if number else ''}.pcapng"
        if not path.exists():
            return path
        number += 1


def _watch(args: argparse.Namespace, tshark: Tshark, port_name: str, path: Path, duration: float | None) -> Tally:
    port = open_port(port_name, args.baud)
    with contextlib.ExitStack() as stack:
        stack.callback(port.close)
        interface = tap(port_name, bus=args.bus, baud=args.baud, hardware=port.hardware)
        file = open_writer(path, application=APPLICATION)
        sinks = [file]
        view = None
        if not args.quiet:
            view = LiveView(tshark, _printer(), link_type=interface.link_type, application=APPLICATION)
            sinks.append(view.sink)
        until = f"for {duration:g} s" if duration else "until Ctrl-C"
        print(f"Listening to {port_name} at {args.baud} baud {until}; writing {path}\n", flush=True)  # noqa: T201
        sniffer = Sniffer(port, interface, sinks, limits=Limits(duration=duration))
        tally = sniffer.run(stop_signals=(signal.SIGINT, signal.SIGTERM))
        if view:
            complaint = view.finish()
            if complaint:
                tally.notes.append(complaint)
    return tally


def _printer() -> Callable[[str], None]:
    """Return what prints a line: in colour on a terminal, unless NO_COLOR is set."""
    if not sys.stdout.isatty() or os.environ.get("NO_COLOR"):
        return lambda line: print(line, flush=True)  # noqa: T201
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False, soft_wrap=True)

    def show(line: str) -> None:
        style = next((colour for word, colour in _COLOURS if word in line), "")
        if not style and "Faults: " in line and not line.endswith("Faults: none"):
            style = "bold red"
        console.print(Text(line, style=style))

    return show


def _sum_up(tshark: Tshark, path: Path, tally: Tally) -> int:
    """Print the summary of the file just written, the verdict of both readings, and where it is."""
    summary = Summary()
    with progress_bar("reading") as advance:
        for record in decode(read_capture(path)):
            summary.add(record)
            if record.number % 1024 == 0:
                advance(record.number)
    print(f"\nSummary of {tally.seconds:.1f} s, {tally.bytes} bytes; ended: {tally.end}")  # noqa: T201
    for line in summary.lines():
        print(f"  {plain(line)}")  # noqa: T201
    if not tally.bytes:
        print("  Nothing was heard: is somebody talking on this bus, and is the adapter wired to A and B?")  # noqa: T201
    elif not tally.good and tally.bytes >= 26:
        print("  No good frame: wrong baud rate, or A and B swapped?")  # noqa: T201
    for note in tally.notes:
        print(f"  Note: {plain(note)}")  # noqa: T201
    differences = 0
    if tally.records:
        with progress_bar("check") as advance:
            result = compare(tshark, path, progress=advance)
        differences = result.found
        print(  # noqa: T201
            f"\nCheck: dissector (tshark {tshark.version}) against reference decoder, {result.records} records: "
            f"{counted(differences)}"
        )
        for difference in result.differences[:SHOWN]:
            print(f"  {plain(str(difference))}")  # noqa: T201
    print(f"\nThe capture: {path}")  # noqa: T201
    print(f"Open it:     wireshark -X lua_script:{dissector_folder() / 'daly.lua'} {path}")  # noqa: T201
    if tally.end is End.PORT_LOST:
        raise Problem(tally.problem)
    return 1 if differences else 0


def _baud(text: str) -> int:
    if not text.isascii() or not text.isdecimal() or not 0 < int(text[:9]) <= 10**8:
        message = f"{text!r} is not a baud rate, such as 9600"
        raise argparse.ArgumentTypeError(message)
    return int(text)


def _seconds(text: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0 < seconds < 1e9:
        message = f"{text!r} is not a number of seconds above 0"
        raise argparse.ArgumentTypeError(message)
    return seconds
