# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark decode``: what the reference decoder reads in a capture, for people (table), programs (jsonl), tables."""

from __future__ import annotations

import json
import os
import sys
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TextIO

from dalycapture.errors import CaptureError
from dalycapture.linktype import link_type_name
from dalyref.decoder import Decoded, Decoder, Options
from dalytools import time_range, wire_times
from dalytools.exports import bulk_choice, export, records
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.record_lines import line
from dalytools.terminal_text import plain
from dalytools.whole_file import whole_binary_file, whole_file
from dalytools.wires import choice, left_out
from dalytools.wires.carried import carried
from dalytools.wires.carriers import Carriers

if TYPE_CHECKING:
    import argparse
    from collections.abc import Callable, Generator, Iterator

    from dalyref.packet import Packet
    from dalyref.values import Fields
    from dalytools.exports.export import Plan
    from dalytools.exports.schema import Column
    from dalytools.time_range import TimeRange
    from dalytools.wires.choice import Choice

_COLOURS = {
    "request": "cyan",
    "reply": "default",
    "echo": "yellow",
    "modbus": "magenta",
    "bad_checksum": "red",
    "short": "red",
    "junk": "bright_black",
    "foreign": "blue",
    "event": "bold yellow",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = "Show what the reference decoder reads in capture files."
    parser.epilog = "Exit status: 0 all read, 2 a file could not be read, or not to its end (what was read is shown)."
    parser.add_argument(
        "files", nargs="+", metavar="FILE", help="capture file, a log of candump -L, or - for standard input"
    )
    parser.add_argument(
        "--format",
        choices=("table", "jsonl", *export.FORMATS),
        default="table",
        help="a line a record for people, an object a record, or a table",
    )
    parser.add_argument("-o", "--output", metavar="OUT", default="-", help="file to write, - for standard output")
    time_range.add_arguments(parser)
    export.add_arguments(parser)
    choice.add_arguments(parser)
    wire_times.add_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Decode every file; what could be read of a damaged one is shown before its problem."""
    files: list[str] = args.files
    output: str = args.output
    options, wires = wire_times.read(args), choice.read(args)
    Carriers(wires)  # says what is missing before anything is written
    if output != "-":
        for name in files:
            if name != "-" and os.path.realpath(name) == os.path.realpath(output):
                raise Problem(f"{output} is the capture itself; name another file with -o")
    plan = export.read(args)
    span = time_range.read(args)
    problems: list[str] = []
    columns = bulk_choice.chosen(plan, files)
    if columns is not None and (status := _in_bulk(files, output, columns, plan, options, span=span)) is not None:
        return status
    with _opened(plan, output, options, several=len(files) > 1) as out:
        shown = 0
        for name in files:
            said = len(problems)
            shown += _decode_file(name, options, span, out.put, problems, wires=wires)
            out.end_file()
            for problem in problems[said:]:
                print(f"dalyshark decode: {plain(problem)}", file=sys.stderr)  # noqa: T201
        if problems and not shown and output != "-":
            raise Problem(f"nothing could be read, so {output} was not written")
    return 2 if problems else 0


def _in_bulk(
    files: list[str], output: str, columns: list[Column], plan: Plan, options: Options, *, span: TimeRange
) -> int | None:
    """Write the table the quick way; return the exit status, or None where the plain way must do it."""
    from dalytools.bulk.read import read
    from dalytools.bulk.unlike import OtherMediumError
    from dalytools.exports.arrow_schema import arrow_schema
    from dalytools.exports.bulk_parquet import Rows
    from dalytools.exports.parquet_file import ParquetFile

    everything = (*records.HEAD, *columns)
    schema = arrow_schema(everything)
    names = {column.name for column in everything}
    if plan.labels or len(names) < len(everything):
        return None
    problems: list[str] = []
    shown = 0
    try:
        with whole_binary_file(output) as raw:
            table = ParquetFile(raw, everything)
            try:
                for name in files:
                    rows = Rows(plain(name), columns, schema, span)
                    said = shown
                    with progress_bar(f"decode {plain(Path(name).name)}") as advance:
                        try:
                            for batch in read(name, options):
                                shown += len(batch.records)
                                advance(shown)
                                if (some := rows.take(batch)) is not None:
                                    table.put_table(some)
                        except OtherMediumError:
                            raise
                        except CaptureError as error:
                            problems.append(str(error))
                    if (some := rows.finish()) is not None:
                        table.put_table(some)
                    if shown == said and not problems:
                        raise OtherMediumError(name)  # the plain way says what is in it
                for problem in problems:
                    print(f"dalyshark decode: {plain(problem)}", file=sys.stderr)  # noqa: T201
                if problems and not shown:
                    raise Problem(f"nothing could be read, so {output} was not written")
                table.close()
            finally:
                table.abandon()
    except OtherMediumError:
        return None
    return 2 if problems else 0


class _Out(Protocol):
    """Where records go."""

    def put(self, file: str, record: Decoded) -> None:
        """Take the next record of a file."""
        ...

    def end_file(self) -> object:
        """Take the end of a file."""
        ...


class _Lines:
    """Records as lines: for people, or of JSON."""

    def __init__(self, out: TextIO, put: Callable[[str, Decoded], None]) -> None:
        self._out = out
        self._put = put

    def put(self, file: str, record: Decoded) -> None:
        """Take the next record of a file."""
        self._put(file, record)

    def end_file(self) -> None:
        """Let it be seen."""
        self._out.flush()


@contextmanager
def _opened(plan: Plan, output: str, options: Options, *, several: bool) -> Generator[_Out]:
    if plan.format in export.FORMATS:
        with export.opened(plan, output, span_ns=options.limit_ns(options.age)) as table:
            yield table
        return
    wanted = export.wanted(plan)
    with nullcontext(sys.stdout) if output == "-" else whole_file(output) as out:
        yield _Lines(out, _printer(out, plan.format, wanted, several=several))


def _decode_file(
    name: str,
    options: Options,
    span: TimeRange,
    put: Callable[[str, Decoded], None],
    problems: list[str],
    *,
    wires: Choice,
) -> int:
    """Put every record of one file out; return how many, and append what is wrong with the file to `problems`."""
    decoder = Decoder(options)
    carriers = Carriers(wires)
    shown = 0
    others: set[int] = set()
    packets = passed = 0
    with progress_bar(f"decode {plain(Path(name).name)}") as advance:

        def seen(packet: Packet) -> None:
            nonlocal packets, passed
            packets += 1
            if not carriers.reads(packet.link_type):
                others.add(packet.link_type)
                passed += 1

        def batches() -> Iterator[list[Decoded]]:
            for carrier in carried(name, carriers, problems, packet=seen, advance=advance):
                yield decoder.feed(carrier)
            yield decoder.finish()

        for batch in batches():
            for record in batch:
                if span.holds(record.time_ns):
                    put(name, record)
            shown += len(batch)
    left_out.say("decode", name, carriers.left_out)
    if others and passed != packets:
        names = ", ".join(link_type_name(number) for number in sorted(others)[:5])
        print(f"dalyshark decode: {plain(name)}: {passed} packets passed over ({names})", file=sys.stderr)  # noqa: T201
    elif not packets and not problems:
        print(f"dalyshark decode: {plain(name)}: the capture holds no packet", file=sys.stderr)  # noqa: T201
    return shown


def jsonl(record: Decoded, file: str = "") -> str:
    """Return a record as one line of JSON. ``time`` is a number with nine decimals: exact, in seconds since 1970."""
    sign = "-" if record.time_ns < 0 else ""
    seconds, nanos = divmod(abs(record.time_ns), 1_000_000_000)
    head = f'{{"number": {record.number}, "time": {sign}{seconds}.{nanos:09d}, '
    rest: dict[str, object] = {"kind": record.kind.value, "transport": record.transport, "fields": record.fields}
    if file:
        rest = {"file": file, **rest}
    return head + json.dumps(rest)[1:]


def _printer(out: TextIO, form: str, wanted: frozenset[str] | None, *, several: bool) -> Callable[[str, Decoded], None]:
    """Return what puts one record out: (file name, record). `several` files: it is said which.

    wanted: of an object only these fields, and no object that has none of them.
    """
    if form == "jsonl":

        def put_object(name: str, record: Decoded) -> None:
            if wanted is not None:
                fields: Fields = {key: value for key, value in record.fields.items() if key in wanted}
                if not fields:
                    return
                record = replace(record, fields=fields)
            print(jsonl(record, name if several else ""), file=out)

        return put_object
    last = ""

    def heading(name: str) -> None:
        nonlocal last
        if several and name != last:
            print(f"{plain(name)}:", file=out)
            last = name

    if not _coloured(out):

        def put(name: str, record: Decoded) -> None:
            heading(name)
            print(line(record), file=out)

        return put

    from rich.console import Console
    from rich.text import Text

    console = Console(file=out, highlight=False, soft_wrap=True)

    def put_coloured(name: str, record: Decoded) -> None:
        heading(name)
        shown = line(record)
        place, who, what, values, warnings = shown.pieces()
        colour = _COLOURS.get(shown.kind, "default")
        text = Text.assemble((place, "bright_black"), (who + what, colour), values, (warnings, "bold red"))
        text.rstrip()
        console.print(text)

    return put_coloured


def _coloured(out: TextIO) -> bool:
    return out.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
