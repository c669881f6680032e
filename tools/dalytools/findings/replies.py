# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about who answers: unasked, late, wrong-board."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.place import ECHO, REPLY, REQUEST, number, place_of
from dalytools.findings.rules import found
from dalytools.findings.waiting import Waiting
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalytools.findings.finding import Finding
    from dalytools.findings.limits import Limits

_REMEMBERED = 1024  # requests


@dataclass(slots=True)
class _Late:
    tally: Tally = field(default_factory=Tally)
    given_up: int = 0
    worst_s: float = 0.0


@dataclass(slots=True)
class _Wrong:
    tally: Tally = field(default_factory=Tally)
    unasked: int = 0
    meant: set[int] = field(default_factory=set[int])


class Replies(Watch):
    """Counts replies that are late, of another board, or nobody's; each once, in this order."""

    def __init__(self, limits: Limits) -> None:
        self._limit_s = limits.late_s
        self._late = Groups(_Late)
        self._wrong = Groups(_Wrong)
        self._unasked = Groups(Tally)
        self._asked: OrderedDict[int, tuple[int, int | None]] = OrderedDict()  # packet: time (ns), board
        self._newest: dict[int, int] = {}  # data ID: the board that the newest request names
        self._waiting = Waiting[tuple[str, int, int], int]()  # bus, data ID, board: of whom

    def record(self, record: Decoded, bus: str) -> None:
        """See requests, to know when and whom they asked; count replies."""
        direction = record.fields.get("daly.direction")
        if record.kind is not Kind.FRAME or direction in (None, ECHO):
            return
        if direction == REQUEST:
            board = number(record.fields, "daly.board")
            self._asked[record.number] = record.time_ns, board
            if len(self._asked) > _REMEMBERED:
                self._asked.popitem(last=False)
            data_id = number(record.fields, "daly.data_id")
            if data_id is not None and board is not None:
                self._newest[data_id] = board
                if "daly.unanswered" in record.fields:
                    self._waiting.ask((bus, data_id, board), record.time_ns, board)
        elif direction == REPLY:
            self._reply(record, bus)

    def _reply(self, record: Decoded, bus: str) -> None:
        fields = record.fields
        place = place_of(record, bus)
        waited = fields.get("daly.response_time")
        late_to = number(fields, "daly.late_to")
        if late_to is not None or (isinstance(waited, float) and waited > self._limit_s):
            late = self._late[place]
            late.tally.add(record.number, record.time_ns)
            if late_to is not None:
                late.given_up += 1
                asked = self._asked.get(late_to)
                waited = (record.time_ns - asked[0]) / 1e9 if asked else 0.0
            late.worst_s = max(late.worst_s, float(str(waited)))
        if late_to is not None:
            return  # its own request was given up: that some other board is asked by now is no sign
        if "daly.other_board" in fields:
            if self._was_asked_too(record, bus):
                return
            wrong = self._wrong[place]
            wrong.tally.add(record.number, record.time_ns)
            wrong.unasked += "daly.unasked" in fields
            asked = self._asked.get(number(fields, "daly.request_in") or 0)
            meant = asked[1] if asked else self._newest.get(number(fields, "daly.data_id") or 0)
            if meant is not None:
                wrong.meant.add(meant)
        elif "daly.unasked" in fields:
            self._unasked[place].add(record.number, record.time_ns)

    def _was_asked_too(self, record: Decoded, bus: str) -> bool:
        """Tell whether the board that answers was asked itself, by another host, a moment before.

        The reply goes to the newest request that takes it (records.md 7): one to 40 takes any board's.
        """
        data_id, board = number(record.fields, "daly.data_id"), number(record.fields, "daly.board")
        return (
            data_id is not None
            and board is not None
            and self._waiting.at((bus, data_id, board), record.time_ns) is not None
        )

    def findings(self) -> Iterator[Finding]:
        """Say which replies were not as they should be."""
        for place, late in self._late.items():
            gave_up = f", {late.given_up} of them after the request had been given up" if late.given_up else ""
            text = (
                f"{counted(late.tally.count, 'reply', 'replies')} later than {self._limit_s * 1000:.0f} ms{gave_up}; "
                f"the slowest came after {late.worst_s:.2f} s"
            )
            yield found("late", place, late.tally, text)
        for place, wrong in self._wrong.items():
            meant = " or ".join(f"board {board}" for board in sorted(wrong.meant)) or "another board"
            who = f"board {place.board}" if place.board else "it"
            text = f"{who} answered {counted(wrong.tally.count, 'time')} what {meant} was asked"
            yield found("wrong-board", place, wrong.tally, text)
        for place, unasked in self._unasked.items():
            text = f"{counted(unasked.count, 'reply', 'replies')} that no request belongs to"
            yield found("unasked", place, unasked, text)
