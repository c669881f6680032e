# SPDX-License-Identifier: GPL-2.0-or-later
"""The same batches from the plain decoder, for captures that the quick way gives up (UnlikeError): from their start.

What was given already is passed over, but for tables and texts of bursts that had not ended.
"""

from __future__ import annotations

from itertools import islice
from typing import TYPE_CHECKING, Final

import numpy as np

from dalycapture.errors import CaptureError
from dalycapture.reader import read_capture
from dalyref import cells, decoder, texts
from dalyref.addresses import REPLY, REQUEST
from dalyref.kinds import Dialect
from dalytools.bulk.bus_frames import BOARD
from dalytools.bulk.columns import Column, Table
from dalytools.bulk.left_out import LEFT_OUT
from dalytools.bulk.lots import Batch
from dalytools.bulk.packets import SIDES
from dalytools.bulk.records import DIALECTS, KINDS, Records
from dalytools.bulk.tables import FIELDS

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

    from dalyref.decoder import Decoded
    from dalyref.options import Options
    from dalyref.values import Fields, Value

_LOT: Final = 16384
_LISTS: Final = frozenset(("daly.cell.voltage", "daly.temperature", "daly.cells.voltage", "daly.sensors.temperature"))
_Numbered = tuple[int, "Decoded"]
"""A record and which it is, over the whole file."""
_TEXTS: Final = frozenset(texts.FIELDS.values())


def batches(path: Path | str, options: Options, given: int, open_bursts: frozenset[int]) -> Iterator[Batch]:
    """Yield the records of a capture behind the first `given`.

    open_bursts: the last record of bursts that had not ended by then: what is told of them as a
    whole is still to be given. Raises CaptureError as ``read_capture`` does, after all records before the damage.
    """
    problem: CaptureError | None = None

    def decoded() -> Iterator[Decoded]:
        nonlocal problem
        plain = decoder.Decoder(options)
        try:
            for packet in read_capture(path):
                yield from plain.feed(packet)
        except CaptureError as error:
            problem = error
        yield from plain.finish()

    records = decoded()
    late = [(row, one) for row, one in enumerate(islice(records, given)) if row in open_bursts]
    row = given
    while (lot := list(islice(records, _LOT))) or late:
        yield _batch(lot, row, late)
        row += len(lot)
        late = []
    if problem:
        raise problem


def _batch(lot: Sequence[Decoded], first_row: int, late: Sequence[_Numbered]) -> Batch:
    raw = bytearray()
    others: dict[int, bytes] = {}
    directions: list[int] = []
    modbus: dict[int, Fields] = {}
    replies: dict[int, list[_Numbered]] = {}
    asked: dict[int, list[_Numbered]] = {}
    for row, one in enumerate(lot):
        dialect = one.fields.get("daly.dialect")
        direction = one.fields.get("daly.direction", 0)
        frame = one.kind.value == "frame"
        if dialect == Dialect.A5.value:
            raw += one.data + bytes(3)
        else:
            raw += bytes(16)
            others[row] = one.data
            if frame:
                modbus[row] = {name: value for name, value in one.fields.items() if name not in LEFT_OUT}
        mine = frame and dialect == Dialect.A5.value
        directions.append(direction if mine and isinstance(direction, int) else 0)
        if directions[-1] == REPLY:
            replies.setdefault(one.data[2], []).append((first_row + row, one))
        elif directions[-1] == REQUEST and one.fields.get("daly.write"):
            asked.setdefault(one.data[2], []).append((first_row + row, one))
    dialects = [None if one.fields.get("daly.dialect") is None else one.fields["daly.dialect"] for one in lot]
    names = [None if each is None else each.value for each in DIALECTS]
    records = Records(
        np.array([one.number for one in lot], np.int64),
        np.array([one.time_ns for one in lot], np.int64),
        np.full(len(lot), -1, np.int64),
        np.array([KINDS.index(one.kind) for one in lot], np.uint8),
        np.array([names.index(str(each) if each else None) for each in dialects], np.uint8),
        np.array([one.interface for one in lot], np.int64),
        np.array([SIDES.index(one.direction) for one in lot], np.uint8),
        np.frombuffer(bytes(raw), np.uint64).reshape(-1, 2),
        others,
        {one.number: one.comment for one in lot if one.comment},
    )
    whole = [*late, *enumerate(lot, first_row)]
    return Batch(
        records,
        np.array(directions, np.uint8),
        {data_id: table for data_id, rows in sorted(replies.items()) if (table := _table(rows, _single)).columns},
        {data_id: table for data_id, rows in sorted(asked.items()) if (table := _table(rows, _single)).columns},
        _whole_table(whole, cells.CELLS),
        _whole_table(whole, cells.TEMPERATURES),
        [
            (row, one.number, one.time_ns, one.interface, one.data[1], name, str(one.fields[name]))
            for row, one in whole
            if one.kind.value == "frame"
            for name in sorted(_TEXTS & one.fields.keys())
        ],
        first_row,
        first_row + len(lot),
        modbus,
    )


def _single(name: str) -> bool:
    """Tell a field of a frame by itself."""
    if name in LEFT_OUT or name in _TEXTS or name in {"daly.direction", "daly.board"}:
        return False
    return not name.startswith(tuple(prefix for prefix, _ in FIELDS.values()))


def _whole_table(records: Sequence[_Numbered], data_id: int) -> Table | None:
    prefix, name = FIELDS[data_id]
    rows = [(row, one) for row, one in records if prefix + name in one.fields and not _modbus(one)]
    return _table(rows, lambda field: field.startswith(prefix)) if rows else None


def _modbus(one: Decoded) -> bool:
    return one.fields.get("daly.dialect") != Dialect.A5.value


def _table(numbered: Sequence[_Numbered], wanted: Callable[[str], bool]) -> Table:
    rows = [one for _, one in numbered]
    names = dict.fromkeys(name for one in rows for name in one.fields if wanted(name))
    address = np.array([one.data[1] for one in rows], np.uint8)
    return Table(
        np.array([row for row, _ in numbered], np.int64),
        np.array([one.number for one in rows], np.int64),
        np.array([one.time_ns for one in rows], np.int64),
        np.array([one.interface for one in rows], np.int64),
        address,
        BOARD[address],
        {name: _column(name, [one.fields.get(name) for one in rows]) for name in names},
    )


def _column(name: str, sent: Sequence[Value | list[Value] | None]) -> Column:
    if name in _LISTS:
        lists = [one if isinstance(one, list) else [] if one is None else [one] for one in sent]
        width = max(map(len, lists))
        values = np.array([[*one, *[0] * (width - len(one))] for one in lists], np.int64)
        return Column(values, length=np.array([len(one) for one in lists], np.int64))
    some = next(one for one in sent if one is not None)
    filled = [type(some)() if one is None else one for one in sent]
    present = np.array([one is not None for one in sent], np.bool_)
    values = np.array(filled, object) if isinstance(some, str) else np.array(filled)
    return Column(values, None if present.all() else present)
