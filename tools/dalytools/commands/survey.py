# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark survey``: which IDs and registers were seen, which bytes move, and with what."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from dalyref.decoder import Decoder
from dalytools import wire_times
from dalytools.findings.table import console
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.survey import as_json, difference_listing, page
from dalytools.survey.difference import difference
from dalytools.survey.findings import findings
from dalytools.survey.listing import Listing
from dalytools.survey.survey import Survey
from dalytools.survey.wanted import Wanted
from dalytools.terminal_text import plain
from dalytools.whole_file import whole_file
from dalytools.wires import choice, left_out
from dalytools.wires.carried import carried
from dalytools.wires.carriers import Carriers

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from dalyref.decoder import Decoded
    from dalyref.options import Options
    from dalytools.survey.difference import Difference
    from dalytools.survey.findings import Finding
    from dalytools.wires.choice import Choice


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "For finding out what nobody documented: for every board, ID or register and direction, how often and how "
        "evenly it comes, which bits move, which bytes count, hold one number, text or a clock, copy another frame, "
        "or move with a quantity that is known. What is not sure is not said."
    )
    parser.epilog = "Exit status: 0 surveyed, 2 could not run, or a file did not read to its end (what did is shown)."
    parser.add_argument("files", nargs="*", metavar="FILE", help="capture file, or a log of candump -L")
    parser.add_argument("--diff", nargs=2, metavar=("A", "B"), help="instead: what is different in B")
    Wanted.add_arguments(parser)
    parser.add_argument("-o", "--output", metavar="OUT.html", help="write a page to look at, instead of the listing")
    parser.add_argument("--json", metavar="OUT", help="all of it for programs; - is standard output")
    parser.add_argument("--no-colour", "--no-color", action="store_true", help="as NO_COLOR=1 does")
    choice.add_arguments(parser)
    wire_times.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Survey all files together, or each of two for their difference."""
    files: list[str] = args.diff or args.files
    if args.diff and args.files:
        raise Problem("--diff compares two captures; name no other")
    if not files:
        raise Problem("name a capture, or two behind --diff")
    outputs: list[str] = [name for name in (args.output, args.json) if name and name != "-"]
    for output in outputs:
        if os.path.realpath(output) in {os.path.realpath(name) for name in files}:
            raise Problem(f"{output} is one of the captures; name another file")
    if args.output and args.json and os.path.realpath(args.output) == os.path.realpath(args.json):
        raise Problem("both -o and --json would write that file; give one of them another")
    wanted = Wanted.read(args)
    problems: list[str] = []
    sets = [[name] for name in files] if args.diff else [files]
    surveys = [surveyed(some, wire_times.read(args), problems, choice.read(args)) for some in sets]
    for problem in problems:
        print(f"dalyshark survey: {plain(problem)}", file=sys.stderr)  # noqa: T201
    for some, survey in zip(sets, surveys, strict=True):
        if not survey.streams and problems:
            return 2
        if not survey.streams:
            raise Problem(f"{', '.join(some)}: no good frame of a Daly bus in what was read")
    found = [findings(survey, wanted.place) for survey in surveys]
    # of two, a place is wanted for what it is in either: else what moves in one alone would look as if it had gone
    kept = {one.place.off_bus() for some in found for one in some if wanted.finding(one)}
    found = [[one for one in some if one.place.off_bus() in kept] for some in found]
    if not any(found):
        raise Problem("nothing of what was read is what was asked for")
    names = [Path(name).name for name in files]
    if args.diff:
        _show_difference(args, difference(found[0], found[1]), names)
    else:
        _show(args, surveys[0], found[0], names)
    return 2 if problems else 0


def _show(args: argparse.Namespace, survey: Survey, found: list[Finding], names: list[str]) -> None:
    """Put a survey out, in each form that was asked for."""
    if args.json:
        _write(args.json, as_json.text(survey, found, names))
    if args.output:
        _write(args.output, page.survey_page(survey, found, names))
    if not args.output and args.json != "-":
        to = console(sys.stdout, colour=False if args.no_colour else None)
        Listing(to).show(survey, found, several_buses=len({one.place.bus for one in found}) > 1)


def _show_difference(args: argparse.Namespace, found: Difference, names: list[str]) -> None:
    """Put a difference out, in each form that was asked for."""
    if args.json:
        _write(args.json, difference_listing.text(found, names))
    if args.output:
        _write(args.output, page.difference_page(found, names))
    if not args.output and args.json != "-":
        difference_listing.show(found, names, console(sys.stdout, colour=False if args.no_colour else None))


def _write(output: str, text: str) -> None:
    if output == "-":
        sys.stdout.write(text)
        return
    with whole_file(output) as out:
        out.write(text)


def surveyed(files: Sequence[str], options: Options, problems: list[str], wires: Choice | None = None) -> Survey:
    """Survey files behind each other; what is wrong with one is appended to `problems`."""
    survey = Survey()
    for name in files:
        _read(name, options, wires, survey, problems)
    survey.finish()
    return survey


def _read(name: str, options: Options, wires: Choice | None, survey: Survey, problems: list[str]) -> None:
    decoder, carriers = Decoder(options), Carriers(wires)

    def take(records: list[Decoded]) -> None:
        for record in records:
            survey.add(record)

    with progress_bar(f"survey {plain(Path(name).name)}") as advance:
        for carrier in carried(name, carriers, problems, advance=advance):
            survey.packet(carrier)
            take(decoder.feed(carrier))
        take(decoder.finish())
        survey.end_of_file()
    left_out.say("survey", name, carriers.left_out)
