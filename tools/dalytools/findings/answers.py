# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about answers in several frames: burst-missing, burst-repeat, burst-cut-off, burst-length (records.md 8)."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.place import REPLY, REQUEST, Place, address_of, first_number, number, place_of, words
from dalytools.findings.rules import found
from dalytools.findings.waiting import Waiting
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalytools.findings.finding import Finding

_REMEMBERED = 1024  # requests
_MOST_FRAMES = 16  # paper 3, 0x95
_QUIET_NS = 500_000_000


@dataclass(slots=True)
class _Hole:
    tally: Tally = field(default_factory=Tally)
    numbers: set[str] = field(default_factory=set[str])


@dataclass(slots=True)
class _Running:
    """A burst as far as it came."""

    asker: int | None
    request: int
    first: int
    last: int
    end_ns: int
    packet: int
    time_ns: int
    whole: bool = True


@dataclass(slots=True)
class _Length:
    """How many frames the bursts of one place had."""

    usual: int = 0
    tally: Tally = field(default_factory=Tally)
    seen: set[int] = field(default_factory=set[int])


class Answers(Watch):
    """Follows bursts by place. How many frames a whole one has is compared among those that the same address asked."""

    def __init__(self) -> None:
        self._missing = Groups(_Hole)
        self._repeats = Groups(Tally)
        self._cut_off = Groups(Tally)
        self._running: dict[Place, _Running] = {}
        self._lengths = Groups(_Length)
        self._askers: OrderedDict[int, int | None] = OrderedDict()  # request's packet: its address
        self._waiting = Waiting[tuple[str, int], int]()  # bus, data ID: by whom
        self._cells: dict[Place, object] = {}  # newest counts, by board
        self._now_ns = 0

    def record(self, record: Decoded, bus: str) -> None:
        """See one record."""
        fields = record.fields
        direction = fields.get("daly.direction")
        self._now_ns = max(self._now_ns, record.time_ns)
        if record.kind is not Kind.FRAME or direction is None:
            return
        if direction == REQUEST:
            asker = first_number(fields, "daly.can.source", "daly.address", "daly.modbus.address")
            self._askers[record.number] = asker
            data_id = number(fields, "daly.data_id")
            if data_id is not None and asker is not None and "daly.unanswered" in fields:
                self._waiting.ask((bus, data_id), record.time_ns, asker)
            if len(self._askers) > _REMEMBERED:
                self._askers.popitem(last=False)
            return
        if direction != REPLY:
            return
        if "daly.cell_count" in fields and "daly.sensor_count" in fields:
            self._counts(record, bus)
        frame = number(fields, "daly.frame_number")
        if frame is None or frame > _MOST_FRAMES:
            return
        place = place_of(record, bus)
        if "daly.burst.missing" in fields:
            hole = self._missing[place]
            hole.tally.add(record.number, record.time_ns)
            hole.numbers.update(words(fields, "daly.burst.missing"))
        if "daly.burst.repeat" in fields:
            self._repeats[place].add(record.number, record.time_ns)
        if "daly.burst.cut_off" in fields:
            self._cut_off[place].add(record.number, record.time_ns)
        self._follow(record, place, frame)

    def _counts(self, record: Decoded, bus: str) -> None:
        """Forget lengths when the board changes what it says it has: then they may change too."""
        board = Place(bus, number(record.fields, "daly.board"), address_of(record.fields))
        now = record.fields["daly.cell_count"], record.fields["daly.sensor_count"]
        if 0 not in now and self._cells.get(board, now) != now:
            for place in [place for place in self._running if place.board == board.board]:
                self._end(place, self._running.pop(place))
            for place, length in self._lengths.items():
                if place.board == board.board:
                    length.usual = 0
        if len(self._cells) < _REMEMBERED:
            self._cells[board] = now

    def _follow(self, record: Decoded, place: Place, frame: int) -> None:
        fields = record.fields
        request = number(fields, "daly.request_in") or 0
        running = self._running.get(place)
        repeated = "daly.burst.repeat" in fields
        if running is not None and (
            frame < running.last
            or (frame == running.last and not repeated)
            or request != running.request
            or record.time_ns - running.end_ns > _QUIET_NS
        ):
            self._end(place, running)
            running = None
        if running is None:
            if len(self._running) > _REMEMBERED:
                self._running.clear()
            asker = self._askers.get(request)
            running = _Running(asker, request, frame, frame, record.time_ns, record.number, record.time_ns)
            self._running[place] = running
        running.last, running.end_ns = frame, record.time_ns
        running.packet, running.time_ns = record.number, record.time_ns
        if "daly.burst.missing" in fields or "daly.burst.cut_off" in fields or not request:
            running.whole = False
        # One of two who asked at once: whom the board heard is not told by the reply (records.md 7).
        other = self._waiting.at((place.bus, number(fields, "daly.data_id") or 0), record.time_ns)
        if other is not None and other != running.asker:
            running.whole = False

    def _end(self, place: Place, running: _Running) -> None:
        """Compare the length of a burst that has ended, and has no fault of its own."""
        if not running.whole:
            return
        asked = f"asked by 0x{running.asker:02X}" if running.asker is not None else ""
        length = self._lengths[Place(place.bus, place.board, place.address, place.data_id, place.register, asked)]
        frames = running.last - running.first + 1
        if length.usual and frames != length.usual:
            length.tally.add(running.packet, running.time_ns)
            length.seen.update((length.usual, frames))
        length.usual = frames

    def findings(self) -> Iterator[Finding]:
        """Say which bursts were not whole. One that the capture's end may have cut is not measured."""
        for place, running in self._running.items():
            if self._now_ns - running.end_ns > _QUIET_NS:
                self._end(place, running)
        self._running.clear()
        for place, hole in self._missing.items():
            numbers = ", ".join(sorted(hole.numbers, key=int)[:20])
            text = f"frames are missing in {counted(hole.tally.count, 'answer')}: number {numbers}"
            yield found("burst-missing", place, hole.tally, text)
        for place, tally in self._repeats.items():
            yield found("burst-repeat", place, tally, f"{counted(tally.count, 'frame')} came twice in one answer")
        for place, tally in self._cut_off.items():
            text = f"{counted(tally.count, 'answer')} stopped before the last cell or sensor"
            yield found("burst-cut-off", place, tally, text)
        for place, length in self._lengths.items():
            if length.tally.count:
                seen = " or ".join(map(str, sorted(length.seen)))
                text = f"answers have {seen} frames; their number changed {counted(length.tally.count, 'time')}"
                yield found("burst-length", place, length.tally, text)
