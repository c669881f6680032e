# SPDX-License-Identifier: GPL-2.0-or-later
"""Whole tables of cells and sensors, and texts, of the bursts that carry them (docs/records.md, 8).

95/1 95/2 95/3 95/4 95/5 95/6      16 cells known: the table stands in 95/6, all at once
95/1 95/1 95/2 ..                  repeats, bursts that began in the lot before, texts: one by one
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from dalyref import cells, texts
from dalyref.addresses import REQUEST
from dalytools.bulk.bus_frames import rows_of
from dalytools.bulk.columns import Column, Table
from dalytools.bulk.runs import Running

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.bulk.arrays import Array, Bytes, Flags, Ints, Shorts
    from dalytools.bulk.bus_frames import BusFrames
    from dalytools.bulk.records import Records
    from dalytools.bulk.runs import Runs

_WIDTH: Final = {cells.CELLS: cells.MOST_CELLS, cells.TEMPERATURES: cells.MOST_SENSORS}
_IS_TEXT: Final = np.array([data_id in texts.FIELDS for data_id in range(256)], np.bool_)
FIELDS: Final = {
    cells.CELLS: ("daly.cells.", "voltage"),
    cells.TEMPERATURES: ("daly.sensors.", "temperature"),
}


_Text = tuple[int, int, int, int, int, int, str]


@dataclass(slots=True)
class Rows:
    """Tables that were found, of one ID: cells in mV, or sensors' bytes as sent."""

    row: list[Ints] = field(default_factory=list["Ints"])
    number: list[Ints] = field(default_factory=list["Ints"])
    time_ns: list[Ints] = field(default_factory=list["Ints"])
    interface: list[Ints] = field(default_factory=list["Ints"])
    address: list[Ints] = field(default_factory=list["Ints"])
    length: list[Ints] = field(default_factory=list["Ints"])
    slots: list[Array] = field(default_factory=list["Array"])

    def add(self, told: Sequence[Ints], address: Ints, length: Ints, slots: Array) -> None:
        """Take some rows; told: row, number, time and interface of their records. slots: rows x width."""
        row, number, time_ns, interface = told
        self.row.append(row)
        self.number.append(number)
        self.time_ns.append(time_ns)
        self.interface.append(interface)
        self.address.append(address)
        self.length.append(length)
        self.slots.append(slots)


@dataclass(slots=True)
class Found:
    """What the bursts of a lot carry."""

    rows: dict[int, Rows] = field(default_factory=lambda: {data_id: Rows() for data_id in _WIDTH})
    """By data ID."""
    texts: list[tuple[int, int, int, int, int, int, str]] = field(
        default_factory=list[tuple[int, int, int, int, int, int, str]]
    )
    """Record, number, time, interface, address, data ID, text."""


@dataclass(frozen=True, slots=True)
class Bursts:
    """The bursts of one bus in one lot."""

    frames: BusFrames
    runs: Runs
    count: Shorts
    """Of cells or sensors at the beginning of each reply's burst, 0: not known."""
    records: Records
    first_row: int
    """Number of the lot's first record over the whole file."""
    found: Found
    """Takes what is complete."""

    def find(self, running: Running) -> Running:
        """Find the tables and texts, given the burst that was running; return the one that is running at the end."""
        frames, runs, found = self.frames, self.runs, self.found
        at = runs.at
        if not len(at):
            return replace(running, asked=running.asked + _asked(frames, running.data_id))
        begins = runs.begin
        current = running
        # The burst that was running goes on; when another reply begins something, it has ended.
        first_begin = int(begins[0]) if len(begins) else len(at)
        if first_begin:
            current = self._one_by_one(range(first_begin), current, found)
        if len(begins):
            ended(current, found)
            repeated = _repeated(runs)
            for kind in _WIDTH:
                self._at_once(kind, repeated)
            data_id = runs.data_id[begins]
            odd = _IS_TEXT.take(data_id)
            if repeated.any():
                odd |= ((data_id == cells.CELLS) | (data_id == cells.TEMPERATURES)) & repeated[begins]
            for index in np.flatnonzero(odd).tolist():
                more = index + 1 < len(begins)
                members = range(int(begins[index]), int(begins[index + 1]) if more else len(at))
                last = self._one_by_one(members, self._begun(members[0]), found)
                if more:
                    ended(last, found)
            members = range(int(begins[-1]), len(at))
            # What can be told of it already was told above.
            current = self._one_by_one(members, self._begun(members[0]), Found())
        current.asked = _asked(frames.part(slice(int(at[-1]) + 1, None)), current.data_id)
        return current

    def _begun(self, index: int) -> Running:
        place = int(self.runs.at[index])
        data = self.frames.bytes_of(place)
        base = int(self.runs.base[index])
        return Running(
            data_id=data[2],
            address=data[1],
            base=base,
            count=int(self.count[index]),
            whole=True,
            number=base - 1,
            first_row=self.first_row + int(self.frames.row[place]),
        )

    def _one_by_one(self, members: range, burst: Running, found: Found) -> Running:
        """Take the frames of one burst; tell of its table where a count is known."""
        frames, records = self.frames, self.records
        per_frame = cells.SLOTS.get(burst.data_id, 0)
        for index in members:
            place = int(self.runs.at[index])
            row = int(frames.row[place])
            data = frames.bytes_of(place)
            burst.end_ns = int(frames.end_ns[place])
            where = (int(records.number[row]), int(records.time_ns[row]), int(records.interface[row]))
            burst.told = (self.first_row + row, *where)
            number = int(self.runs.number[index])
            if number < 0:
                burst.number = number
                continue
            burst.whole = burst.whole and number <= burst.number + 1
            burst.number = number
            burst.parts[number] = data[5:12]
            first = per_frame * (number - burst.base) + 1
            if burst.count and burst.whole and first <= burst.count < first + per_frame:
                _tell(burst, found)
        return burst

    def _at_once(self, data_id: int, repeated: Flags) -> None:
        """Find the tables of bursts that began in this lot and have no repeats, but for the last that may go on."""
        frames, runs, count, records = self.frames, self.runs, self.count, self.records
        at, number = runs.at, runs.number
        per_frame = cells.SLOTS[data_id]
        bursts = np.flatnonzero(runs.data_id[runs.begin] == data_id)
        if not len(bursts):
            return
        first = runs.begin[bursts]
        behind = np.append(runs.begin, len(at))[bursts + 1]
        # Without a count the last of the burst carries the table; whether the lot's last has ended is not known yet.
        known = count[first]
        step = np.where(known > 0, (known - 1) // per_frame, behind - first - 1)
        complete = (first + step < behind) & ((known > 0) | (behind < len(at))) & ~repeated[first]
        first, known, step = first[complete], known[complete], step[complete]
        # Frame number n is the n-th of its burst, so none before it is missing or came twice.
        in_order = number[first + step] - runs.base[first + step] == step
        first, known, step = first[in_order], known[in_order], step[in_order]
        if not len(first):
            return
        last = first + step
        length = np.where(known > 0, known, per_frame * (step + 1))
        frames_each = int(step.max()) + 1
        width = frames_each * per_frame
        places = np.minimum(first[:, None] + np.arange(frames_each), last[:, None])
        raw = rows_of(frames.words, at[places])
        if data_id == cells.CELLS:
            slots = cell_slots(raw).reshape(len(first), width)
        else:
            slots = raw[:, :, 5:12].reshape(len(first), width).astype(np.int64)
        if not (length == width).all():
            slots[np.arange(width) >= length[:, None]] = 0
        row = frames.row[at[last]]
        told = (self.first_row + row, records.number[row], records.time_ns[row], records.interface[row])
        address = runs.address[last].astype(np.int64)
        self.found.rows[data_id].add(told, address, length, slots)


def cell_slots(raw: Bytes) -> Ints:
    """Return the three cells in frames of 95, mV. raw: .. x 16 bytes, from the frame's first."""
    data = np.ndarray(raw.shape[:-1], np.dtype(">u8"), raw, 4, raw.strides[:-1]).astype(np.int64)
    slots = np.empty((*data.shape, cells.SLOTS[cells.CELLS]), np.int64)
    for slot, shift in enumerate((40, 24, 8)):
        np.bitwise_and(data >> shift, 0xFFFF, out=slots[..., slot])
    return slots


def _asked(frames: BusFrames, data_id: int) -> int:
    """Return how many requests for an ID there are."""
    return int(((frames.direction == REQUEST) & (frames.byte(2) == data_id)).sum())


def _tell(burst: Running, found: Found) -> None:
    """Tell of the table of one burst."""
    whole = [burst.parts[number] for number in sorted(burst.parts)]
    slots: list[int] = []
    for part in whole:
        slots += cells.cells(b"\0" + part) if burst.data_id == cells.CELLS else part
    slots = slots[: burst.count] if burst.count else slots
    row = np.array([slots], np.int64)
    told = [np.array([one], np.int64) for one in burst.told]
    found.rows[burst.data_id].add(told, np.array([burst.address]), np.array([len(slots)]), row)


def ended(burst: Running, found: Found) -> None:
    """Tell of what is known only when a burst has ended."""
    if not burst.parts or not burst.whole or burst.count:
        return
    if burst.data_id in _WIDTH:
        _tell(burst, found)
    elif burst.data_id in texts.FIELDS:
        text = texts.whole(burst.data_id, burst.parts)
        if text:
            found.texts.append((*burst.told, burst.address, burst.data_id, text))


def _repeated(runs: Runs) -> Flags:
    """Tell which bursts, by the index of their first frame, are taken one by one for a repeat in them."""
    out = np.zeros(len(runs.at), np.bool_)
    within = np.flatnonzero(~runs.begins[1:] & (runs.number[1:] == runs.number[:-1])) + 1
    out[runs.first[within[runs.first[within] >= 0]]] = True
    return out


def table(data_id: int, rows: Rows, board: Bytes) -> Table | None:
    """Return the tables found as columns: all slots, how many, lowest and highest and which, average, spread."""
    if not rows.number:
        return None
    parts = (rows.row, rows.number, rows.time_ns, rows.interface, rows.address, rows.length)
    row, number, time_ns, interface, address, length = (np.concatenate(column) for column in parts)
    width = max(part.shape[1] for part in rows.slots)
    slots = np.concatenate(
        [part if part.shape[1] == width else np.pad(part, ((0, 0), (0, width - part.shape[1]))) for part in rows.slots]
    )
    if not (row[1:] > row[:-1]).all():
        order = np.argsort(row)
        row, number, time_ns, interface, address, length, slots = (
            column[order] for column in (row, number, time_ns, interface, address, length, slots)
        )
    prefix, name = FIELDS[data_id]
    zero = 40 if data_id == cells.TEMPERATURES else 0
    shown = slots - zero if zero else slots
    figures = _figures(data_id, slots, length)
    some = figures.how_many > 0
    valid = None if some.all() else some
    byte_address = address.astype(np.uint8)
    return Table(
        row,
        number,
        time_ns,
        interface,
        byte_address,
        board[byte_address],
        {
            prefix + name: Column(shown, length=length),
            prefix + "count": Column(length),
            prefix + "min": Column(figures.low - zero, valid),
            prefix + "min_number": Column(figures.low_number, valid),
            prefix + "max": Column(figures.high - zero, valid),
            prefix + "max_number": Column(figures.high_number, valid),
            prefix + "average": Column(figures.total / np.maximum(figures.how_many, 1) - zero, valid),
            prefix + "spread": Column(figures.high - figures.low, valid),
        },
    )


class _Figures(NamedTuple):
    """What is said of tables, a row each; of one without a value only `how_many` has a meaning."""

    how_many: Ints
    low: Ints
    low_number: Ints
    high: Ints
    high_number: Ints
    total: Ints


def _figures(data_id: int, slots: Ints, length: Ints) -> _Figures:
    """Calculate over the slots of each table that hold a cell or sensor: a slot of all tables at a time."""
    across = np.ascontiguousarray(slots.T, np.int32)
    place = np.arange(len(across), dtype=np.int32)[:, None]
    # A value and its place in one number: the least and the largest of them say both, and the first of equal ones.
    least = across << 8
    largest = least | (0xFF - place)
    least |= place
    count = length
    if data_id == cells.TEMPERATURES or not (length == len(across)).all():
        there: Flags = place < length
        if data_id == cells.TEMPERATURES:
            there &= (across != 0x00) & (across != 0xFF)  # no sensor (dalyref.cells.is_there)
        across *= there
        least |= np.int32(1 << 30) * ~there
        largest *= there
        count = there.sum(0)
    total = across.sum(0)
    low, high = least.min(0).astype(np.int64), largest.max(0).astype(np.int64)
    return _Figures(count, low >> 8, (low & 0xFF) + 1, high >> 8, 0x100 - (high & 0xFF), total)
