# SPDX-License-Identifier: GPL-2.0-or-later
"""The bus in virtual time: who put which bytes on the pair, and when their first bit began.

    host   |--- A5 40 90 .. ---|                                          |--- A5 40 91 .. ---|
    board                          37 ms  |--- A5 01 90 .. ---|   gap
    time    13.54 ms at 9600 baud          frames of a burst follow back to back

One pair, half duplex: nothing overlaps. A host that gets no good reply asks again after its time-out.
"""

from __future__ import annotations

import random
from typing import TYPE_CHECKING, NamedTuple

from dalytools.simulator.battery import Battery
from dalytools.simulator.board import SimulatedBoard, frame, is_request
from dalytools.simulator.scenario import HOST_BASE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalytools.simulator.scenario import Damage, Scenario

TICK_NS = 500_000_000  # the batteries measure twice a second
BITS_A_BYTE = 10  # 8N1

HOST, CLIENT = "host", "client"


class Sent(NamedTuple):
    """Bytes on the wire: when their first bit begins (ns of bus time), who sends them, and what is heard."""

    time_ns: int
    sender: str  # "host", "client", "board 3"
    data: bytes


class Bus:
    """Boards, host and wire of a scenario. ``now_ns`` is when the wire is next free, or the host next wants it."""

    def __init__(self, scenario: Scenario, start_ns: int = 0) -> None:
        self.scenario = scenario
        self.now_ns: int = start_ns
        self.boards: dict[int, SimulatedBoard] = {}
        for board in scenario.boards:
            battery = Battery(board.pack, f"{scenario.seed}/battery/{board.number}")
            self.boards[board.number] = SimulatedBoard(board, battery)
        self._start_ns = start_ns
        self._next_tick_ns = start_ns + TICK_NS
        self._char_ns: float = BITS_A_BYTE * 1_000_000_000 / scenario.baud
        self._timing = random.Random(f"{scenario.seed}/timing")  # noqa: S311 - chance that can be repeated
        self._harm = random.Random(f"{scenario.seed}/damage") if scenario.damage.total else None  # noqa: S311 - as above
        self._events = sorted(scenario.events, key=lambda event: event.at_s, reverse=True)
        host = scenario.host
        addresses = [HOST_BASE + number for number in self.boards] if host.address is None else [host.address]
        filler = bytes((host.filler,)) * 8
        self._requests = [frame(address, data_id, filler) for address in addresses for data_id in host.plan]
        self._plan_end = len(host.plan)
        self._turn = 0
        self._tries = 0

    def wire_ns(self, data: bytes) -> int:
        """How long these bytes occupy the wire."""
        return int(len(data) * self._char_ns)

    def poll(self) -> list[Sent]:
        """Send the host's next request, at ``now_ns``, with what follows it; moves ``now_ns`` on to the one after."""
        host = self.scenario.host
        request = self._requests[self._turn]
        sent, answered, request_end = self._exchange(request, HOST)
        if answered or self._tries >= host.retries:
            self._turn = (self._turn + 1) % len(self._requests)
            self._tries = 0
        else:
            self._tries += 1
        if not answered:
            self.now_ns = max(self.now_ns, request_end + int(host.timeout_ms * 1e6))
        gap_ms = host.gap_ms * (1 + 0.1 * self._timing.random())
        if self._turn % self._plan_end == 0:
            gap_ms += host.pause_ms
        self.now_ns += int(gap_ms * 1e6)
        return sent

    def ask(self, data: bytes, at_ns: int) -> list[Sent]:
        """Send what a client writes, at that time or as soon as the wire is free, with what the boards answer."""
        self.now_ns = max(self.now_ns, at_ns)
        sent, _, _ = self._exchange(data, CLIENT)
        return sent

    def traffic(self) -> Iterator[Sent]:
        """All that the polling host and the boards send, without end."""
        while True:
            yield from self.poll()

    def pass_time(self, until_ns: int) -> None:
        """Let events happen and the batteries move up to that time."""
        while self._events and self._start_ns + self._events[-1].at_s * 1e9 <= until_ns:
            self._happen()
        while self._next_tick_ns <= until_ns:
            for board in self.boards.values():
                pack = board.battery.pack
                if pack.speed:
                    board.battery.advance(pack.speed * TICK_NS / 1e9)
            self._next_tick_ns += TICK_NS

    def _happen(self) -> None:
        event = self._events.pop()
        board = self.boards[event.board]
        match event.what:
            case "sleep":
                board.asleep = "silence" if event.name == "silence" else "echo"
            case "wake":
                board.wake()
            case "fault":
                board.battery.forced.add(event.name)
            case "clear":
                board.battery.forced -= {event.name} if event.name else set(board.battery.forced)
        board.battery.refresh()

    def _exchange(self, request: bytes, sender: str) -> tuple[list[Sent], bool, int]:
        """Put a request on the wire at ``now_ns``; the bytes heard, whether a good answer came, the request's end."""
        began = self.now_ns
        self.pass_time(began)
        heard = self._damaged(request)
        sent = [Sent(began, sender, heard)]
        request_end = self.now_ns = began + self.wire_ns(heard)
        if not is_request(heard):
            return sent, False, request_end
        good = False
        for number, board in self.boards.items():
            answer = board.answer(heard)
            if answer is None:
                continue
            good = True
            name = f"board {number}"
            jitter = board.board.habits.jitter_ms * self._timing.random()
            self.now_ns += int((answer.delay_ms + jitter) * 1e6)
            began = self.now_ns
            length = 0
            for data in answer.frames:
                on_wire = self._damaged(data)
                good = good and on_wire is data
                sent.append(Sent(began + int(length * self._char_ns), name, on_wire))
                length += len(on_wire)
            self.now_ns = began + int(length * self._char_ns)
        return sent, good, request_end

    def _damaged(self, data: bytes) -> bytes:
        """Damage bytes as the wire does; mostly it does not, and the very object comes back."""
        if self._harm is None:
            return data
        chance = self._harm.random
        dice = chance()
        if dice >= self.scenario.damage.total:
            return data
        return _harmed(data, dice, self.scenario.damage, self._harm)


def _harmed(data: bytes, dice: float, damage: Damage, harm: random.Random) -> bytes:
    size = len(data)
    place = int(harm.random() * size)
    if dice < damage.drop:
        lost = 1 + int(harm.random() * 3)
        start = min(max(place, 1), size - 1)  # the first byte is still heard
        return data[:start] + data[start + lost :]
    dice -= damage.drop
    if dice < damage.flip:
        bit = 1 << int(harm.random() * 8)
        return data[:place] + bytes((data[place] ^ bit,)) + data[place + 1 :]
    dice -= damage.flip
    if dice < damage.insert:
        noise = bytes([int(harm.random() * 256) for _ in range(1 + int(harm.random() * 4))])
        return data[:place] + noise + data[place:]
    return data[: max(1, place)]


def traffic(scenario: Scenario, start_ns: int = 0) -> Iterator[Sent]:
    """All that a scenario's polling host and boards send, in order, without end, from that time on."""
    return Bus(scenario, start_ns).traffic()
