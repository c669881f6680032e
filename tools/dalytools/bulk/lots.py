# SPDX-License-Identifier: GPL-2.0-or-later
"""Records to values, a lot at a time: directions, bursts, tables, and a table of typed columns for each data ID."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref import cells, texts, writes
from dalyref.addresses import REPLY, REQUEST
from dalyref.kinds import Dialect
from dalytools.bulk import payloads, runs, tables
from dalytools.bulk.bus_frames import BOARD, BusFrames, first_direction, part_of, risen, rows_of
from dalytools.bulk.columns import Column, Table
from dalytools.bulk.damage import Damage
from dalytools.bulk.directions import Directions
from dalytools.bulk.equal import all_equal
from dalytools.bulk.modbus import Modbus
from dalytools.bulk.newest import Newest
from dalytools.bulk.records import DIALECTS, FRAME
from dalytools.bulk.runs import CountedFrom0, Running
from dalytools.bulk.unlike import UnlikeError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.options import Options
    from dalyref.values import Fields
    from dalytools.bulk.arrays import Bytes, Flags, Ints, Shorts
    from dalytools.bulk.packets import Interfaces
    from dalytools.bulk.records import Records

_BUS_NAME: Final = re.compile(r"bus=([^\s,;]+)")
_A5: Final = DIALECTS.index(Dialect.A5)
_MOST_REMEMBERED: Final = 65536
_IS_WRITE: Final = np.array([writes.is_write(data_id) for data_id in range(256)], np.bool_)
_TAIL: Final = 1024
"""So many frames are nearly always more than come in a second."""
_PACK, _MOS, _STATUS = 0x90, 0x93, 0x94


@dataclass(slots=True)
class Batch:
    """Some records of a capture, and the values in them."""

    records: Records
    direction: Bytes
    """Of A5 frames: 1 request, 2 reply, 3 echo; of all else 0 (of Modbus: see `modbus`)."""
    replies: dict[int, Table]
    """What each data ID's replies say, a row each."""
    writes: dict[int, Table]
    """What requests that write would set, by data ID."""
    cells: Table | None
    """Whole tables of cell voltages, mV: with the batch in which they are complete."""
    sensors: Table | None
    """Whole tables of temperatures, C."""
    texts: list[tuple[int, int, int, int, int, str, str]]
    """Record over the whole file, number, time, interface, address, field, text: whole texts, once complete."""
    first_row: int
    """Number of the first of `records` over the whole file, from 0."""
    open_from: int
    """Of records from this one on, over the whole file, more may be told with later batches."""
    modbus: dict[int, Fields]
    """By row of `records`: what a Modbus frame says."""


@dataclass(frozen=True, slots=True)
class _Lot:
    """A batch in the making."""

    batch: Batch
    found: tables.Found
    now_ns: Ints
    """The latest beginning of a record of any bus, by record."""
    behind_damage: Flags
    """By record: the one right before it in its stream is damaged."""
    count: Shorts
    """By record: of 95 and 96 the number of cells or sensors (0: not known), of 90 the state beside it (-1: none)."""
    base: Shorts
    """By record: what the numbers of its burst are counted from; -1: it is no part of any."""


@dataclass(slots=True)
class _Bus:
    """What is remembered of one bus from lot to lot."""

    directions: Directions
    modbus: Modbus
    running: Running = field(default_factory=Running)
    from_0: CountedFrom0 = field(default_factory=CountedFrom0)
    before: BusFrames | None = None
    """Frames that a request still to come may be an echo of, or follow."""
    latest_ns: int = 0
    """The latest beginning of a frame."""
    now_ns: int = 0
    """The latest beginning of a record."""
    cells: Newest = field(default_factory=Newest)
    sensors: Newest = field(default_factory=Newest)
    state: Newest = field(default_factory=Newest)
    """Byte 0 of the newest 93."""


class Decoder:
    """Decodes the records of one capture."""

    def __init__(self, options: Options, interfaces: Interfaces) -> None:
        self._options = options
        self._interfaces = interfaces
        self._wait_ns = options.limit_ns(options.reply)
        self._burst_ns = options.limit_ns(options.burst)
        self._buses: dict[int | str, _Bus] = {}
        self._bus_of: list[_Bus] = []  # by interface
        self._now_ns = 0
        self._damage = Damage()
        self._rows = 0  # records so far
        self._pace = _Pace()

    def take(self, records: Records) -> Batch:
        """Take the next records; return them with their values. Raises UnlikeError where this can not decide."""
        found = tables.Found()
        batch = self._decode(records, found)
        _whole(batch, found)
        batch.open_from = min(self.open_bursts(), default=self._rows)
        return batch

    def finish(self, records: Records) -> Batch:
        """Take the last records."""
        found = tables.Found()
        batch = self._decode(records, found)
        for bus in self._buses.values():
            tables.ended(bus.running, found)
        _whole(batch, found)
        return batch

    def open_bursts(self) -> frozenset[int]:
        """Return the last record, over the whole file, of each burst whose table or text is not told yet."""
        running = (bus.running for bus in self._buses.values())
        return frozenset(burst.told[0] for burst in running if burst.parts and not burst.count)

    def _decode(self, records: Records, found: tables.Found) -> Batch:
        count = len(records)
        batch = Batch(records, np.zeros(count, np.uint8), {}, {}, None, None, [], self._rows, self._rows + count, {})
        if not count:
            return batch
        now_ns = risen(records.time_ns, self._now_ns)
        self._now_ns = int(now_ns[-1])
        self._pace.check(now_ns)
        behind_damage = self._damage.behind(records)
        lot = _Lot(batch, found, now_ns, behind_damage, np.zeros(count, np.int16), np.full(count, -1, np.int16))
        for bus, rows in self._by_bus(records):
            self._of_bus(bus, rows, lot)
        self._rows += count
        _add_tables(lot)
        return batch

    def _by_bus(self, records: Records) -> list[tuple[_Bus, Ints]]:
        known = self._bus_of
        for interface in range(len(known), len(self._interfaces.description)):
            named = _BUS_NAME.search(self._interfaces.description[interface])
            key = named[1] if named else interface
            bus = self._buses.get(key)
            if bus is None:
                bus = self._buses[key] = _Bus(Directions(self._options), Modbus(self._options))
            known.append(bus)
        if all_equal(records.interface):
            return [(known[int(records.interface[0])], np.arange(len(records)))]
        used = np.flatnonzero(np.bincount(records.interface)).tolist()
        buses = {id(known[interface]): known[interface] for interface in used}
        if len(buses) == 1:
            return [(next(iter(buses.values())), np.arange(len(records)))]
        numbers = {key: number for number, key in enumerate(buses)}
        of_interface = np.zeros(len(known), np.int64)
        for interface in used:
            of_interface[interface] = numbers[id(known[interface])]
        which = of_interface[records.interface]
        return [(bus, np.flatnonzero(which == numbers[key])) for key, bus in buses.items()]

    def _of_bus(self, bus: _Bus, rows: Ints, lot: _Lot) -> None:
        batch, records, now_ns = lot.batch, lot.batch.records, lot.now_ns
        time_ns, kind, dialect = records.time_ns, records.kind, records.dialect
        here: Ints | slice = slice(None)
        if len(rows) != len(records):
            here = rows
            time_ns, kind, dialect, now_ns = time_ns[here], kind[here], dialect[here], now_ns[here]
        bus_now_ns = now_ns if now_ns is time_ns and bus.now_ns <= time_ns[0] else risen(time_ns, bus.now_ns)
        bus.now_ns = int(bus_now_ns[-1])
        if not (kind == FRAME).all():
            good = np.flatnonzero(kind == FRAME)
            here = rows = rows[good]
            time_ns, dialect, now_ns, bus_now_ns = time_ns[good], dialect[good], now_ns[good], bus_now_ns[good]
        if not len(rows):
            return
        rising = bus_now_ns is time_ns and bus.latest_ns <= time_ns[0]
        latest_ns = time_ns if rising else risen(time_ns, bus.latest_ns)
        if not (dialect == _A5).all():
            for at in np.flatnonzero(dialect != _A5).tolist():
                row = int(rows[at])
                batch.modbus[row] = bus.modbus.take(records, row, int(latest_ns[at]))
            bus.latest_ns = int(latest_ns[-1])
            serial = np.flatnonzero(dialect == _A5)
            here = rows = rows[serial]
            time_ns, latest_ns, now_ns, bus_now_ns = (each[serial] for each in (time_ns, latest_ns, now_ns, bus_now_ns))
        words = part_of(records.words, here)
        address = words.view(np.uint8).reshape(-1, 16)[:, 1]
        frames = BusFrames(
            rows,
            time_ns,
            records.end_ns[here],
            latest_ns,
            records.side[here],
            words,
            first_direction(address),
            np.zeros(len(rows), np.bool_),
            lot.behind_damage[here],
        )
        if not len(frames):
            return
        bus.latest_ns = max(bus.latest_ns, int(latest_ns[-1]))
        before = bus.before if bus.before is not None else frames.part(slice(0, 0))
        bus.directions.find(before, frames, bus.running, bus.from_0)
        judged = runs.judge(frames, bus.running, bus.from_0, self._burst_ns)
        bus.from_0.take(judged)
        clock = runs.Clock(bus_now_ns, now_ns, self._burst_ns)
        runs.check(frames, judged, bus.running, clock, self._rows)
        frames.answers[judged.at] = judged.begins
        batch.direction[here] = frames.direction
        self._find(bus, frames, judged, lot)
        self._remember(bus, frames, before)

    def _find(self, bus: _Bus, frames: BusFrames, judged: runs.Runs, lot: _Lot) -> None:
        """Find how many cells and sensors each burst has, and its tables."""
        raw = rows_of(frames.words, judged.at)
        ids, address = judged.data_id, judged.address
        status = np.flatnonzero(ids == _STATUS)
        number_of_cells, number_of_sensors = raw[status, 4], raw[status, 5]
        count = np.zeros(len(judged.at), np.int16)
        for kind, newest, told, most in (
            (cells.CELLS, bus.cells, number_of_cells, cells.MOST_CELLS),
            (cells.TEMPERATURES, bus.sensors, number_of_sensors, cells.MOST_SENSORS),
        ):
            valid = (told >= 1) & (told <= most)
            mine = np.flatnonzero(ids == kind)
            known = newest.look(mine, address[mine], status[valid], address[status[valid]], told[valid])
            count[mine] = np.maximum(known, 0)
        row = frames.row[judged.at]
        lot.count[row] = count
        lot.base[row] = judged.base
        if len(judged.at) and judged.first[0] < 0:
            count[judged.first < 0] = bus.running.count
        bursts = tables.Bursts(frames, judged, count, lot.batch.records, self._rows, lot.found)
        bus.running = bursts.find(bus.running)
        packs = np.flatnonzero(ids == _PACK)
        mos = np.flatnonzero(ids == _MOS)
        lot.count[row[packs]] = bus.state.look(packs, address[packs], mos, address[mos], raw[mos, 4])

    def _remember(self, bus: _Bus, frames: BusFrames, before: BusFrames) -> None:
        """Keep what a request still to come may belong to."""
        since_ns = bus.latest_ns - self._wait_ns
        if len(frames) > _TAIL and frames.end_ns[:-_TAIL].max() < since_ns:
            frames = frames.part(slice(-_TAIL, None))
        else:
            frames = frames.behind(before)
        begin = int(np.searchsorted(risen(frames.end_ns, 0), since_ns))
        if len(frames) - begin > _MOST_REMEMBERED:
            raise UnlikeError("thousands of frames in a second")
        kept = frames.part(np.arange(begin, len(frames)))
        kept.row = kept.row - (1 << 62)
        bus.before = kept


class _Pace:
    """Watches that no more records come within the time that some may be held than the plain decoder would hold."""

    _STEP = 8192
    _STEPS = 6
    _HELD_NS = 12_000_000_000

    def __init__(self) -> None:
        self._marks: list[int] = []
        self._left = 0

    def check(self, now_ns: Ints) -> None:
        """Take the latest beginning of a record on any bus, by record."""
        at = self._STEP - 1 - self._left
        self._marks += now_ns[at :: self._STEP].tolist()
        self._left = (self._left + len(now_ns)) % self._STEP
        for late, early in zip(self._marks[self._STEPS :], self._marks, strict=False):
            if late - early <= self._HELD_NS:
                raise UnlikeError("thousands of records in some seconds")
        del self._marks[: -self._STEPS]


def _add_tables(lot: _Lot) -> None:
    """Add a table for each data ID."""
    batch, count_of, base_of = lot.batch, lot.count, lot.base
    records, direction = batch.records, batch.direction
    sent = records.words.view(np.uint8).reshape(-1, 16)[:, 2]
    for data_id, rows in _by_id(np.flatnonzero(direction == REPLY), sent):
        raw = rows_of(records.words, rows)
        data = raw[:, 4:12]
        if data_id in cells.SLOTS:
            columns = _parts(data_id, raw, count_of[rows], base_of[rows])
        elif data_id in texts.FIELDS:
            columns = {"daly.frame_number": Column(data[:, 0])}
        else:
            columns = payloads.of_replies(data_id, data)
            if data_id == _PACK:
                state = count_of[rows]
                columns["daly.pack.state"] = Column(np.maximum(state, 0).astype(np.uint8), state >= 0)
        if columns:
            batch.replies[data_id] = _table(batch, rows, raw, columns)
    requests = np.flatnonzero(direction == REQUEST)
    for data_id, rows in _by_id(requests[_IS_WRITE.take(sent[requests])], sent):
        raw = rows_of(records.words, rows)
        columns = payloads.of_writes(data_id, raw[:, 4:12])
        if columns:
            batch.writes[data_id] = _table(batch, rows, raw, columns)


def _by_id(rows: Ints, sent: Bytes) -> Iterator[tuple[int, Ints]]:
    """Sort rising rows by data ID. sent: of each record."""
    ids = sent[rows]
    order = np.argsort(ids, kind="stable")
    rows, ids = rows[order], ids[order]
    bounds = [0, *(np.flatnonzero(ids[1:] != ids[:-1]) + 1).tolist(), len(rows)]
    for begin, end in itertools.pairwise(bounds):
        if end > begin:
            yield int(ids[begin]), rows[begin:end]


def _parts(data_id: int, raw: Bytes, count: Shorts, base: Shorts) -> dict[str, Column]:
    """Return the columns of single frames of 95 or 96. base: -1 where a frame is no part of any burst."""
    slots = cells.SLOTS[data_id]
    number = raw[:, 4]
    real = count - slots * (number.astype(np.int16) - base)
    np.clip(real, 0, slots, out=real)
    real[count <= 0] = slots
    real[base < 0] = 0
    if data_id == cells.CELLS:
        values = tables.cell_slots(raw)
        name = "daly.cell.voltage"
    else:
        values = raw[:, 5:12].astype(np.int64) - 40
        name = "daly.temperature"
    return {"daly.frame_number": Column(number), name: Column(values, length=real.astype(np.int64))}


def _table(batch: Batch, rows: Ints, raw: Bytes, columns: dict[str, Column]) -> Table:
    records = batch.records
    address = raw[:, 1]
    return Table(
        batch.first_row + rows,
        records.number[rows],
        records.time_ns[rows],
        records.interface[rows],
        address,
        BOARD.take(address),
        columns,
    )


def _whole(batch: Batch, found: tables.Found) -> None:
    """Add the tables and texts that are complete."""
    batch.cells = tables.table(cells.CELLS, found.rows[cells.CELLS], BOARD)
    batch.sensors = tables.table(cells.TEMPERATURES, found.rows[cells.TEMPERATURES], BOARD)
    batch.texts = [
        (row, number, time_ns, interface, address, texts.FIELDS[data_id], text)
        for row, number, time_ns, interface, address, data_id, text in sorted(found.texts)
    ]
