# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark redact``: a copy of a capture that can be shown to others.

Exit status: 0 all of it, 1 the input ends too early or is damaged (what came before is in the output), 2 could not run.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from dalytools import wire_times
from dalytools.findings.table import console
from dalytools.problem import Problem
from dalytools.redact.copy import redact
from dalytools.redact.what import DATES, What
from dalytools.terminal_text import counted, plain
from dalytools.whole_file import whole_file

if TYPE_CHECKING:
    import argparse

    from rich.console import Console

    from dalytools.redact.copy import Redacted

_KEEP: Final = {
    "dates": DATES,
    "damaged": frozenset((What.DAMAGED,)),
    "unknown": frozenset((What.UNKNOWN, What.FOREIGN, What.OLDER)),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Write a copy of a capture that is fit to be shown to others: battery codes, serial numbers, passwords, names, "
        "dates, positions are blanked, and every byte that nobody explains; comments, names of interfaces and "
        "all that is no packet are left out. Packets, times, lengths and right check bytes stay. IN is only read."
    )
    parser.epilog = (
        "The copy is read again before it gets its name. It can not promise that no value tells who you are: look "
        "at it. Exit status: 0 all of it, 1 IN is damaged (what came before is in OUT), 2 could not run."
    )
    parser.add_argument("input", metavar="IN", help="capture file, or a log of candump -L")
    parser.add_argument("-w", dest="output", metavar="OUT", required=True, help="pcapng file to write")
    parser.add_argument(
        "--keep",
        action="append",
        default=[],
        choices=list(_KEEP),
        metavar="WHAT",
        help="do not blank: dates; damaged (junk, cut-off frames, wrong checksums); unknown (IDs, registers and "
        "protocols that nobody explains). Texts in what is damaged or unknown are blanked all the same; repeatable",
    )
    parser.add_argument("--json", metavar="FILE", help="what was blanked, for programs; - is standard output")
    wire_times.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Redact; print what was blanked."""
    source: str = args.input
    target: str = args.output
    if source == "-" or target == "-":
        raise Problem("redact reads and proves files; give IN and OUT names")
    _refuse_same(source, target, args.json)
    kept = frozenset[What]().union(*(_KEEP[word] for word in args.keep))
    result = redact(source, target, wire_times.read(args), kept)
    document = json.dumps(_document(result, source, target), indent=2) + "\n"
    if args.json == "-":
        sys.stdout.write(document)
    else:
        if args.json:
            with whole_file(args.json) as out:
                out.write(document)
        _show(result, target, console(sys.stdout))
    if result.broken:
        print(f"dalyshark redact: {plain(result.broken)}; what came before is in the output", file=sys.stderr)  # noqa: T201
    return 1 if result.broken else 0


def _refuse_same(source: str, target: str, report: str | None) -> None:
    if not Path(source).exists():
        raise Problem(f"{source}: there is no such file")
    if Path(target).exists() and os.path.samefile(source, target):  # noqa: PTH121 - they are words of the user
        raise Problem("IN and OUT are the same file; the capture is evidence, give another name with -w")
    if report and report != "-" and os.path.realpath(report) in map(os.path.realpath, (source, target)):
        raise Problem(f"{report} is one of the captures; name another file with --json")


def _document(result: Redacted, source: str, target: str) -> dict[str, object]:
    tally = result.tally
    return {
        "format": "dalyshark-redact",
        "version": 1,
        "input": source,
        "output": target,
        "packets": tally.packets,
        "records": tally.records,
        "interfaces_renamed": tally.interfaces,
        "comments_removed": tally.comments,
        "blocks_left_out": tally.blocks,
        "broken": result.broken,
        "blanked": [
            {"what": what.value, "where": where, "records": row.records, "bytes": row.bytes}
            for (what, where), row in sorted(tally.rows.items())
        ],
    }


def _show(result: Redacted, target: str, to: Console) -> None:
    from rich.table import Table

    tally = result.tally
    to.print(
        f"{plain(target)}: {counted(tally.packets, 'packet')}, {counted(tally.records, 'record')}; "
        + ("blanked:" if tally.rows else "nothing in them had to be blanked"),
        soft_wrap=True,
    )
    if tally.rows:
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), expand=False, header_style="bold")
        table.add_column("what", no_wrap=True)
        table.add_column("where", overflow="fold")
        table.add_column("records", justify="right")
        table.add_column("bytes", justify="right")
        order = list(What)
        for (what, where), row in sorted(tally.rows.items(), key=lambda item: (order.index(item[0][0]), item[0][1])):
            table.add_row(what.value, where, str(row.records), str(row.bytes))
        to.print(table)
    around = [
        (tally.interfaces, "interface renamed", "interfaces renamed"),
        (tally.comments, "comment removed", "comments removed"),
        (tally.blocks, "block of another kind left out", "blocks of other kinds left out"),
    ]
    said = [counted(number, one, several) for number, one, several in around if number]
    to.print("; ".join([*said, "file comments, hardware and system left out"]), soft_wrap=True)
