# SPDX-License-Identifier: GPL-2.0-or-later
"""Bursts: which frames of 95, 96 and the texts belong together (docs/records.md, 8; dalyref.bursts).

    replies   94 | 95/1  95/2  95/3 | 95/1  95/2 | 96/1 | 96/1      | begins, else it goes on with the reply before it

Whether a reply goes on with a burst depends on the reply before it (frames that are skipped do not count) and, where
both have the same number, on whether a request for the ID came between them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref import bursts, cells
from dalyref.addresses import REPLY, REQUEST
from dalyref.file_order import LATE_NS
from dalyref.options import NANO
from dalytools.bulk.bus_frames import IS_BURST, rows_of
from dalytools.bulk.unlike import UnlikeError

if TYPE_CHECKING:
    from dalytools.bulk.arrays import Bytes, Flags, Ints, Shorts
    from dalytools.bulk.bus_frames import BusFrames

_MOST_ROUNDS: Final = 8
_MOST_ROWS: Final = 8192
"""A burst spread over more records than this is left to the plain decoder, which gives up at some number of them."""
_NEVER: Final = np.iinfo(np.int64).min // 2
_CELLS_LAST, _SENSORS_LAST = cells.LAST_FRAME[cells.CELLS], cells.LAST_FRAME[cells.TEMPERATURES]


@dataclass(slots=True)
class Running:
    """The reply before those at hand, and the burst it is of."""

    data_id: int = -1
    address: int = -1
    number: int = -1
    end_ns: int = _NEVER
    asked: int = 0
    """Requests for its ID since."""
    base: int = 1
    count: int = 0
    """Cells or sensors known at the beginning of the burst, 0: not known."""
    whole: bool = False
    """No frame of it is missing so far."""
    parts: dict[int, bytes] = field(default_factory=dict[int, bytes])
    """What its frames carry behind their number, by number."""
    first_row: int = 0
    """Of its first frame, counted over the whole file."""
    told: tuple[int, int, int, int] = (0, 0, 0, 0)
    """Of its last frame: record over the whole file, packet, time, interface."""

    @property
    def is_burst(self) -> bool:
        """Tell whether it is a frame of a burst."""
        return self.data_id in bursts.IDS


@dataclass(slots=True)
class Runs:
    """What the frames of one lot are, in the order of the file: a row for each reply that counts."""

    at: Ints
    """Where it stands in the lot."""
    data_id: Bytes
    address: Bytes
    begins: Flags
    begin: Ints
    """The indices, among these rows, of those that begin."""
    number: Shorts
    """As sent, of frames of a burst; else -1."""
    first: Ints
    """Index, among these rows, of the first of its burst; -1: it goes on with the one that was running before."""
    base: Shorts
    """What the numbers of its burst are counted from: 0 or 1."""


@dataclass(slots=True)
class CountedFrom0:
    """Whose bursts had a frame number 0 on a bus so far (docs/records.md, 8: the base)."""

    keys: set[tuple[int, int]] = field(default_factory=set[tuple[int, int]])
    """Data ID and address byte."""

    def take(self, runs: Runs) -> None:
        """Note the frames of a lot."""
        zeros = np.flatnonzero(runs.number == 0)
        if len(zeros):
            self.keys.update(zip(runs.data_id[zeros].tolist(), runs.address[zeros].tolist(), strict=True))


def judge(frames: BusFrames, running: Running, from_0: CountedFrom0, burst_ns: int) -> Runs:
    """Tell what goes on with what. frames: their directions are known. from_0: by the frames before them.

    Raises UnlikeError where that depends on more than neighbours.
    """
    at = np.flatnonzero(frames.direction == REPLY)
    raw = rows_of(frames.words, at)
    data_id, address, sent = raw[:, 2].copy(), raw[:, 1].copy(), raw[:, 4].copy()
    burst = IS_BURST.take(data_id)
    is_cells, is_sensors = data_id == cells.CELLS, data_id == cells.TEMPERATURES
    keep = ~burst | (sent != bursts.INVALID)
    keep &= ~((is_cells & (sent > _CELLS_LAST)) | (is_sensors & (sent > _SENSORS_LAST)))
    doubtful = keep & ((is_cells & (sent == _CELLS_LAST)) | (is_sensors & (sent == _SENSORS_LAST)))
    number = sent.astype(np.int16)
    number += 1
    number *= burst
    number -= 1
    kept = _Kept(at, data_id, address, number)
    some_doubtful = doubtful.any()
    for _ in range(_MOST_ROUNDS):
        runs = _judge_kept(frames, kept if keep.all() else kept.part(keep), running, from_0, burst_ns)
        if not some_doubtful:
            return runs
        # In a burst with base 0 the highest number that its ID can have is one lower.
        beyond = np.flatnonzero(doubtful[keep] & (runs.base == 0))
        if not len(beyond):
            return runs
        _, one_a_run = np.unique(runs.first[beyond], return_index=True)
        keep[np.flatnonzero(keep)[beyond[one_a_run]]] = False
    raise UnlikeError("bursts numbered beyond their end again and again")


@dataclass(slots=True)
class _Kept:
    """Replies, without those that are no part of anything."""

    at: Ints
    data_id: Bytes
    address: Bytes
    number: Shorts

    def part(self, which: Flags) -> _Kept:
        return _Kept(self.at[which], self.data_id[which], self.address[which], self.number[which])


def _judge_kept(frames: BusFrames, kept: _Kept, running: Running, counted_from_0: CountedFrom0, burst_ns: int) -> Runs:
    at, data_id, address, number = kept.at, kept.data_id, kept.address, kept.number
    if not len(at):
        none, short = np.zeros(0, np.int64), np.zeros(0, np.int16)
        return Runs(at, data_id, address, np.zeros(0, np.bool_), none, short, none, short)
    start_ns, end_ns = frames.start_ns[at], frames.end_ns[at]
    goes_on = number >= 0
    goes_on[1:] &= (data_id[1:] == data_id[:-1]) & (address[1:] == address[:-1]) & (number[1:] >= number[:-1])
    goes_on[1:] &= start_ns[1:] - end_ns[:-1] <= burst_ns
    goes_on[0] &= (
        int(data_id[0]) == running.data_id
        and int(address[0]) == running.address
        and int(number[0]) >= running.number
        and int(start_ns[0]) - running.end_ns <= burst_ns
    )
    same = np.flatnonzero(goes_on[1:] & (number[1:] == number[:-1])) + 1
    if len(same):
        goes_on[same] &= ~_asked_between(frames, at[same - 1], at[same], data_id[same])
    if goes_on[0] and int(number[0]) == running.number:
        before = frames.part(slice(0, int(at[0])))
        asked = (before.direction == REQUEST) & (before.byte(2) == running.data_id)
        goes_on[0] = not (running.asked or asked.any())
    begins = ~goes_on
    begin = np.flatnonzero(begins)
    head = int(begin[0]) if len(begin) else len(at)
    sizes = np.diff(begin, append=len(at))
    first = np.repeat(begin, sizes)
    from_0 = number[begin] == 0
    if frames.behind_damage.any():
        behind = np.flatnonzero(frames.behind_damage[at[begin]] & (number[begin] > 0))
        from_0[behind] = _counted_from_0(kept, begin[behind], counted_from_0)
    base = np.repeat(1 - from_0.astype(np.int16), sizes) if from_0.any() else np.ones(len(first), np.int16)
    if head:
        first = np.concatenate((np.full(head, -1), first))
        base = np.concatenate((np.full(head, running.base, np.int16), base))
    return Runs(at, data_id, address, begins, begin, number, first, base)


def _counted_from_0(kept: _Kept, places: Ints, before: CountedFrom0) -> list[bool]:
    """Tell of which places the data ID and address byte had number 0 earlier."""
    zeros = np.flatnonzero(kept.number == 0)
    since = dict.fromkeys(before.keys, -1)
    for at, *key in zip(zeros.tolist(), kept.data_id[zeros].tolist(), kept.address[zeros].tolist(), strict=True):
        since.setdefault((key[0], key[1]), at)
    keys = zip(kept.data_id[places].tolist(), kept.address[places].tolist(), strict=True)
    return [since.get(key, at) < at for at, key in zip(places.tolist(), keys, strict=True)]


def _asked_between(frames: BusFrames, after: Ints, before: Ints, data_id: Bytes) -> Flags:
    """Tell whether a request for the ID stands between two places."""
    out = np.zeros(len(after), np.bool_)
    requests = np.flatnonzero(frames.direction == REQUEST)
    asks_for = frames.byte(2)[requests]
    for one in np.unique(data_id).tolist():
        mine = data_id == one
        places = requests[asks_for == one]
        out[mine] = np.searchsorted(places, before[mine]) > np.searchsorted(places, after[mine])
    return out


@dataclass(frozen=True, slots=True)
class Clock:
    """What time it was at each frame."""

    bus_ns: Ints
    """The latest beginning of a record of this bus so far."""
    now_ns: Ints
    """The same of any bus."""
    burst_ns: int
    """A burst ends after so long a quiet."""


def check(frames: BusFrames, runs: Runs, running: Running, clock: Clock, first_row: int) -> None:
    """Raise UnlikeError where the plain decoder may have ended a burst by time that these rules go on with.

    first_row: number of the lot's first record over the whole file.
    """
    if len(runs.begin) == len(runs.at):
        return
    row = frames.row[runs.at]
    last = np.append(runs.begin, len(row)) - 1  # of the bursts that end, and of the lot's last
    spread = row[last[1:]] - row[runs.begin]
    spread_before = first_row + int(row[last[0]]) - running.first_row if last[0] >= 0 else 0
    if spread_before > _MOST_ROWS or (len(spread) and spread.max() > _MOST_ROWS):
        raise UnlikeError("a burst spread over thousands of records")
    if clock.now_ns is frames.start_ns or (clock.now_ns == frames.start_ns).all():
        return  # the times rise
    later = np.flatnonzero(~runs.begins)
    at = runs.at[later]
    before = np.where(later > 0, frames.end_ns[runs.at[np.maximum(later - 1, 0)]], running.end_ns)
    over = clock.bus_ns[at] - before > clock.burst_ns + NANO // 2
    over |= clock.now_ns[at] - before > clock.burst_ns + LATE_NS
    if over.any():
        raise UnlikeError("time stamps that go back within a burst")
