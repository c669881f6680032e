# SPDX-License-Identifier: GPL-2.0-or-later
"""Tables as options of ``dalyshark decode``: which rows, which columns, which file."""

from __future__ import annotations

import argparse
import importlib.util
import os
import re
import stat
import sys
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from dalytools.exports import moments, records, values
from dalytools.exports.choice import choose
from dalytools.exports.csv_file import CsvFile
from dalytools.exports.csv_sparse import SparseCsvFile
from dalytools.exports.fingerprint import Fingerprint
from dalytools.exports.schema import FIELDS, Column
from dalytools.extra import missing
from dalytools.problem import Problem
from dalytools.whole_file import whole_binary_file, whole_file

if TYPE_CHECKING:
    from collections.abc import Generator, Mapping, Sequence

    from dalyref.decoder import Decoded
    from dalytools.exports.rows import Row, Shape

FORMATS: Final = ("csv", "parquet")
ROWS: Final = ("record", "moment", "value")
_LABEL: Final = re.compile(r"([a-z][a-z0-9_]{0,31})=([A-Za-z][A-Za-z0-9._-]{0,63})")


class Sink(Protocol):
    """Takes rows."""

    def put(self, row: Row) -> None:
        """Take a row."""
        ...


@dataclass(frozen=True, slots=True)
class Plan:
    """What table is asked for."""

    format: str
    rows: str
    fields: str | None = None
    partition: tuple[str, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict[str, str])


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options; ``read`` gives them."""
    group = parser.add_argument_group("tables (docs/exports.md)")
    group.add_argument(
        "--rows",
        choices=ROWS,
        help="a row is a record (so in parquet), a moment: what a board told in one round of polling (so in csv), "
        "or a value",
    )
    group.add_argument(
        "--fields",
        metavar="LIST",
        help="only these, in csv, parquet and jsonl: names with commas between, such as daly.soc,daly.pack.*",
    )
    group.add_argument(
        "--partition",
        metavar="LIST",
        type=lambda text: tuple(word.strip() for word in text.split(",")),
        default=(),
        help="OUT is a directory of Parquet files, by names out of board, day, month, transport and labels, such "
        "as board,day; captures are added to one that is there",
    )
    group.add_argument(
        "--label",
        metavar="NAME=VALUE",
        type=_label,
        action="append",
        default=[],
        help="one more column with the same value in each row, such as site=harbour; may be given more than once",
    )


def read(args: argparse.Namespace) -> Plan:
    """Return what the command line asks for. Raises Problem where it does not fit together."""
    rows: str | None = args.rows
    labels: dict[str, str] = dict(args.label)
    plan = Plan(
        args.format, rows or ("moment" if args.format == "csv" else "record"), args.fields, args.partition, labels
    )
    if plan.format not in FORMATS:
        for option, given in (("--rows", rows), ("--partition", plan.partition), ("--label", labels)):
            if given:
                raise Problem(f"{option} is for tables: say --format {'parquet' if option == '--partition' else 'csv'}")
        if plan.fields is not None and plan.format != "jsonl":
            raise Problem("--fields is for tables and objects: say --format csv, parquet or jsonl")
    elif plan.format == "parquet":
        if importlib.util.find_spec("pyarrow") is None:
            raise missing("Parquet needs", "pyarrow", "parquet")
        if args.output == "-":
            raise Problem("Parquet can't go to standard output: name a file, or with --partition a directory, with -o")
    elif plan.partition:
        raise Problem("--partition makes Parquet files: say --format parquet")
    return plan


class Export:
    """A table that is being written."""

    def __init__(self, shape: Shape, sink: Sink, labels: Mapping[str, str]) -> None:
        self._shape = shape
        self._sink = sink
        self._labels: Row = dict(labels)
        self._fingerprint = Fingerprint(labels)

    def put(self, file: str, record: Decoded) -> None:
        """Take the next record of a file."""
        self._fingerprint.add(record)
        for row in self._shape.take(file, record):
            self._sink.put({**self._labels, **row} if self._labels else row)

    def end_file(self) -> str:
        """Take the end of a file; return the fingerprint of what was taken of it."""
        for row in self._shape.end_file():
            self._sink.put({**self._labels, **row})
        done = self._fingerprint.text()
        self._fingerprint = Fingerprint({name: str(value) for name, value in self._labels.items()})
        return done


@contextmanager
def opened(plan: Plan, output: str, *, span_ns: int) -> Generator[Export]:
    """Open a table for writing; it takes its name when the block ends well. span_ns: a moment is no longer.

    Raises Problem where it cannot be written.
    """
    shape, always = _shape(plan, span_ns)
    names = {column.name for column in shape.columns}
    for name in plan.labels:
        if name in names or name in {"day", "month"}:
            raise Problem(f"--label: {name} is a column already; take another name")
    columns = (*(Column(name, "text") for name in plan.labels), *shape.columns)
    always += len(plan.labels)
    if plan.format == "csv":
        with nullcontext(sys.stdout) if output == "-" else whole_file(output) as out:
            if plan.rows == "value" or (plan.fields is not None and "*" not in plan.fields):
                yield Export(shape, CsvFile(out, columns), plan.labels)
                return
            sparse = SparseCsvFile(out, columns, always=always, folder=_folder(output))
            try:
                yield Export(shape, sparse, plan.labels)
                sparse.write()
            finally:
                sparse.close()
    elif plan.partition:
        with _data_set(plan, output, shape, columns) as export:
            yield export
    else:
        from dalytools.exports.parquet_file import ParquetFile

        with whole_binary_file(output) as raw:
            table = ParquetFile(raw, columns)
            try:
                yield Export(shape, table, plan.labels)
                table.close()
            finally:
                table.abandon()


@contextmanager
def _data_set(plan: Plan, output: str, shape: Shape, columns: Sequence[Column]) -> Generator[Export]:
    from dalytools.exports.data_set import KEYS, DataSet

    there = {column.name for column in columns}
    known = [name for name in (*KEYS, *plan.labels) if name in there or name in {"day", "month"}]
    for name in plan.partition:
        if name not in known:
            raise Problem(f"--partition: by {name!r} can't be; by {', '.join(known)} can")
    if len(set(plan.partition)) < len(plan.partition):
        raise Problem("--partition: a name stands there twice")
    data_set = DataSet(output, plan.partition, columns)

    class Whole(Export):
        """Tells the data set where a capture ends."""

        def end_file(self) -> str:
            done = super().end_file()
            data_set.end_file(done)
            return done

    try:
        yield Whole(shape, data_set, plan.labels)
        data_set.commit()
    except OSError as error:
        raise Problem(f"{output}: cannot be written: {error.strerror}") from None
    finally:
        data_set.discard()


def _shape(plan: Plan, span_ns: int) -> tuple[Shape, int]:
    """Return what makes the rows, and how many of its first columns are always there."""
    match plan.rows:
        case "moment":
            if plan.fields is None:
                return moments.Moments(span_ns=span_ns), len(moments.HEAD)
            return moments.Moments(choose(plan.fields, moments.CHOICES, moments.HEAD), span_ns=span_ns), len(
                moments.HEAD
            )
        case "value":
            return values.Values(
                values.DEFAULT if plan.fields is None else choose(plan.fields, values.CHOICES, values.COLUMNS)
            ), 0
        case _:
            if plan.fields is None:
                return records.Records(), len(records.HEAD)
            return records.Records(choose(plan.fields, records.CHOICES, records.HEAD), only_with=True), len(
                records.HEAD
            )


def wanted(plan: Plan) -> frozenset[str] | None:
    """Return the fields that are asked for, for objects; None: all."""
    return (
        None if plan.fields is None else frozenset(column.field for column in choose(plan.fields, FIELDS, records.HEAD))
    )


def _folder(output: str) -> str | None:
    """Return where rows wait: beside the file, as there is room for it."""
    place = Path(os.path.realpath(output))
    plain_file = output != "-" and (not place.exists() or stat.S_ISREG(place.stat().st_mode))
    return str(place.parent) if plain_file else None


def _label(text: str) -> tuple[str, str]:
    found = _LABEL.fullmatch(text)
    if not found:
        said = f"{text!r} is no label; site=harbour is one: small letters, =, a letter and then letters, digits, . _ -"
        raise argparse.ArgumentTypeError(said)
    return found[1], found[2]
