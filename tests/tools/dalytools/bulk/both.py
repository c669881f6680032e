# SPDX-License-Identifier: GPL-2.0-or-later
"""One capture the plain way and the quick way, in one form to be compared."""

from __future__ import annotations

from typing import TYPE_CHECKING

import dalyref.decoder
from dalycapture.errors import CaptureError
from dalycapture.reader import read_capture
from dalyref.options import Options
from dalytools.bulk.blocks import CHUNK
from dalytools.bulk.bus_frames import BOARD
from dalytools.bulk.left_out import LEFT_OUT
from dalytools.bulk.packets import SIDES, Interfaces
from dalytools.bulk.read import read
from dalytools.bulk.reading import read_columns
from dalytools.bulk.records import DIALECTS, KINDS, Cutter

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from dalyref.decoder import Decoded
    from dalyref.values import Fields
    from dalytools.bulk.lots import Batch
    from dalytools.bulk.records import Records

Piece = tuple[int, int, str, object, bytes, int, str, str]
"""Number, time, kind, dialect, bytes, interface, direction, comment."""


def plainly(path: Path, options: Options | None = None) -> tuple[list[Decoded], str]:
    """Decode with the reference decoder: the records, and what is wrong with the file."""
    decoder = dalyref.decoder.Decoder(options)
    out: list[Decoded] = []
    problem = ""
    try:
        for packet in read_capture(path):
            out += decoder.feed(packet)
    except CaptureError as error:
        problem = str(error)
    return out + decoder.finish(), problem


def pieces_of(decoded: Iterable[Decoded]) -> list[Piece]:
    """Which record is what."""
    return [
        (
            one.number,
            one.time_ns,
            one.kind.value,
            one.fields.get("daly.dialect"),
            one.data,
            one.interface,
            one.direction,
            one.comment,
        )
        for one in decoded
    ]


def quick_pieces(path: Path, *, chunk: int = CHUNK, options: Options | None = None) -> tuple[list[Piece], str]:
    """Cut at speed: the same."""
    interfaces = Interfaces()
    cutter = Cutter(options or Options(), interfaces)
    out: list[Piece] = []
    problem = ""
    try:
        for packets in read_columns(path, interfaces, chunk=chunk):
            out += _pieces(cutter.take(packets))
    except CaptureError as error:
        problem = str(error)
    return out + list(_pieces(cutter.finish())), problem


def _pieces(records: Records) -> Iterator[Piece]:
    for row in range(len(records)):
        number = int(records.number[row])
        dialect = DIALECTS[int(records.dialect[row])]
        yield (
            number,
            int(records.time_ns[row]),
            KINDS[int(records.kind[row])].value,
            None if dialect is None else dialect.value,
            records.data(row),
            int(records.interface[row]),
            SIDES[int(records.side[row])],
            records.comments.get(number, ""),
        )


def plain_fields(decoded: Iterable[Decoded]) -> list[tuple[int, Fields]]:
    """What each record says, as far as the quick way says it too: (number, fields)."""
    return [
        (one.number, {name: value for name, value in one.fields.items() if name not in LEFT_OUT}) for one in decoded
    ]


def quick_fields(path: Path, *, chunk: int = CHUNK, options: Options | None = None) -> list[tuple[int, Fields]]:
    """The same from the columns, put together again."""
    out: list[tuple[int, Fields]] = []
    where: dict[int, Fields] = {}  # by record: fields of A5 frames of which more may be told

    def take(batch: Batch) -> None:
        records = batch.records
        for row in range(len(records)):
            fields: Fields = {}
            number = int(records.number[row])
            out.append((number, fields))
            if row in batch.modbus:
                fields.update(batch.modbus[row])
                for name in LEFT_OUT:
                    fields.pop(name, None)
            if direction := int(batch.direction[row]):
                address = records.words[row].tobytes()[1]
                fields["daly.direction"] = direction
                if board := int(BOARD[address]):
                    fields["daly.board"] = board
                where[batch.first_row + row] = fields
        for table in (*batch.replies.values(), *batch.writes.values(), batch.cells, batch.sensors):
            if table is not None:
                for row in range(len(table)):
                    fields = where[int(table.row[row])]
                    assert out[int(table.row[row])][0] == table.number[row]
                    for name, column in table.columns.items():
                        value = column.value(row)
                        if value is not None:
                            assert name not in fields
                            fields[name] = value
        for row, _, _, _, _, name, text in batch.texts:
            where[row][name] = text
        for row in [row for row in where if row < batch.open_from]:
            del where[row]

    try:
        for batch in read(path, options, chunk=chunk):
            take(batch)
    except CaptureError:
        pass
    return out
