# SPDX-License-Identifier: GPL-2.0-or-later
"""Requests and their echoes (docs/records.md, 6; dalyref.exchange).

    40 90 ...   01 90 ...   40 90 ...            the same again, answered in between: the next poll
    40 90 ...   40 90 ...                        the same again within 100 ms, nothing between: an echo

Only a request that comes again so soon (from the other side: while the first still waits) can be an echo. Nearly all
such are decided by their neighbours; the others by the plain decoder's own book of requests, which is filled from the
frames of the second before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from dalyref import bursts, cells
from dalyref.addresses import ECHO, REPLY, REQUEST
from dalyref.exchange import Exchange
from dalyref.message import from_serial
from dalytools.bulk.bus_frames import BOARD, IS_BURST, ONLY, part_of, risen
from dalytools.bulk.frames import FIVE
from dalytools.bulk.packets import SIDES
from dalytools.bulk.runs import CountedFrom0, Running, judge
from dalytools.bulk.unlike import UnlikeError

if TYPE_CHECKING:
    from dalyref.options import Options
    from dalytools.bulk.arrays import Flags, Ints
    from dalytools.bulk.bus_frames import BusFrames

_MOST_STEPS: Final = 256
"""So many requests back the same one is looked for."""
_UNKNOWN: Final = 0


class Directions:
    """Finds the echoes of one bus."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._wait_ns = options.limit_ns(options.reply)
        self._echo_ns = options.limit_ns(options.echo)
        self._burst_ns = options.limit_ns(options.burst)

    def find(self, before: BusFrames, frames: BusFrames, running: Running, from_0: CountedFrom0) -> None:
        """Set `direction` of frames, given those before them.

        running: the reply before the frames. from_0: whose bursts were counted from 0 before them.
        """
        doubtful, same = self._same_again(before, frames)
        if not len(doubtful):
            return
        known = len(before)
        both = frames.behind(before)
        verdict = self._by_neighbours(both, known, doubtful, same)
        both.direction[doubtful] = np.where(verdict == ECHO, ECHO, REQUEST)
        open_questions = doubtful[verdict == _UNKNOWN]
        if len(open_questions):
            self._by_the_book(both, known, open_questions, running, from_0)
        frames.direction = both.direction[known:]

    def _same_again(self, before_them: BusFrames, frames: BusFrames) -> tuple[Ints, Ints]:
        """Return new requests that may be echoes, and for each the same one before it: counted over both."""
        known = len(before_them)
        earlier, later = (np.flatnonzero(each.direction != REPLY) for each in (before_them, frames))
        at = np.concatenate((earlier, known + later))
        if len(at) < 2:
            return at[:0], at[:0]
        parts = ((before_them, earlier), (frames, later))
        start_ns = np.concatenate([each.start_ns[rows] for each, rows in parts])
        latest_end_ns = risen(np.concatenate([each.end_ns[rows] for each, rows in parts]), 0)
        words = np.concatenate([part_of(each.words, rows) for each, rows in parts])
        both_sides = any(each.side[rows].any() for each, rows in parts)
        first, second = words[:, 0], words[:, 1]
        window_ns = self._wait_ns if both_sides else self._echo_ns
        before = np.full(len(at), -1, np.int64)
        step = 1
        while step < len(at):
            near = start_ns[step:] - latest_end_ns[:-step] <= window_ns
            if not near.any():
                break
            if step > _MOST_STEPS:
                raise UnlikeError("hundreds of requests in a moment")
            near &= first[step:] == first[:-step]
            here = np.flatnonzero(near) + step
            here = here[(second[here] ^ second[here - step]) & FIVE == 0]
            here = here[before[here] < 0]
            before[here] = here - step
            step += 1
        found = np.flatnonzero((before >= 0) & (at >= known))
        return at[found], at[before[found]]

    def _by_neighbours(self, frames: BusFrames, known: int, doubtful: Ints, before: Ints) -> Ints:
        """Return REQUEST, ECHO or _UNKNOWN for each."""
        side, end_ns = frames.side, frames.end_ns
        both = (side[doubtful] > 0) & (side[before] > 0)
        soon = frames.start_ns[doubtful] - end_ns[before] <= self._echo_ns
        waits = frames.latest_ns[doubtful] - end_ns[before] <= self._wait_ns
        may_be = waits & np.where(both, side[doubtful] != side[before], soon)
        requests = np.cumsum(frames.direction != REPLY)
        nothing_between = requests[doubtful] - requests[before] == doubtful - before
        answered = self._answered_at_once(frames, known, before)
        verdicts: list[int] = []
        status: dict[int, int] = {}
        columns = (doubtful, before, may_be, nothing_between, answered)
        for place, same, echo, silent, done in zip(*(column.tolist() for column in columns), strict=True):
            was = int(frames.direction[same]) if same < known else status.get(same, REQUEST)
            if was != REQUEST:
                verdict = _UNKNOWN
            elif not echo or done:
                verdict = REQUEST
            else:
                verdict = ECHO if silent else _UNKNOWN
            status[place] = verdict
            verdicts.append(verdict)
        return np.array(verdicts, np.int64)

    def _answered_at_once(self, frames: BusFrames, known: int, request: Ints) -> Flags:
        """Tell which requests the very next frame answers, for sure."""
        reply = np.minimum(request + 1, len(frames) - 1)
        address, data_id, number = frames.byte(1), frames.byte(2), frames.byte(4)
        out = (reply > request) & (frames.direction[reply] == REPLY) & (data_id[reply] == data_id[request])
        only = ONLY[address[request]]
        out &= (only == 0) | (only == BOARD[address[reply]])
        out &= frames.latest_ns[reply] - frames.end_ns[request] <= self._wait_ns
        in_burst = np.flatnonzero(out & IS_BURST[data_id[reply]])
        if len(in_burst):
            # It begins a burst when its number is 0, or 1 and the reply before is no 0 of the same kind.
            replies = np.flatnonzero(frames.direction == REPLY)
            this = reply[in_burst]
            place = np.searchsorted(replies, this)
            earlier = replies[np.maximum(place - 1, 0)]
            alike = (data_id[earlier] == data_id[this]) & (address[earlier] == address[this])
            sure = (place > 0) & (number[this] == 1) & ~_skippable(frames, earlier) & ~(alike & (number[earlier] == 0))
            out[in_burst] = np.where(this < known, frames.answers[this], sure | (number[this] == 0))
        return out

    def _by_the_book(
        self, frames: BusFrames, known: int, open_questions: Ints, running: Running, from_0: CountedFrom0
    ) -> None:
        """Ask the plain decoder's book of requests, from the frames of the time before on."""
        fresh = frames.part(slice(known, None))
        judged = judge(fresh, running, from_0, self._burst_ns)
        answers = frames.answers.copy()
        answers[known:] = False
        answers[known + judged.at[judged.begins]] = True
        first, last = int(open_questions[0]), int(open_questions[-1])
        ends = risen(frames.end_ns, 0)
        begin = int(np.searchsorted(ends, int(frames.latest_ns[first]) - self._wait_ns))
        book = Exchange[None](self._options)
        follow = _Follow(fresh, running, from_0, first - known, self._burst_ns)
        asked: set[bytes] = set()
        unknown = set(open_questions.tolist())
        for at in range(min(begin, first), last + 1):
            data = frames.bytes_of(at)
            message = from_serial(data)
            start_ns, end_ns = int(frames.start_ns[at]), int(frames.end_ns[at])
            book.pass_time(int(frames.latest_ns[at]))
            direction = int(frames.direction[at])
            if direction == REPLY:
                begins = bool(answers[at]) if at < first else follow.reply(at - known)
                if begins:
                    book.answer(message.data_id, message.route, start_ns)
                continue
            if direction == ECHO and data not in asked:
                continue  # of a request that waits no longer
            said = book.ask(message, 0, start_ns, end_ns, side=SIDES[int(frames.side[at])], owner=None).direction
            asked.add(data)
            if at in unknown:
                frames.direction[at] = direction = said
            elif said != direction:
                raise UnlikeError("requests that come again in a way that only the whole capture tells")
            if at >= first and direction == REQUEST:
                follow.request(message.data_id)


def _skippable(frames: BusFrames, at: Ints) -> Flags:
    """Tell which replies may be no part of any burst."""
    data_id, number = frames.byte(2)[at], frames.byte(4)[at]
    beyond = (number == bursts.INVALID) | ((data_id == cells.CELLS) & (number >= cells.LAST_FRAME[cells.CELLS]))
    beyond |= (data_id == cells.TEMPERATURES) & (number >= cells.LAST_FRAME[cells.TEMPERATURES])
    return IS_BURST[data_id] & beyond


class _Follow:
    """Follows the bursts one by one, where echoes are only being found out."""

    def __init__(self, frames: BusFrames, running: Running, from_0: CountedFrom0, place: int, burst_ns: int) -> None:
        self._frames = frames
        self._burst_ns = burst_ns
        before = frames.part(slice(0, place))
        self._data_id, self._address, self._number = running.data_id, running.address, running.number
        self._end_ns, self._asked, self._base = running.end_ns, bool(running.asked), running.base
        runs = judge(before, running, from_0, burst_ns)
        self._from_0 = CountedFrom0(set(from_0.keys))
        self._from_0.take(runs)
        if len(runs.at):
            last = int(runs.at[-1])
            self._note(last, int(runs.number[-1]), int(runs.base[-1]))
            later = frames.part(slice(last + 1, place))
            self._asked = bool(((later.direction == REQUEST) & (later.byte(2) == self._data_id)).any())
        else:
            self._asked |= bool(((before.direction == REQUEST) & (before.byte(2) == self._data_id)).any())

    def _note(self, at: int, number: int, base: int) -> None:
        data = self._frames.bytes_of(at)
        self._data_id, self._address, self._number, self._base = data[2], data[1], number, base
        self._end_ns, self._asked = int(self._frames.end_ns[at]), False

    def request(self, data_id: int) -> None:
        """Take a request that is no echo."""
        self._asked = self._asked or data_id == self._data_id

    def reply(self, at: int) -> bool:
        """Take a reply; tell whether it begins an answer."""
        data = self._frames.bytes_of(at)
        if not IS_BURST[data[2]]:
            self._note(at, -1, 1)
            return True
        key, number = (data[2], data[1]), data[4]
        near = int(self._frames.start_ns[at]) - self._end_ns <= self._burst_ns
        begins = not near or key != (self._data_id, self._address) or number < self._number
        begins |= number == self._number and self._asked
        base = self._base
        if begins:
            base = 0 if number == 0 or (self._frames.behind_damage[at] and key in self._from_0.keys) else 1
        if bursts.skipped(data[2], number, base):
            return False
        if number == 0:
            self._from_0.keys.add(key)
        self._note(at, number, base)
        return begins
