# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark check``: the Wireshark dissector against the reference decoder, field by field.

Exit status: 0 no difference, 1 differences, 2 could not run (or not to the end of a file).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from dalytools import wire_times
from dalytools.comparison import Comparison, compare
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.terminal_text import counted, plain
from dalytools.tshark import Tshark

if TYPE_CHECKING:
    import argparse

SHOWN = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Read captures twice, with tshark and our dissector and with the reference decoder, which were written apart "
        "from the same papers, and name every field in which they differ."
    )
    parser.epilog = "Exit status: 0 no difference, 1 differences, 2 could not run."
    parser.add_argument("files", nargs="+", metavar="FILE", help="capture file (pcapng or pcap)")
    parser.add_argument("-q", "--quiet", action="store_true", help="only what differs and the sum")
    wire_times.add_arguments(parser, quiet="--silence")


def run(args: argparse.Namespace) -> int:
    """Compare every file; print a line a file, each difference, and the sum."""
    worst = records = differences = compared = 0
    options = wire_times.read(args)
    with Tshark() as tshark:
        for name in args.files:
            try:
                with progress_bar(f"check {plain(Path(name).name)}") as advance:
                    result = compare(tshark, Path(name), options=options, progress=advance)
            except Problem as problem:
                print(f"dalyshark check: {plain(str(problem))}", file=sys.stderr)  # noqa: T201
                worst = 2
                continue
            show(name, result, quiet=args.quiet)
            compared += 1
            records += result.records
            differences += result.found
            if result.broken:
                said = plain(f"{result.broken}; compared what is there")
                print(f"dalyshark check: {said}", file=sys.stderr)  # noqa: T201
            worst = max(worst, 2 if result.broken else 1 if result.found else 0)
        if compared:
            print(sum_up(compared, len(args.files), records, differences, tshark.version))  # noqa: T201
    return worst


def show(name: str, result: Comparison, *, quiet: bool = False) -> None:
    """Print what came out for one file."""
    if not quiet or result.found:
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(result.kinds.items(), key=lambda item: -item[1]))
        print(f"{plain(name)}: {counted(result.records, 'record')} ({kinds}): {counted(result.found, 'difference')}")  # noqa: T201
    for difference in result.differences[:SHOWN]:
        print(f"  {plain(str(difference))}")  # noqa: T201
    if result.found > SHOWN:
        print(f"  and {result.found - SHOWN} more")  # noqa: T201


def sum_up(compared: int, asked: int, records: int, differences: int, version: str) -> str:
    """Say in a line what was compared; nothing is said of files that could not be."""
    files = counted(compared, "file") if compared == asked else f"{compared} of {counted(asked, 'file')}"
    what = f"{files}, {counted(records, 'record')}"
    return f"{what}, tshark {version}: {counted(differences, 'difference')}"
