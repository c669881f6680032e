# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark report``: a page to look at, of one capture or several, in one file that opens offline."""

from __future__ import annotations

import math
import os
import sys
from contextlib import nullcontext
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING

from dalycapture.errors import CaptureError
from dalycapture.reader import read_capture
from dalyref.decoder import Decoder
from dalytools import wire_times
from dalytools.extra import missing
from dalytools.findings.limits import Limits
from dalytools.findings.search import Search
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.report.collect import NANO, Collected
from dalytools.report.page import page
from dalytools.terminal_text import plain
from dalytools.whole_file import whole_file
from dalytools.wires import choice, left_out
from dalytools.wires.carried import carried
from dalytools.wires.carriers import Carriers

if TYPE_CHECKING:
    import argparse

    from dalyref.decoder import Decoded
    from dalytools.findings.finding import Finding


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = "Write a page with plots and tables of captures: one HTML file, opens offline in any browser."
    parser.epilog = "Exit status: 0 written, 2 could not run, or a file did not read to its end (what did is shown)."
    parser.add_argument("files", nargs="+", metavar="FILE", help="capture files; they are read in the order of time")
    parser.add_argument("-o", "--output", metavar="OUT.html", required=True, help="page to write; - is standard output")
    parser.add_argument("--title", help="heading of the page (the files' names)")
    choice.add_arguments(parser)
    wire_times.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Read all files, write the page."""
    library = _library()
    files: list[str] = args.files
    output: str = args.output
    if os.path.realpath(output) in {os.path.realpath(name) for name in files}:
        raise Problem(f"{output} is one of the captures; name another file with -o")
    collected = Collected()
    found: list[tuple[str, Finding]] = []
    problems: list[str] = []
    for begins_ns, name in _by_time(files):
        if collected.records and begins_ns < collected.begin_ns + int(collected.end * NANO):
            said = f"{plain(name)} begins before the capture in front of it ends"
            print(f"dalyshark report: {said}: values of one board share a line", file=sys.stderr)  # noqa: T201
        search = Search(Limits())
        _read(name, args, collected, search, problems)
        found += [(Path(name).name if len(files) > 1 else "", finding) for finding in search.findings()]
    if len(problems) == len(files) == 1 and not collected.records:
        raise Problem(problems[0])
    for problem in problems:
        print(f"dalyshark report: {plain(problem)}", file=sys.stderr)  # noqa: T201
    if not collected.records:
        raise Problem("no record of a Daly bus in what was read, so no page was written")
    collected.finish()
    title: str = args.title or ", ".join(Path(name).name for name in files[:3]) + (" ..." if len(files) > 3 else "")
    with nullcontext(sys.stdout) if output == "-" else whole_file(output) as out:
        out.write(page(title, collected, found, library))
    return 2 if problems else 0


def _by_time(files: list[str]) -> list[tuple[float, str]]:
    """Return the files in the order of their first packets, with its time, ns; a pipe among them leaves all be."""
    if len(files) == 1 or not all(Path(name).is_file() or not Path(name).exists() for name in files):
        return [(math.inf, name) for name in files]
    return sorted(((_begins_ns(name), name) for name in files), key=itemgetter(0))


def _begins_ns(name: str) -> float:
    try:
        return next((packet.time_ns for packet in read_capture(name)), math.inf)
    except CaptureError:
        return math.inf  # said when it is read


def _read(name: str, args: argparse.Namespace, collected: Collected, search: Search, problems: list[str]) -> None:
    """Read one file; what is wrong with it is appended to `problems`."""
    decoder, carriers = Decoder(wire_times.read(args)), Carriers(choice.read(args))

    def take(records: list[Decoded]) -> None:
        for record in records:
            collected.add(record)
            search.record(record)

    with progress_bar(f"report {plain(Path(name).name)}") as advance:
        for carrier in carried(name, carriers, problems, packet=search.packet, advance=advance):
            take(decoder.feed(carrier))
        take(decoder.finish())
    left_out.say("report", name, carriers.left_out)


def _library() -> str:
    """Return plotly.js, which comes with the Python package."""
    try:
        from plotly.offline import get_plotlyjs
    except ImportError:
        raise missing("plots need", "plotly", "report") from None
    return str(get_plotlyjs())
