# SPDX-License-Identifier: GPL-2.0-or-later
"""Who begins to speak on the bus unasked: polling hosts, foreign devices, what a scenario sends, late replies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol

from dalytools.simulator import modbus
from dalytools.simulator.board import frame
from dalytools.simulator.scenario import HOST_BASE

if TYPE_CHECKING:
    from collections.abc import Callable
    from random import Random

    from dalytools.simulator.scenario import Event, Foreign, Host, Scenario
    from dalytools.simulator.sent import Exchange, Sent
    from dalytools.simulator.truth import Truth

NEVER: Final = 1 << 62  # ns
APP_READS: Final = {"d2": ((0x00, 0x3E), (0x80, 0x29), (0xA9, 0x20)), "81": ((0x00, 0x40), (0x41, 0x3E), (0x178, 0x4A))}
"""What Daly's app reads of each dialect (field notes d, reads seen)."""


class Pair(Protocol):
    """The bus, as far as a station needs it."""

    now_ns: int
    timing: Random
    truth: Truth

    def wire_ns(self, data: bytes) -> int:
        """How long these bytes occupy the wire."""
        ...

    def exchange(self, request: bytes, sender: str) -> Exchange:
        """Send a request at ``now_ns``, with what the boards answer; moves that on."""
        ...

    def say(self, data: bytes, sender: str) -> list[Sent]:
        """Send bytes at ``now_ns``; moves that on."""
        ...


class Station(Protocol):
    """Speaks at ``due_ns`` (NEVER: has nothing more to say), or once the wire is free if it ``listens``."""

    due_ns: int
    listens: bool

    def speak(self, bus: Pair) -> list[Sent]:
        """Speak at the bus's ``now_ns``, move that to the end of what follows, and set ``due_ns`` anew."""
        ...

    def barge_in(self, bus: Pair) -> tuple[str, bytes, int] | None:
        """Speak into what others say: name, bytes, when; sets ``due_ns`` anew. Only of one that does not listen."""
        ...


class PollingHost:
    """Asks its plan over and over; what is not answered well is asked again, some times."""

    def __init__(self, host: Host, boards: list[int], start_ns: int) -> None:
        self.host = host
        self.listens = host.listens
        self.due_ns = start_ns + int(host.start_s * 1e9)
        self._stop_ns = start_ns + int(host.stop_s * 1e9) if host.stop_s else NEVER
        self._requests = _requests(host, [number for number in boards if not host.boards or number in host.boards])
        self._plan_end = len(host.plan) if host.dialect == "a5" else len(host.reads or APP_READS[host.dialect])
        self._turn = 0
        self._tries = 0
        if not self._requests:
            self.due_ns = NEVER

    def speak(self, bus: Pair) -> list[Sent]:
        """Send the next request, with what follows it."""
        heard = bus.exchange(self._requests[self._turn], self.host.name)
        self._go_on(bus, answered=heard.answered, request_end_ns=heard.request_end_ns)
        return heard.sent

    def barge_in(self, bus: Pair) -> tuple[str, bytes, int] | None:
        """Send the next request into what is on the wire: it is lost."""
        request, at = self._requests[self._turn], self.due_ns
        now, bus.now_ns = bus.now_ns, at
        self._go_on(bus, answered=False, request_end_ns=at + bus.wire_ns(request))
        bus.now_ns = now
        return self.host.name, request, at

    def _go_on(self, bus: Pair, *, answered: bool, request_end_ns: int) -> None:
        host = self.host
        if answered or self._tries >= host.retries:
            self._turn = (self._turn + 1) % len(self._requests)
            self._tries = 0
        else:
            self._tries += 1
        due = bus.now_ns
        if not answered:
            due = max(due, request_end_ns + int(host.timeout_ms * 1e6))
        gap_ms = host.gap_ms * (1 + 0.1 * bus.timing.random())
        if self._turn % self._plan_end == 0:
            gap_ms += host.pause_ms
        self.due_ns = due + int(gap_ms * 1e6)
        if self.due_ns >= self._stop_ns:
            self.due_ns = NEVER


def _requests(host: Host, boards: list[int]) -> list[bytes]:
    if host.dialect == "a5":
        addresses = [HOST_BASE + number for number in boards] if host.address is None else [host.address]
        filler = bytes((host.filler,)) * 8
        return [frame(address, data_id, filler) for address in addresses for data_id in host.plan]
    addresses = [modbus.D2] if host.dialect == "d2" else [modbus.ASKS_81 + number for number in boards]
    reads = host.reads or APP_READS[host.dialect]
    return [modbus.read_request(address, register, count) for address in addresses for register, count in reads]


class ForeignDevice:
    """Says the same thing again and again, on a serial line."""

    listens = True

    def __init__(self, foreign: Foreign, start_ns: int) -> None:
        self.foreign = foreign
        self.due_ns = start_ns + int(foreign.start_s * 1e9)

    def speak(self, bus: Pair) -> list[Sent]:
        """Say it, and let it be answered."""
        foreign = self.foreign
        bus.truth.note(bus.now_ns, "foreign", name=foreign.name)
        sent = bus.say(foreign.data, foreign.name)
        if foreign.answer:
            bus.now_ns += int(foreign.answer_ms * 1e6)
            sent += bus.say(foreign.answer, foreign.name)
        self.due_ns += int(foreign.period_s * 1e9)
        return sent

    def barge_in(self, bus: Pair) -> tuple[str, bytes, int] | None:  # noqa: ARG002 - it listens
        """Never: it listens."""
        return None


class ScriptedSend:
    """Bytes that a scenario sends once."""

    listens = True

    def __init__(self, event: Event, start_ns: int) -> None:
        self.event = event
        self.due_ns = start_ns + int(event.at_s * 1e9)
        self._left = event.times

    def speak(self, bus: Pair) -> list[Sent]:
        """Send them, with what the boards answer."""
        sent = bus.exchange(self.event.data, self.event.sender).sent
        self._left -= 1
        self.due_ns = bus.now_ns + 100_000_000 if self._left else NEVER
        return sent

    def barge_in(self, bus: Pair) -> tuple[str, bytes, int] | None:  # noqa: ARG002 - it listens
        """Never: it listens."""
        return None


class LateReply:
    """What a board had to say a while ago."""

    listens = True

    def __init__(
        self, due_ns: int, name: str, frames: list[bytes], begins: Callable[[], None], said: Callable[[], None]
    ) -> None:
        """begins, said: to be called when it begins, once the line is free, and when it was said and heard well."""
        self.due_ns = due_ns
        self._name = name
        self._frames = frames
        self._begins = begins
        self._said = said

    def speak(self, bus: Pair) -> list[Sent]:
        """Say it now."""
        self._begins()
        sent: list[Sent] = []
        for data in self._frames:
            sent += bus.say(data, self._name)
        if any(piece.data in self._frames for piece in sent):
            self._said()
        self.due_ns = NEVER
        return sent

    def barge_in(self, bus: Pair) -> tuple[str, bytes, int] | None:  # noqa: ARG002 - it listens
        """Never: it listens."""
        return None


def stations(scenario: Scenario, boards: list[int], start_ns: int) -> list[Station]:
    """All that speak by themselves in a scenario. What stands on CAN alone is not here."""
    made: list[Station] = [PollingHost(host, boards, start_ns) for host in scenario.hosts]
    made += [ForeignDevice(foreign, start_ns) for foreign in scenario.foreign if foreign.can_id is None]
    made += [ScriptedSend(event, start_ns) for event in scenario.events if event.what == "send"]
    return [station for station in made if station.due_ns < NEVER]
