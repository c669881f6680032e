# SPDX-License-Identifier: GPL-2.0-or-later
"""The bus in virtual time: who put which bytes on the pair, and when their first bit began.

    host   |--- A5 40 90 .. ---|                                          |--- A5 40 91 .. ---|
    board                          37 ms  |--- A5 01 90 .. ---|   gap
    time    13.54 ms at 9600 baud          frames of a burst follow back to back

One pair, half duplex: what is heard never overlaps. A host that gets no good reply asks again after its time-out. Who
begins to speak by himself is a station (stations.py): hosts, foreign devices, what a scenario sends, replies that come
late. A station that does not listen may begin while another speaks: what is heard of both is mixed from there on.
"""

from __future__ import annotations

import random
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING

from dalytools.simulator.battery import Battery
from dalytools.simulator.board import LIE_IDS, START, SimulatedBoard, request_length, writes
from dalytools.simulator.harm import harmed, overlaid
from dalytools.simulator.notes import Notes, about
from dalytools.simulator.sent import Exchange, Sent
from dalytools.simulator.stations import NEVER, LateReply, Station, stations
from dalytools.simulator.tampering import tampered
from dalytools.simulator.truth import Truth

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalytools.simulator.scenario import Event, Harm, Scenario

TICK_NS = 500_000_000  # the batteries measure twice a second
BITS_A_BYTE = 10  # 8N1
TURN_NS = 5_000_000  # who listens lets the wire rest for so long after another has spoken

HOST, CLIENT = "host", "client"
NOISE = "noise"

_TRICKS = frozenset(
    ("silent", "late", "cut_burst", "skip_frame", "repeat_frame", "other_board", "contradict", "damage")
)


class _Trick:
    """An event that waits for the next answers of its board."""

    def __init__(self, event: Event) -> None:
        self.event = event
        self.left = event.times

    def used(self) -> Event:
        self.left -= 1
        return self.event


class Bus:
    """Boards, hosts and wire of a scenario. ``now_ns`` is when the wire is next free, or a host next wants it."""

    def __init__(self, scenario: Scenario, start_ns: int = 0, truth: Truth | None = None) -> None:
        self.scenario = scenario
        self.truth = truth or Truth()
        self.boards: dict[int, SimulatedBoard] = {}
        for board in scenario.boards:
            battery = Battery(board.pack, f"{scenario.seed}/battery/{board.number}")
            simulated = self.boards[board.number] = SimulatedBoard(board, battery)
            simulated.start = datetime.fromtimestamp(scenario.start_ns // 10**9, UTC)
        self._start_ns = start_ns
        self._free_ns = start_ns
        self._next_tick_ns = start_ns + TICK_NS
        self._char_ns: float = BITS_A_BYTE * 1_000_000_000 / scenario.baud
        self.timing = random.Random(f"{scenario.seed}/timing")  # noqa: S311 - chance that can be repeated
        self._harm = random.Random(f"{scenario.seed}/damage")  # noqa: S311 - as above
        self._events = sorted(
            (event for event in scenario.events if event.what != "send"), key=lambda event: event.at_s, reverse=True
        )
        self._last: Station | None = None  # who spoke last
        self._stations = stations(scenario, list(self.boards), start_ns)
        self._tricks: dict[int, list[_Trick]] = {}
        self._faults: dict[int, frozenset[str]] = {number: frozenset() for number in self.boards}
        self._notes = Notes(self.truth, lambda: self.now_ns)
        self.now_ns: int = self._next_wish()
        self._note_faults(start_ns)

    @property
    def speaks(self) -> bool:
        """Whether anybody will speak without being asked."""
        return bool(self._stations)

    def wire_ns(self, data: bytes) -> int:
        """How long these bytes occupy the wire."""
        return int(len(data) * self._char_ns)

    def poll(self) -> list[Sent]:
        """Let the next station speak, at ``now_ns``, with what follows it; moves ``now_ns`` on to the one after."""
        if not self._stations:
            self.now_ns = NEVER
            return []
        station = min(self._stations, key=self._wish)
        self.now_ns = max(self.now_ns, self._wish(station), self._free_ns)
        self._last = station
        sent = station.speak(self)
        self._free_ns = max(self._free_ns, self.now_ns)
        if station.due_ns >= NEVER:
            self._stations.remove(station)
        self.now_ns = self._next_wish()
        return sent

    def _wish(self, station: Station) -> int:
        """When this station would begin if nobody else did."""
        if not station.listens:
            return station.due_ns
        rest = 0 if self._last in {None, station} else TURN_NS
        return max(station.due_ns, self._free_ns + rest)

    def _next_wish(self) -> int:
        return min(map(self._wish, self._stations), default=NEVER)

    def ask(self, data: bytes, at_ns: int) -> list[Sent]:
        """Send what a client writes, at that time or as soon as the wire is free, with what the boards answer."""
        self.now_ns = max(self.now_ns if self.now_ns < NEVER else 0, at_ns)
        sent = self.exchange(data, CLIENT).sent
        self._free_ns = max(self._free_ns, self.now_ns)
        return sent

    def traffic(self) -> Iterator[Sent]:
        """All that hosts, boards and others send; without end, unless nobody has anything to say any more."""
        while self._stations:
            yield from self.poll()

    def pass_time(self, until_ns: int) -> None:
        """Let events happen and the batteries move up to that time."""
        while self._events and self._start_ns + self._events[-1].at_s * 1e9 <= until_ns:
            self._happen(self._events.pop())
        moved = False
        while self._next_tick_ns <= until_ns:
            for board in self.boards.values():
                pack = board.battery.pack
                if pack.speed:
                    board.battery.advance(pack.speed * TICK_NS / 1e9)
            self._next_tick_ns += TICK_NS
            moved = True
        if moved:
            self._note_faults(self._next_tick_ns - TICK_NS)
        for board in self.boards.values():
            board.now_s = (until_ns - self._start_ns) / 1e9

    def _happen(self, event: Event) -> None:
        board = self.boards[event.board]
        at_ns = self._start_ns + int(event.at_s * 1e9)
        match event.what:
            case "sleep":
                board.asleep = "silence" if event.name == "silence" else "echo"
                self.truth.note(at_ns, "asleep", board=event.board)
            case "wake":
                board.wake()
                self.truth.note(at_ns, "awake", board=event.board)
            case "fault":
                board.battery.forced.add(event.name)
            case "clear":
                board.battery.forced -= {event.name} if event.name else set(board.battery.forced)
            case _:
                self._tricks.setdefault(event.board, []).append(_Trick(event))
        board.battery.refresh()
        self._note_faults(at_ns)

    def _note_faults(self, at_ns: int) -> None:
        if not self.truth.on:
            return
        for number, board in self.boards.items():
            faults = board.battery.reading.faults
            for name in sorted(faults - self._faults[number]):
                self.truth.note(at_ns, "fault_set", board=number, name=name)
            for name in sorted(self._faults[number] - faults):
                self.truth.note(at_ns, "fault_unset", board=number, name=name)
            self._faults[number] = faults

    # One exchange ----------------------------------------------------------------------------------------------------

    def exchange(self, request: bytes, sender: str) -> Exchange:
        """Put a request on the wire at ``now_ns``, with what answers it; moves ``now_ns`` to the end of that."""
        began = self.now_ns
        self.pass_time(began)
        heard = self._damaged(request, began, sender)
        sent = self._mixed(Sent(began, sender, heard))
        request_end = self.now_ns = began + self.wire_ns(heard)
        if len(sent) > 1 or sent[0].data is not heard:
            self.now_ns = max(piece.time_ns + self.wire_ns(piece.data) for piece in sent)
            return Exchange(sent, False, request_end)
        if request_length(heard) != len(heard) or not heard:
            if request in heard:
                self._notes.unanswered(request, sender, began, "damaged")
            return Exchange(sent, False, request_end)
        good, complete, why = self._answers(heard, sent)
        if not good:
            self._notes.unanswered(heard, sender, began, why)
        if self.truth.on and writes(heard):
            self._notes.write(heard, sender, began, sent[1:])
        return Exchange(sent, complete or why == "echo", request_end)

    def _answers(self, request: bytes, sent: list[Sent]) -> tuple[bool, bool, str]:
        """Let the boards answer; append what is heard. Whether a good reply came in time, and all of it; if not, why.

        ``echo``: the request itself came back, which a careless host takes for an answer.
        """
        good, complete, why = False, False, "no such board"
        for number, board in self.boards.items():
            tricks = self._tricks_on(number, request)
            asleep, zero = board.asleep, board.zero_replies_left
            board.lies = {event.name for event in tricks if event.what == "contradict"}
            stranger = None if asleep else next((event for event in tricks if event.what == "other_board"), None)
            answer = board.answer(self._meant_for(number, request) if stranger else request)
            board.lies = set()
            if answer is None:
                if board.listens_to(request):
                    why = "asleep" if asleep else "not answered"
                continue
            if any(event.what == "silent" for event in tricks):
                why = "silent"
                continue
            frames, done = tampered(answer.frames, tricks)
            lies = [] if zero else tricks  # zeros say nothing
            name = f"board {number}"
            jitter = board.board.habits.jitter_ms * self.timing.random()
            delay_ns = int((answer.delay_ms + jitter) * 1e6)
            late = None if asleep else next((event for event in tricks if event.what == "late"), None)
            if late is not None:
                due = self.now_ns + delay_ns + int(late.delay_ms * 1e6)
                faults = board.battery.reading.faults
                begins = partial(self._notes.late, number, request, due - int(late.delay_ms * 1e6), done, zero=zero > 0)
                said = partial(self._notes.said, number, request, frames, lies, None if zero else faults)
                self._stations.append(LateReply(due, name, frames, begins, said))
                why = "late"
                continue
            self._notes.tampered(number, request, done)
            quiet_from = self.now_ns
            self.now_ns += delay_ns
            if asleep:
                self.truth.note(self.now_ns, "echo", **about(request), address=request[1])
            elif zero:
                self.truth.note(self.now_ns, "zero_reply", board=number, **about(request))
            if stranger:  # of zeros or not
                self.truth.note(self.now_ns, "other_board", board=number, asked=request[1] - 0x3F, **about(request))
            harm = next((event for event in tricks if event.what == "damage"), None)
            whole, some = self._speak(name, frames, sent, harm, silent_from_ns=quiet_from)
            if asleep:
                why = "echo" if whole else "damaged"
            elif stranger:
                if some and not zero:
                    self._notes.faults(number, request, frames, board.battery.reading.faults)
            elif some:
                good, complete = True, whole
                faults = board.battery.reading.faults
                self._notes.said(number, request, frames, lies, None if zero else faults)
            else:
                why = "damaged"
        return good, complete, why

    def _speak(
        self,
        name: str,
        frames: list[bytes],
        sent: list[Sent],
        harm: Event | None = None,
        *,
        silent_from_ns: int | None = None,
    ) -> tuple[bool, bool]:
        """Put frames on the wire back to back, from ``now_ns`` on; whether all were heard well, and whether one was.

        silent_from_ns: since when nobody has spoken; who does not listen may begin to speak in that time.
        """
        began, length, good, some = self.now_ns, 0, True, False
        lost = silent_from_ns is not None and self._filled_gap(silent_from_ns, Sent(began, name, frames[0]), sent)
        if lost:
            frames, good = frames[1:], False
            length = round((sent[-1].time_ns - began) / self._char_ns) + len(sent[-1].data)
        for place, data in enumerate(frames, 1):
            at = began + int(length * self._char_ns)
            forced: Harm | None = None
            if harm is not None and place == min(harm.frames, len(frames)):
                forced = harm.name  # pyright: ignore[reportAssignmentType] - checked by Event
            on_wire = self._damaged(data, at, name, forced)
            pieces = self._mixed(Sent(at, name, on_wire))
            good = good and len(pieces) == 1 and pieces[0].data is data
            some = some or (len(pieces) == 1 and data in pieces[0].data)
            sent += pieces
            length += len(on_wire)
            last = pieces[-1]
            length = max(length, round((last.time_ns - began) / self._char_ns) + len(last.data))
        self.now_ns = began + int(length * self._char_ns)
        return good, some

    def _filled_gap(self, since_ns: int, reply: Sent, sent: list[Sent]) -> bool:
        """Let who does not listen speak between a request and its reply; whether that ran into the reply."""
        for station in self._careless():
            if since_ns <= station.due_ns < reply.time_ns and (said := station.barge_in(self)):
                name, data, at = said
                place = round((reply.time_ns - at) / self._char_ns)
                if place >= len(data):
                    sent.append(Sent(at, name, data))  # whole, but the board is busy
                    self._notes.unanswered(data, name, at, "busy")
                    return False
                both = overlaid(data, reply.data, place)
                sent.append(Sent(at, f"{name}, {reply.sender}", both))
                self.truth.note(at, "collision", senders=[name, reply.sender], heard=both.hex(), harmed=True)
                return True
        return False

    def say(self, data: bytes, sender: str) -> list[Sent]:
        """Put bytes that nobody answers on the wire at ``now_ns``; moves it to their end."""
        self.pass_time(self.now_ns)
        sent: list[Sent] = []
        self._speak(sender, [data], sent)
        return sent

    def _careless(self) -> list[Station]:
        """Those who do not listen, but for the one that speaks now."""
        return [station for station in self._stations if not station.listens and station is not self._last]

    def _mixed(self, piece: Sent) -> list[Sent]:
        """Return what is heard of a piece when stations that do not listen begin to speak during it."""
        for station in self._careless():
            place = round((station.due_ns - piece.time_ns) / self._char_ns)  # behind the last byte it harms none
            if station.due_ns >= piece.time_ns and place < len(piece.data) and (said := station.barge_in(self)):
                name, data, at = said
                heard = overlaid(piece.data, data, place)
                harmed = heard != piece.data  # zeros win: what falls on them alone leaves no trace
                self.truth.note(at, "collision", senders=[piece.sender, name], heard=heard.hex(), harmed=harmed)
                return [Sent(piece.time_ns, f"{piece.sender}, {name}", heard) if harmed else piece]
        return [piece]

    # What goes wrong on demand ---------------------------------------------------------------------------------------

    def _tricks_on(self, number: int, request: bytes) -> list[Event]:
        """Events that wait for this board's next answer, and this is one; each use counts."""
        waiting = self._tricks.get(number)
        if not waiting:
            return []
        mine = self.boards[number].listens_to(request)
        data_id = request[2] if request[0] == START else None
        used: list[Event] = []
        for trick in waiting:
            event = trick.event
            if mine == (event.what == "other_board"):
                continue
            if event.what == "other_board" and (request[0] != START or not 0x41 <= request[1] <= 0x4F):
                continue
            if event.what == "contradict" and data_id != LIE_IDS[event.name] and (data_id or event.name != "soc"):
                continue
            if event.what in {"cut_burst", "skip_frame", "repeat_frame"} and data_id not in {0x95, 0x96, 0x57}:
                continue
            if event.data_id is not None and event.data_id != data_id:
                continue
            used.append(trick.used())
        self._tricks[number] = [trick for trick in waiting if trick.left > 0]
        return used

    def _meant_for(self, number: int, request: bytes) -> bytes:
        """Return the same question, to another board."""
        address = 0x3F + number
        return bytes((START, address, *request[2:12], (sum(request[2:12]) + START + address) & 0xFF))

    def _damaged(self, data: bytes, at_ns: int, sender: str, forced: Harm | None = None) -> bytes:
        """Damage bytes as the wire does; mostly it does not, and the very object comes back."""
        damage = self.scenario.damage
        if forced is None:
            if not damage.total:
                return data
            dice = self._harm.random()
            if dice >= damage.total:
                return data
            how, heard = harmed(data, dice, damage, self._harm)
        else:
            how, heard = harmed(data, forced, damage, self._harm)
        if self.truth.on:
            self.truth.note(at_ns, "damaged", sender=sender, how=how, sent=data.hex(), heard=heard.hex())
        return heard


def traffic(scenario: Scenario, start_ns: int = 0) -> Iterator[Sent]:
    """All that a scenario's hosts and boards send, in order, from that time on; without end while a host polls."""
    return Bus(scenario, start_ns).traffic()
