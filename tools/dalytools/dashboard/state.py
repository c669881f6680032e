# SPDX-License-Identifier: GPL-2.0-or-later
"""What the screen knows: counts, boards, the last records. Memory does not grow with the capture."""

from __future__ import annotations

import itertools
from collections import Counter, deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final, NamedTuple

from dalycapture.kind_counts import KindCounts
from dalyref.kinds import Kind
from dalytools.dashboard.told import BoardTold

if TYPE_CHECKING:
    from dalyref.decoder import Decoded
    from dalyref.values import Fields

REQUEST, REPLY, ECHO = 1, 2, 3
_MOST_BOARDS: Final = 64
_RATE_OVER_S: Final = 5.0
_LAST: Final = 100
_LOOKED_AT: Final = 1000  # of the records that are not final yet, where nothing is ever answered


class Heard(NamedTuple):
    """A record, and when it came: s, monotonic."""

    at: float
    record: Decoded

    def unanswered(self, now: float, reply_s: float) -> bool:
        """Tell whether it is a request whose time, `reply_s`, is over without a reply."""
        fields = self.record.fields
        asks = fields.get("daly.direction") == REQUEST and "daly.reply_in" not in fields
        return asks and ("daly.unanswered" in fields or now - self.at > reply_s)


@dataclass(slots=True)
class State:
    """Give each record to ``early`` when it is read, to ``final`` when nothing more can come to it, in the same order.

    reply_s: for how long a request waits.
    """

    kinds: KindCounts = field(default_factory=KindCounts)
    boards: dict[str, BoardTold] = field(default_factory=dict[str, BoardTold])
    last: deque[Heard] = field(default_factory=lambda: deque[Heard](maxlen=_LAST))
    reply_s: float = 1.0
    retries: int = 0
    echoes: int = 0
    unasked: int = 0
    second_hosts: int = 0
    contradictions: int = 0
    writes: int = 0
    last_write: Decoded | None = None
    events: int = 0
    _unanswered: Counter[str] = field(default_factory=Counter[str])
    """By the board that was asked, empty: by none in particular."""
    _open: deque[Heard] = field(default_factory=deque[Heard])
    """Records that are not final yet."""
    _seconds: deque[tuple[int, int]] = field(default_factory=deque[tuple[int, int]])
    """Records by whole second of the monotonic clock, the newest few."""

    @property
    def records(self) -> int:
        """Records, without events."""
        return self.kinds.total() - self.kinds[Kind.EVENT]

    def early(self, record: Decoded, now: float) -> None:
        """Take a record at once. now: s, monotonic."""
        heard = Heard(now, record)
        self._open.append(heard)
        self.kinds[record.kind] += 1
        self.last.append(heard)
        if record.kind is Kind.EVENT:
            self.events += 1
            return
        second = int(now)
        if self._seconds and self._seconds[-1][0] == second:
            self._seconds[-1] = second, self._seconds[-1][1] + 1
        else:
            self._seconds.append((second, 1))
            while self._seconds[0][0] < second - _RATE_OVER_S - 1:
                self._seconds.popleft()
        fields = record.fields
        direction = fields.get("daly.direction")
        if direction == REPLY:
            board = self._board(fields)
            if board:
                board.replies += 1
                board.heard_at = now
                if isinstance(wait := fields.get("daly.response_time"), float):
                    board.waits.append(wait)
                board.take(fields, now)
            self.unasked += "daly.unasked" in fields
            self.contradictions += "daly.contradiction" in fields
        elif direction == ECHO:
            self.echoes += 1
        elif direction == REQUEST:
            self.retries += "daly.retry" in fields
            self.second_hosts += "daly.second_host" in fields
            if "daly.write" in fields:
                self.writes += 1
                self.last_write = record

    def final(self, record: Decoded) -> None:
        """Take what became known of a record since."""
        came, _ = self._open.popleft()
        fields = record.fields
        if "daly.unanswered" in fields:
            self._board(fields)
            self._unanswered[_name(fields)] += 1
        elif fields.get("daly.direction") == REPLY and (board := self._board(fields)):
            board.late(fields, came)

    def unanswered(self, now: float) -> Counter[str]:
        """Count the requests whose time is over, by the board that was asked; empty: by none in particular."""
        count = self._unanswered.copy()
        for heard in itertools.islice(self._open, _LOOKED_AT):
            if heard.unanswered(now, self.reply_s):
                count[_name(heard.record.fields)] += 1
        return count

    def rate(self, now: float) -> float:
        """Return records a second, over the last five whole ones."""
        present = int(now)
        seconds = range(present - int(_RATE_OVER_S), present)
        return sum(count for second, count in self._seconds if second in seconds) / _RATE_OVER_S

    def names(self) -> list[str]:
        """Return the names of the boards, in the order in which they are shown."""
        return sorted(self.boards, key=lambda name: (not name.isdecimal(), name.rjust(8)))

    def _board(self, fields: Fields) -> BoardTold | None:
        name = _name(fields)
        board = self.boards.get(name)
        if board is None and name and len(self.boards) < _MOST_BOARDS:
            board = self.boards[name] = BoardTold(name)
        return board


def _name(fields: Fields) -> str:
    board = fields.get("daly.board")
    if isinstance(board, int):
        return str(board)
    if fields.get("daly.dialect") == "d2":
        return "D2"
    if fields.get("daly.direction") == REPLY and isinstance(address := fields.get("daly.address"), int):
        return f"0x{address:02X}"
    return ""
