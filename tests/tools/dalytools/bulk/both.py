# SPDX-License-Identifier: GPL-2.0-or-later
"""One capture the plain way and the quick way, in one form to be compared."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalycapture.errors import CaptureError
from dalycapture.reader import read_capture
from dalyref.decoder import Decoder
from dalyref.options import Options
from dalytools.bulk.blocks import CHUNK
from dalytools.bulk.packets import SIDES, Interfaces
from dalytools.bulk.reading import read_columns
from dalytools.bulk.records import DIALECTS, KINDS, Cutter

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from dalyref.decoder import Decoded
    from dalytools.bulk.records import Records

Piece = tuple[int, int, str, object, bytes, int, str, str]
"""Number, time, kind, dialect, bytes, interface, direction, comment."""


def plainly(path: Path, options: Options | None = None) -> tuple[list[Decoded], str]:
    """Decode with the reference decoder: the records, and what is wrong with the file."""
    decoder = Decoder(options)
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
