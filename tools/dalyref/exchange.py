# SPDX-License-Identifier: GPL-2.0-or-later
"""Requests and the replies that belong to them, on one bus (docs/records.md, sections 6 and 7).

request --+---------------- waits 1 s ----------------|        answered: waits no more
          |<100 ms>| the same again: echo (once)
                   | the same again: retry -- waits in its own right

A request repeated after its answer is neither: it is the next poll.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from dalyref import addresses

if TYPE_CHECKING:
    from dalyref.options import Options
    from dalyref.packet import Direction

_MOST_WAITING = 256
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
    only: int
    """The one board whose reply it takes, 0: any board's."""
    owner: T
    """What the caller wants to know when the answer comes."""
    answered: bool = False
    echoed: bool = False


class Exchange(Generic[T]):
    """The requests of one bus."""

    def __init__(self, options: Options) -> None:
        self._wait_ns = options.limit_ns(options.reply)
        self._echo_ns = options.limit_ns(options.echo)
        self._newest: dict[bytes, Request[T]] = {}
        self._waiting: dict[int, list[Request[T]]] = {}
        self._latest_ns = 0

    def pass_time(self, start_ns: int) -> None:
        """Take the beginning of any frame of the bus: a clock that steps back does not revive a request."""
        self._latest_ns = max(self._latest_ns, start_ns)

    def _waits(self, request: Request[T]) -> bool:
        return self._latest_ns - request.end_ns <= self._wait_ns

    def ask(
        self, frame: bytes, number: int, start_ns: int, end_ns: int, *, side: Direction, owner: T
    ) -> tuple[int, bool]:
        """Take a frame from a host: return (``addresses.REQUEST`` or ``ECHO``, whether it is a retry)."""
        before = self._newest.pop(frame, None)
        retry = False
        if before is not None and not before.answered and self._waits(before):
            if before.side and side:
                echo = before.side != side
            else:
                echo = not before.echoed and start_ns - before.end_ns <= self._echo_ns
            if echo:
                before.echoed = True
                self._newest[frame] = before
                return addresses.ECHO, False
            retry = True
        request = Request(number, end_ns, side, addresses.only_board(frame[1]), owner)
        self._newest[frame] = request
        if len(self._newest) > _MOST_DIFFERENT:
            del self._newest[next(iter(self._newest))]
        waiting = self._waiting.setdefault(frame[2], [])
        waiting.append(request)
        if len(waiting) > _MOST_WAITING:
            del waiting[0]
        return addresses.REQUEST, retry

    def answer(self, data_id: int, board: int) -> Request[T] | None:
        """Take a reply: return the request it belongs to, which then waits no more."""
        waiting = self._waiting.get(data_id)
        if not waiting:
            return None
        for index in range(len(waiting) - 1, -1, -1):
            request = waiting[index]
            if self._waits(request) and request.only in (0, board):
                request.answered = True
                del waiting[index]
                return request
        return None
