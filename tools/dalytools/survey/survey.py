# SPDX-License-Identifier: GPL-2.0-or-later
"""Takes packets and decoded records; then holds every place of the traffic. Memory does not grow with the capture."""

from __future__ import annotations

import re
from collections import Counter, deque
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from dalyref.kinds import Kind
from dalyref.packet import CanFrame
from dalytools.survey.known import Known
from dalytools.survey.newest import Newest
from dalytools.survey.place import A5, REPLY
from dalytools.survey.stream import NANO, Stream
from dalytools.survey.units import MOST_PAGES, of_can, units

if TYPE_CHECKING:
    from dalyref.decoder import Decoded
    from dalyref.packet import Packet
    from dalytools.survey.place import Place

MOST_PLACES: Final = 1000
_MOST_PENDING: Final = 70_000
_MOST_INTERFACES: Final = 4096
_NEXT_FRAME_NS: Final = NANO // 10
"""Frames of one answer follow each other within this."""
_BUS_NAME: Final = re.compile(r"bus=([^\s,;]+)")


class Survey:
    """Of one capture, or several behind each other."""

    def __init__(self) -> None:
        self.records = 0
        self.kinds: Counter[str] = Counter()
        self.streams: dict[Place, Stream] = {}
        self.left_out = 0
        """Payloads of places beyond the most that are kept."""
        self.begin_ns = self.end_ns = 0
        self._made = 0
        self._known = Known()
        self._buses: dict[int, str] = {}
        self._newest: dict[str, Newest[Stream]] = {}
        self._pending: deque[CanFrame] = deque()
        self._paged: set[Place] = set()
        self._asked: dict[Place, bool] = {}

    def packet(self, packet: Packet) -> None:
        """Take a packet before the decoder does: CAN frames that it passes over are surveyed too."""
        interface = packet.interface
        if interface not in self._buses and len(self._buses) < _MOST_INTERFACES:
            named = _BUS_NAME.search(packet.description)
            self._buses[interface] = named[1] if named else str(interface)
        if isinstance(packet, CanFrame):
            self._pending.append(packet)
            if len(self._pending) > _MOST_PENDING:
                self._passed_over(self._pending.popleft())

    def add(self, record: Decoded) -> None:
        """Take the next record."""
        pending = self._pending
        while pending and pending[0].number < record.number:
            self._passed_over(pending.popleft())
        frame = pending.popleft() if pending and pending[0].number == record.number else None
        self._moment(record.time_ns)
        self.kinds[record.kind.value] += 1
        bus = record.connection or self._bus(record.interface)
        if record.kind is Kind.FOREIGN and frame is not None:
            self._take(*of_can(frame, bus), record.time_ns)
            return
        first = True
        for place, data in units(record, bus):
            if first and place.direction == REPLY:
                self._known.take(bus, place.board, record.fields)
            first = False
            unknown = "daly.unknown_id" in record.fields
            where = self._page(place, data, record) if unknown and place.direction == REPLY else place
            self._take(where, data, record.time_ns, unknown=unknown)

    def end_of_file(self) -> None:
        """Take the end of a file: packets and interfaces of the next one are numbered from the beginning."""
        while self._pending:
            self._passed_over(self._pending.popleft())
        self._buses.clear()

    def finish(self) -> None:
        """Take the end of all."""
        for stream in self.streams.values():
            stream.moves.settle()

    def _moment(self, time_ns: int) -> None:
        if not self.records:
            self.begin_ns = self.end_ns = time_ns
        self.records += 1
        self.begin_ns = min(self.begin_ns, time_ns)
        self.end_ns = max(self.end_ns, time_ns)

    def _bus(self, interface: int) -> str:
        return self._buses.get(interface, str(interface))

    def _passed_over(self, frame: CanFrame) -> None:
        self._moment(frame.time_ns)
        self.kinds["not Daly's"] += 1
        self._take(*of_can(frame, self._bus(frame.interface)), frame.time_ns)

    def _page(self, place: Place, data: bytes, record: Decoded) -> Place:
        """Find out whether an unknown ID is answered in several frames, numbered in byte 0; then each is a place.

        So it is where a frame that nobody asked for follows at once on one that was asked for, numbered one higher.
        """
        if place.dialect != A5 or not data:
            return place
        asked = "daly.request_in" in record.fields
        if place in self._paged:
            return replace(place, page=min(data[0], MOST_PAGES))
        before = self.streams.get(place)
        follows = (
            before is not None
            and not asked
            and self._asked.get(place, False)
            and data[0] == before.last[0] + 1
            and 0 <= record.time_ns - before.last_ns <= _NEXT_FRAME_NS
        )
        if len(self._asked) < MOST_PLACES:
            self._asked[place] = asked
        if before is None or not follows:
            return place
        self._paged.add(place)
        if before.count == 1:  # the first frame of the first answer
            del self.streams[place]
            self._take(replace(place, page=min(before.last[0], MOST_PAGES)), before.last, before.last_ns, unknown=True)
        return replace(place, page=min(data[0], MOST_PAGES))

    def _take(self, place: Place, data: bytes, time_ns: int, *, unknown: bool = False) -> None:
        stream = self.streams.get(place)
        if stream is None:
            if len(self.streams) >= MOST_PLACES:
                self.left_out += 1
                return
            stream = self.streams[place] = Stream(place, self._made)
            self._made += 1
            stream.unknown = unknown
        newest = self._newest.setdefault(place.bus, Newest())
        stream.add(time_ns, data, self._known.of(place.bus, place.board), newest)
