# SPDX-License-Identifier: GPL-2.0-or-later
"""Requests and the replies that belong to them, on one bus (docs/records.md, sections 6 and 7).

request --+---------------- waits 1 s ----------------|--- until 10 s: late ---|    answered: waits no more
          |<100 ms>| the same again: echo (once)
                   | the same again: retry -- waits in its own right

A request repeated after its answer is neither: it is the next poll.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from dalyref import addresses, writes

if TYPE_CHECKING:
    from dalyref.message import Message, Route
    from dalyref.options import Options
    from dalyref.packet import Direction

_MOST_ASKED = 1024
"""Unanswered requests remembered for one data ID: a hostile capture shall not fill the memory."""
_MOST_DIFFERENT = 4096

T = TypeVar("T")


@dataclass(slots=True, eq=False)
class Request(Generic[T]):
    """A request (not an echo) seen on the bus."""

    number: int
    """Of its packet."""
    end_ns: int
    side: Direction
    host: int
    """Who asks."""
    only: int
    """The one board whose reply it takes, 0: any board's."""
    board: int
    """The board it names, 0: none."""
    written: bytes
    """Its eight data bytes, of one that writes; else nothing."""
    owner: T
    """What the caller wants to know when the answer comes."""
    answered: bool = False
    answered_late: bool = False
    echoed: bool = False


@dataclass(frozen=True, slots=True)
class Asked:
    """What a frame from a host is."""

    direction: int
    """``addresses.REQUEST`` or ``ECHO``."""
    retry: bool = False
    second_host: bool = False


@dataclass(frozen=True, slots=True)
class Answer(Generic[T]):
    """What a reply belongs to."""

    request: Request[T] | None
    late_to: int = 0
    """Packet of the request that it comes too late for, 0: none."""
    unasked: bool = False
    other_board: bool = False
    follows: int = 0
    """Packet of the request whose answer it goes on with, 0: none."""


UNNUMBERED = frozenset((0x64, 0x21))
"""Data IDs that answer in several frames without numbers."""


class Exchange(Generic[T]):
    """The requests of one bus."""

    def __init__(self, options: Options, *, echoes: bool = True) -> None:
        """Begin without any. echoes: the wire may give a request back (CAN does not)."""
        self._echoes = echoes
        self._wait_ns = options.limit_ns(options.reply)
        self._echo_ns = options.limit_ns(options.echo)
        self._late_ns = options.limit_ns(options.late)
        self._quiet_ns = options.limit_ns(options.burst)
        self._going_on: dict[tuple[int, int, int], tuple[int, int]] = {}
        """Of UNNUMBERED, by ID, address and host: packet of the request, and when the newest reply began (ns)."""
        self._newest: dict[bytes, Request[T]] = {}
        self._asked: dict[int, list[Request[T]]] = {}  # by data ID, unanswered, oldest first
        self._host: tuple[int, int] | None = None  # who asked last, and when that ended (ns)
        self._latest_ns = 0

    def pass_time(self, start_ns: int) -> None:
        """Take the beginning of any frame of the bus: a clock that steps back does not revive a request."""
        self._latest_ns = max(self._latest_ns, start_ns)

    def _waits(self, request: Request[T]) -> bool:
        return self._latest_ns - request.end_ns <= self._wait_ns

    def ask(self, message: Message, number: int, start_ns: int, end_ns: int, *, side: Direction, owner: T) -> Asked:
        """Take a frame from a host."""
        route = message.route
        before = self._newest.pop(message.same, None)
        retry = False
        if before is not None and not before.answered and self._waits(before):
            if not self._echoes:
                echo = False
            elif before.side and side:
                echo = before.side != side
            else:
                echo = not before.echoed and start_ns - before.end_ns <= self._echo_ns
            if echo:
                before.echoed = True
                self._newest[message.same] = before
                return Asked(addresses.ECHO)
            retry = True
        data_id = message.data_id
        written = message.content if message.whole and writes.is_write(data_id) else b""
        request = Request(number, end_ns, side, route.host, route.only, route.named, written, owner)
        self._newest[message.same] = request
        if len(self._newest) > _MOST_DIFFERENT:
            del self._newest[next(iter(self._newest))]
        asked = self._asked.setdefault(data_id, [])
        while asked and (len(asked) >= _MOST_ASKED or self._latest_ns - asked[0].end_ns > self._late_ns):
            del asked[0]
        asked.append(request)
        host, last = route.host, self._host
        self._host = (host, end_ns)
        second = last is not None and last[0] != host and start_ns - last[1] <= self._wait_ns
        return Asked(addresses.REQUEST, retry, second)

    def answer(self, data_id: int, route: Route, start_ns: int) -> Answer[T]:
        """Take a board's reply (the first of its burst): find the request it belongs to, which then waits no more."""
        board = route.board
        asked = self._asked.get(data_id, [])
        kind = (data_id, route.address, route.host)
        fitting = [request for request in reversed(asked) if self._waits(request) and request.only in (0, board)]
        if fitting:
            own = (request for request in fitting if request.host == route.host)
            request = next(own, fitting[0])  # on CAN a board may answer to another address than the one that asked
            request.answered = True
            asked.remove(request)
            if data_id in UNNUMBERED:
                self._going_on[kind] = request.number, start_ns
            return Answer(request, other_board=bool(board and request.board not in (0, board)))
        if self._host is None:
            return Answer(None)
        follows, began_ns = self._going_on.get(kind, (0, 0))
        if follows and start_ns - began_ns <= self._quiet_ns:
            self._going_on[kind] = follows, start_ns
            return Answer(None, follows=follows)
        waiting = next((request for request in reversed(asked) if self._waits(request)), None)
        other = waiting is not None and board != 0 and waiting.board not in (0, board)
        for request in reversed(asked):
            if (
                request.only in (0, board)
                and not request.answered_late
                and not self._waits(request)
                and start_ns - request.end_ns <= self._late_ns
            ):
                request.answered_late = True
                return Answer(None, request.number, unasked=True, other_board=other)
        return Answer(None, unasked=True, other_board=other)
