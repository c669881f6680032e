# SPDX-License-Identifier: GPL-2.0-or-later
"""Whole tables of cells and sensors, and texts, of the bursts that carry them (docs/records.md, 8).

95/1 95/2 95/3 95/4 95/5 95/6      16 cells known: the table stands in 95/6, all at once
95/1 95/1 95/2 ..                  repeats, bursts that began in the lot before, texts: one by one
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref import cells, texts
from dalyref.addresses import REQUEST
from dalytools.bulk.bus_frames import rows_of
from dalytools.bulk.columns import Column, Table
from dalytools.bulk.runs import Running

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.bulk.arrays import Array, Bytes, Flags, Ints
    from dalytools.bulk.bus_frames import BusFrames
    from dalytools.bulk.records import Records
    from dalytools.bulk.runs import Runs

_WIDTH: Final = {cells.CELLS: cells.MOST_CELLS, cells.TEMPERATURES: cells.MOST_SENSORS}
_TEXTS: Final = list(texts.FIELDS)
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
    count: Ints
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
        data_id = frames.byte(2)[at]
        begins = np.flatnonzero(runs.begins)
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
            bounds = np.append(begins, len(at)).tolist()
            odd = np.isin(data_id[begins], _TEXTS) | (np.isin(data_id[begins], list(_WIDTH)) & repeated[begins])
            for index in np.flatnonzero(odd).tolist():
                members = range(bounds[index], bounds[index + 1])
                last = self._one_by_one(members, self._begun(members[0]), found)
                if index + 1 < len(begins):
                    ended(last, found)
            members = range(bounds[-2], len(at))
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
        mine = (frames.byte(2)[at] == data_id) & (runs.first >= 0)
        index = np.flatnonzero(mine)
        if not len(index):
            return
        first = runs.first[index]
        step = number[index] - runs.base[index]
        # Frame number n is the n-th of its burst, so none before it is missing or came twice.
        in_order = index - first == step
        begin = per_frame * step + 1
        known = count[first]
        complete = (known > 0) & (begin <= known) & (known < begin + per_frame)
        # Without a count the last of the burst carries the table; whether the lot's last has ended is not known yet.
        last = np.ones(len(at), np.bool_)
        last[:-1] = runs.begins[1:]
        last[-1] = False
        complete |= (known == 0) & last[index]
        which = np.flatnonzero(in_order & complete & ~repeated[first])
        if not len(which):
            return
        length = np.where(known[which] > 0, known[which], per_frame * (step[which] + 1))
        frames_each = int(step[which].max()) + 1
        width = frames_each * per_frame
        places = np.minimum(first[which][:, None] + np.arange(frames_each), index[which][:, None])
        raw = rows_of(frames.words, at[places])
        if data_id == cells.CELLS:
            slots = (raw[:, :, 5:11:2].astype(np.int64) << 8 | raw[:, :, 6:11:2]).reshape(len(which), width)
        else:
            slots = raw[:, :, 5:12].reshape(len(which), width).astype(np.int64)
        slots[np.arange(width) >= length[:, None]] = 0
        row = frames.row[at[index[which]]]
        told = (self.first_row + row, records.number[row], records.time_ns[row], records.interface[row])
        address = frames.byte(1)[at[index[which]]].astype(np.int64)
        self.found.rows[data_id].add(told, address, length, slots)


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
        text = texts.whole(burst.parts)
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
    slots = np.concatenate([np.pad(part, ((0, 0), (0, width - part.shape[1]))) for part in rows.slots])
    order = np.argsort(row)
    row, number, time_ns, interface, address, length, slots = (
        column[order] for column in (row, number, time_ns, interface, address, length, slots)
    )
    prefix, name = FIELDS[data_id]
    there: Flags = np.arange(width, dtype=np.int64)[None, :] < np.asarray(length, np.int64)[:, None]
    shown = slots
    if data_id == cells.TEMPERATURES:
        shown = slots - 40
        there = there & (slots != 0x00) & (slots != 0xFF)  # no sensor (dalyref.cells.is_there)
    some: Flags = np.any(there, axis=1)
    low_first = np.where(there, slots, 1 << 20).argmin(1)
    high_first = np.where(there, slots, -1).argmax(1)
    each = np.arange(len(slots))
    low, high = slots[each, low_first], slots[each, high_first]
    how_many = np.maximum(np.count_nonzero(there, axis=1), 1)
    average = np.where(there, slots, 0).sum(1) / how_many
    zero = 40 if data_id == cells.TEMPERATURES else 0
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
            prefix + "min": Column(low - zero, valid),
            prefix + "min_number": Column(low_first + 1, valid),
            prefix + "max": Column(high - zero, valid),
            prefix + "max_number": Column(high_first + 1, valid),
            prefix + "average": Column(average - zero, valid),
            prefix + "spread": Column(high - low, valid),
        },
    )
