# SPDX-License-Identifier: GPL-2.0-or-later
"""Modbus requests and the replies that belong to them, on one bus (docs/wires.md, section 1).

    81 03 0000 0040 ----> waits 1 s                51 03 80 ...   64 registers: fits, and says where they begin
    D2 03 0000 003E ----> waits
    D2 03 0080 003E ----> waits                    D2 03 7C ...   62 registers: fits both: ambiguous

A reply does not say which registers it brings: the request does. No echoes, no retries: Modbus has neither.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Generic, TypeVar

from dalyref.modbus_frame import D2, Shape

if TYPE_CHECKING:
    from dalyref.modbus_frame import ModbusFrame
    from dalyref.options import Options
    from dalyref.packet import Direction

_MOST_ASKED = 1024
"""Unanswered requests remembered for one address and function: a hostile capture shall not fill the memory."""

T = TypeVar("T")


@dataclass(slots=True, eq=False)
class ModbusRequest(Generic[T]):
    """A request seen on the bus."""

    frame: ModbusFrame
    number: int
    """Of its packet."""
    end_ns: int
    side: Direction
    owner: T
    """What the caller wants to know when the answer comes."""
    answered_late: bool = False


@dataclass(frozen=True, slots=True)
class ModbusAnswer(Generic[T]):
    """What a reply belongs to."""

    request: ModbusRequest[T] | None = None
    ambiguous: ModbusRequest[T] | None = None
    """It fits requests for different registers: the oldest of them."""
    unasked: bool = False
    late_to: int = 0
    """Packet of the request that it comes too late for, 0: none."""


class ModbusExchange(Generic[T]):
    """The Modbus requests of one bus."""

    def __init__(self, options: Options) -> None:
        self.began = False
        """A request was seen."""
        self._wait_ns = options.limit_ns(options.reply)
        self._late_ns = options.limit_ns(options.late)
        self._asked: dict[tuple[int, int], list[ModbusRequest[T]]] = {}  # by address, function; the oldest first
        self._latest_ns = 0

    def pass_time(self, start_ns: int) -> None:
        """Take the beginning of any frame of the bus: a clock that steps back does not revive a request."""
        self._latest_ns = max(self._latest_ns, start_ns)

    def _waits(self, request: ModbusRequest[T]) -> bool:
        return self._latest_ns - request.end_ns <= self._wait_ns

    def is_request(self, frame: ModbusFrame, side: Direction) -> bool:
        """Tell a request from a reply."""
        if frame.asks is not None:
            return frame.asks
        before = [
            request
            for request in self._asked.get((D2, frame.function), [])
            if self._waits(request) and request.frame.register == frame.register
        ]
        if side:
            sided = next((request for request in reversed(before) if request.side), None)
            if sided is not None:
                return sided.side == side
        return not any(request.frame == frame for request in before)

    def ask(self, request: ModbusRequest[T]) -> None:
        """Take a request."""
        self.began = True
        asked = self._asked.setdefault((request.frame.address, request.frame.function), [])
        longest_ns = max(self._late_ns, self._wait_ns)
        while asked and (len(asked) >= _MOST_ASKED or self._latest_ns - asked[0].end_ns > longest_ns):
            del asked[0]
        asked.append(request)

    def answer(self, frame: ModbusFrame, start_ns: int) -> ModbusAnswer[T]:
        """Take a reply: find the request it belongs to, which then waits no more."""
        asker = D2 if frame.d2 else 0x80 + frame.board
        asked = self._asked.get((asker, frame.function & 0x7F), [])
        fitting = [request for request in asked if _fits(frame, request.frame)]
        waiting = [request for request in fitting if self._waits(request)]
        if waiting:
            if len({request.frame.register for request in waiting}) > 1:
                asked.remove(waiting[0])
                return ModbusAnswer(ambiguous=waiting[0])
            asked.remove(waiting[-1])
            return ModbusAnswer(waiting[-1])
        for request in reversed(fitting):
            if not request.answered_late and start_ns - request.end_ns <= self._late_ns:
                request.answered_late = True
                return ModbusAnswer(unasked=True, late_to=request.number)
        return ModbusAnswer(unasked=self.began)


def _fits(reply: ModbusFrame, request: ModbusFrame) -> bool:
    """Tell whether a reply can be that of a request from the address and with the function it answers."""
    match reply.shape:
        case Shape.READ_REPLY:
            return reply.count == request.count
        case Shape.WRITE_ONE:
            return reply.register == request.register
        case Shape.WRITE_MANY_REPLY:
            return (reply.register, reply.count) == (request.register, request.count)
        case _:
            return True
