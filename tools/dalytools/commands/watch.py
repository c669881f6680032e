# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark watch``: sniff a bus, keep the capture, show every record decoded by tshark as it comes, sum up, check.

    bus --> sniffer --+--> capture file --> summary, check
                      +--> tshark with our dissector --> a line a record, or
                      +--> dashboard

Without a port it watches a simulated bus: a real session first, then boards that are simulated.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import os
import signal
import sys
import time
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from dalycapture.create import open_writer
from dalycapture.errors import CaptureError
from dalycapture.interface import bus_name
from dalycapture.reader import read_capture
from dalycapture.rotation import FileSeries
from dalycapture.sniffer import End, Sniffer, Tally
from dalyref.decoder import Options, decode
from dalytools import __version__, file_options, stop_options
from dalytools.capture_summary import side_sentences, write_statistics
from dalytools.commands.check import SHOWN
from dalytools.comparison import compare
from dalytools.dashboard.status import Key, Status
from dalytools.dashboard.view import DashboardView, has_screen
from dalytools.keys import Keys
from dalytools.listening import Tap, add_listening_options, named, open_sides, taps_of
from dalytools.live_view import LiveView
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.summary import Summary
from dalytools.terminal_text import counted, plain
from dalytools.tshark import Tshark, dissector_folder

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Iterator, Sequence

    from dalycapture.captured import CapturedPacket
    from dalycapture.rotation import Keeping
    from dalycapture.sniffer import Limits
    from dalycapture.writer import CaptureWriter
    from dalytools.simulator.live import SimulatedBus
    from dalytools.simulator.scenario import Scenario

SIMULATED_S = 20.0
FOLDER = "captures"
APPLICATION = f"dalyshark {__version__}"

_COLOURS = (  # of a line, by what is in it: terminal colours (SGR)
    ("Event", "1;33"),
    ("Bad checksum", "1;31"),
    ("Cut-off", "31"),
    ("Junk", "90"),
    ("Not Daly", "34"),
    ("Echo ", "33"),
    ("[retry]", "33"),
    ("Request ", "36"),
    ("Modbus ", "35"),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Listen to a Daly bus, write the capture file and show every record as it comes, decoded by tshark. "
        "Ctrl-C ends it. Nothing is sent to the bus. Without PORT: a simulated bus, for 20 s."
    )
    parser.epilog = "Exit status: 0 fine, 1 the two decoders differ, 2 could not run or the port was lost."
    parser.add_argument("-w", dest="output", metavar="FILE", help="capture file (default: captures/daly-TIME.pcapng)")
    parser.add_argument("--duration", type=stop_options.seconds, metavar="S", help="the same as -a duration:S")
    stop_options.add_arguments(parser)
    parser.add_argument("--bus", default="main", help="name of the bus (default: %(default)s)")
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument(
        "--dashboard",
        action="store_true",
        help="a screen instead of lines: boards, cells, faults, the bus; its keys: m marks, p pauses, Tab goes to the "
        "next board, q ends. Where standard output is no terminal: lines",
    )
    shown.add_argument("-q", "--quiet", action="store_true", help="do not show records, only the summary")
    parser.add_argument("--stats", metavar="FILE", help="write what was heard as JSON, at the end")
    add_listening_options(parser)
    file_options.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Watch until Ctrl-C, SIGTERM, the time is over or the port is lost; sum up and check."""
    limits, files = stop_options.read(args)
    keeping = file_options.read(args, stop_after=files)
    if keeping.rotation.printname == "-":
        raise Problem("standard output shows the records, so printname:- is not possible; name a file")
    try:
        bus_name(args.bus)
        path = _output(args.output)
        screen = _Screen()
        with Tshark() as tshark:
            bus = None if taps_of(args) else _simulated_bus(args.baud)
            duration = args.duration or limits.duration or (SIMULATED_S if bus else None)
            limits = dataclasses.replace(limits, duration=duration)
            tally, sink = _watch(args, tshark, screen, bus=bus, path=path, keeping=keeping, limits=limits)
            paths = sink.output.paths if isinstance(sink.output, FileSeries) else [path]
            tally.notes += sink.notes
            if args.stats:
                write_statistics(args.stats, tally, {"output": str(path)})
            if screen.failure:
                return _unseen(screen.failure, paths[-1])
            return _sum_up(tshark, paths, tally, sink, Options(baud=args.baud))
    except CaptureError as error:
        raise Problem(str(error)) from None


def _simulated_bus(baud: int) -> SimulatedBus:
    """Return a bus that is silent until it is entered: nothing is said before somebody listens."""
    from dalytools.simulator.live import SimulatedBus

    session = _real_session()
    first = "First a real session is played back, then simulated boards take over." if session else ""
    print(f"No PORT given: a simulated bus. {first}".rstrip())  # noqa: T201
    bus = SimulatedBus(_scenario(baud), replay=session)
    print(f"Clients can talk to these boards on {bus.client}")  # noqa: T201
    return bus


def _scenario(baud: int) -> Scenario:
    """Two boards, one of which has a fault that comes and goes."""
    from dalytools.simulator.scenario import Board, Event, Pack, Scenario

    return Scenario(
        baud=baud,
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
    """Return where the capture goes: the file asked for, else a new one in the folder captures."""
    if asked == "-":
        raise Problem("watch keeps a file of evidence, so -w - is not possible; use: dalyshark capture PORT -w -")
    if asked:
        return Path(asked)
    stem = time.strftime("daly-%Y%m%d-%H%M%S")
    names = (f"{stem}{f'-{number}' if number else ''}.pcapng" for number in itertools.count())
    return next(path for name in names if not (path := Path(FOLDER, name)).exists())


def _watch(
    args: argparse.Namespace,
    tshark: Tshark,
    screen: _Screen,
    *,
    bus: SimulatedBus | None,
    path: Path,
    keeping: Keeping,
    limits: Limits,
) -> tuple[Tally, CaptureWriter]:
    taps = [Tap("", bus.tap)] if bus else taps_of(args)
    with contextlib.ExitStack() as stack:
        sides = open_sides(args, taps)
        for side in sides:
            stack.callback(side.close)
        if not args.output:
            _make_folder(path.parent)
        sink = open_writer(path, application=APPLICATION, keeping=keeping)
        sinks = [sink]
        until = f"for {limits.duration:g} s" if limits.duration else "until Ctrl-C"
        said = plain(f"Listening to {named(taps)} at {args.baud} baud {until}; writing {sink.output.name}")
        screen(f"{said}\n")
        view, faults = None, list[str]()

        def ended(why: str) -> None:
            faults.append(f"the live view broke off, the capture did not: {why}")
            print(f"dalyshark watch: {faults[-1]}", file=sys.stderr)  # noqa: T201

        dashboard = None
        if args.dashboard and has_screen():
            view = dashboard = DashboardView(ended, baud=args.baud, application=APPLICATION)
        elif not args.quiet:
            if args.dashboard:
                print("dalyshark watch: no terminal for a dashboard: lines instead", file=sys.stderr)  # noqa: T201
            view = LiveView(
                tshark,
                screen,
                ended,
                options=Options(baud=args.baud),
                link_type=sides[0].interface.link_type,
                application=APPLICATION,
            )
        if view:
            stack.callback(view.finish)
            sinks.append(view.sink)
        ticker = _teller(dashboard, named(taps), args.baud, sink) if dashboard else None
        sniffer = Sniffer(sides, sinks, limits=limits, ticker=ticker, verbose=args.verbose)
        stack.enter_context(Keys(sniffer.mark, _keys(dashboard, sniffer) if dashboard else None))
        screen.when_gone = sniffer.stop
        if screen.failure:  # nobody reads already
            sniffer.stop()
        if bus:
            stack.enter_context(bus)
        tally = sniffer.run(stop_signals=(signal.SIGINT, signal.SIGTERM), user_signals=True)
    if view and view.sink.failure:  # `ended` has told it better
        with contextlib.suppress(ValueError):
            tally.notes.remove(str(view.sink.broken()))
    tally.notes += faults
    return tally, sink


def _teller(dashboard: DashboardView, ports: str, baud: int, sink: CaptureWriter) -> Callable[[Tally], None]:
    """Return what tells the dashboard, a few times a second, how the capture goes."""

    def tell(tally: Tally) -> None:
        dashboard.tell(
            Status(
                port=ports,
                baud=baud,
                file=sink.output.name,
                seconds=tally.seconds,
                records=tally.records,
                marks=tally.marks,
                written=sink.output.size,
                lost=sink.lost + sum(side.lost for side in tally.sides),
                away=[side.name for side in tally.sides if side.away],
            )
        )

    return tell


def _keys(dashboard: DashboardView, sniffer: Sniffer) -> Callable[[str], None]:
    """Return what takes a key: q ends the capture, the rest is for the dashboard."""

    def pressed(key: str) -> None:
        if key in {"q", "Q"}:
            sniffer.stop()
        else:
            dashboard.tell(Key(key))

    return pressed


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise Problem(f"cannot make the folder {folder} here ({error.strerror}); name a file: -w FILE") from None


class _Screen:
    """Prints lines: in colour on a terminal, unless NO_COLOR is set. ``when_gone`` is called when nobody reads them."""

    def __init__(self) -> None:
        self.failure: OSError | None = None
        self.when_gone: Callable[[], None] = lambda: None
        dumb = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
        self._coloured = sys.stdout.isatty() and not dumb

    def __call__(self, line: str) -> None:
        if self.failure:
            return
        try:
            print(f"\x1b[{colour}m{line}\x1b[m" if (colour := self._colour(line)) else line, flush=True)  # noqa: T201
        except OSError as error:
            self.failure = error
            self.when_gone()

    def _colour(self, line: str) -> str:
        if not self._coloured:
            return ""
        if "Faults: " in line and not line.endswith("Faults: none"):
            return "1;31"
        return next((colour for word, colour in _COLOURS if word in line), "")


def _unseen(failure: OSError, path: Path) -> int:
    """Say the rest to standard error, as standard output is gone."""
    why = f"standard output: {(failure.strerror or str(failure)).lower()}; the capture ended and is in {path}"
    if not isinstance(failure, BrokenPipeError):
        raise Problem(why)
    print(f"dalyshark watch: {plain(why)}", file=sys.stderr)  # noqa: T201
    raise failure  # its usual end: status 0


def _sum_up(tshark: Tshark, paths: Sequence[Path], tally: Tally, sink: CaptureWriter, options: Options) -> int:
    """Print the summary of the files just written, the verdict of both readings, and where they are."""
    summary = Summary()
    with progress_bar("reading") as advance:
        for record in decode(_packets(paths), options):
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
    for sentence in (sentence for side in tally.sides for sentence in side_sentences(side)):
        print(f"  {plain(sentence)}")  # noqa: T201
    for note in tally.notes:
        print(f"  Note: {plain(note)}")  # noqa: T201
    differences = _checked(tshark, paths, options) if tally.records else 0
    where = plain(str(paths[-1]))
    several = f", the last of {len(paths)}: {plain(str(paths[0]))} and so on" if len(paths) > 1 else ""
    print(f"\nThe capture: {where}{several}")  # noqa: T201
    print(f"Open it:     wireshark -X lua_script:{dissector_folder() / 'daly.lua'} {where}")  # noqa: T201
    if sink.lost:
        raise Problem(
            f"{counted(sink.lost, 'record')} of {tally.records} could not be written: {'; '.join(sink.notes)}"
        )
    if tally.end is End.PORT_LOST:
        raise Problem(tally.problem)
    return 1 if differences else 0


def _packets(paths: Sequence[Path]) -> Iterator[CapturedPacket]:
    """Yield the packets of a series of files, numbered on."""
    number = 0
    for path in paths:
        for packet in read_capture(path):
            number += 1
            yield dataclasses.replace(packet, number=number)


def _checked(tshark: Tshark, paths: Sequence[Path], options: Options) -> int:
    """Compare both readings of each file; print and return how many differences there are."""
    records = found = 0
    shown: list[str] = []
    broken = ""
    try:
        for path in paths:
            with progress_bar("check") as advance:
                result = compare(tshark, path, options=options, progress=advance)
            records += result.records
            found += result.found
            shown += [str(difference) for difference in result.differences[: SHOWN - len(shown)]]
            if result.broken:
                broken = f"the check broke off: {result.broken}; the capture is in {path}"
                break
    except KeyboardInterrupt:
        print(f"\nCheck: left out, as you wish; later: dalyshark check {paths[-1]}")  # noqa: T201
        return 0
    print(  # noqa: T201
        f"\nCheck: dissector (tshark {tshark.version}) against reference decoder, "
        f"{counted(records, 'record')}: {counted(found, 'difference')}"
    )
    for difference in shown:
        print(f"  {plain(difference)}")  # noqa: T201
    if broken:
        raise Problem(broken)
    return found
