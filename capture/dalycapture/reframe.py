# SPDX-License-Identifier: GPL-2.0-or-later
"""An old capture cut into records again: a framing decision is never final.

    packets, cut anywhere --> stream (interface and direction) --> records, each a packet --> in order of time

The records of a stream put together are exactly its bytes. What the packets carried goes along: a comment and a count
of losses with the record in which the packet's first byte is, line errors with every record that has a byte of it,
events at their time, interfaces all. What says that a record is damaged is found out anew. Packets of other link types
(Ethernet, CAN) go through as they are.
"""

from __future__ import annotations

import heapq
from collections import Counter, deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

from dalycapture.captured import CapturedPacket, Statistics, Told
from dalycapture.interface import Interface
from dalycapture.linktype import DALY_LINK_TYPES, DEFAULT_LINK_TYPE
from dalycapture.pcapng import CRC_ERROR, TOO_SHORT
from dalycapture.rtac import LINK_TYPE as RTAC
from dalycapture.rtac import unwrapped
from dalyref.kinds import Kind
from dalyref.options import Options
from dalyref.streams import Stream

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from pathlib import Path

    from dalycapture.writer import CaptureWriter
    from dalyref.packet import Direction, Packet
    from dalyref.streams import Located

_FOUND_ANEW: Final = CRC_ERROR | TOO_SHORT
_LATE_NS: Final = 500_000_000  # interfaces are not strictly in the order of their times
_MOST_HELD: Final = 65536
_PIECE: Final = 4096

NO_TIMES: Final = "raw log: no times are known, bytes are laid out from 1970 on, at the pace of the wire"


@dataclass(slots=True)
class Reframed:
    """What came of it."""

    packets: int = 0
    """Packets with bytes that were read as a serial line's."""
    records: int = 0
    events: int = 0
    others: int = 0
    """Packets of other link types, gone through as they were."""
    bytes: int = 0
    kinds: Counter[Kind] = field(default_factory=Counter[Kind])


@dataclass(slots=True, order=True)
class _Ready:
    """A packet to write: by time, then in the order in which it came."""

    at_ns: int
    place: int
    time_ns: int = field(compare=False)
    data: bytes = field(compare=False)
    interface: int = field(compare=False)
    flags: int = field(compare=False, default=0)
    comment: str = field(compare=False, default="")
    dropped: int = field(compare=False, default=0)


class _Line:
    """One stream, and the packets whose bytes are in no record yet."""

    def __init__(self, options: Options) -> None:
        self.stream = Stream(options)
        self.latest_ns = 0  # of its records: never written out of their order
        self._packets: deque[tuple[int, CapturedPacket]] = deque()
        self._fed = 0

    @property
    def waits_from_ns(self) -> int | None:
        """When what is still held began."""
        return max(self.latest_ns, self._packets[0][1].time_ns) if self._packets else None

    def feed(self, packet: CapturedPacket) -> list[Located]:
        located = self.stream.feed(packet)
        if packet.data:
            self._packets.append((self._fed, packet))
            self._fed += len(packet.data)
        return located

    def carried(self, start: int, size: int) -> tuple[int, str, int]:
        """Take what the packets say of these bytes, the next of the stream: (flags, comment, dropped)."""
        flags = dropped = 0
        comments: list[str] = []
        end = start + size
        for offset, packet in self._packets:
            if offset >= end:
                break
            flags |= packet.flags & ~_FOUND_ANEW
            if offset >= start:
                dropped += packet.dropped
                comments += [packet.comment] if packet.comment else []
        while self._packets and self._packets[0][0] + len(self._packets[0][1].data) <= end:
            self._packets.popleft()
        return flags, "\n".join(comments), dropped


class Reframer:
    """Cuts packets into records and writes them. Give ``told`` to the reader, each packet to ``feed``, then ``finish``.

    bus: name that puts all interfaces of files that are not ours on one bus.
    """

    def __init__(self, writer: CaptureWriter, options: Options | None = None, *, bus: str = "") -> None:
        self.result = Reframed()
        self.told = Told(self._described, self._counted)
        self._writer = writer
        self._options = options or Options()
        self._bus = bus
        self._lines: dict[tuple[int, Direction], _Line] = {}
        self._holding: dict[tuple[int, Direction], _Line] = {}  # those with bytes in no record yet
        self._heap: list[_Ready] = []
        self._place = 0
        self._interfaces: list[Interface] = []
        self._statistics: dict[int, Statistics] = {}
        self._written: Counter[int] = Counter()
        self._span: dict[int, tuple[int, int]] = {}

    def feed(self, packet: CapturedPacket) -> None:
        """Take the next packet of the file. Raises CaptureError when the output broke."""
        if packet.link_type == RTAC:
            packet = unwrapped(packet)
        elif packet.link_type not in DALY_LINK_TYPES:
            self.result.others += 1
            self._pass(packet)
            self._release(packet.time_ns)
            return
        key = (packet.interface, packet.direction)
        line = self._lines.get(key)
        if line is None:
            line = self._lines[key] = _Line(self._options)
        self._records(line, line.feed(packet))
        if packet.data:
            self.result.packets += 1
            self.result.bytes += len(packet.data)
        else:
            self.result.events += 1
            self._pass(packet)
        self._holding[key] = line
        for other in self._holding.values():
            if other is not line and other.stream.silent_at(packet.time_ns, _LATE_NS):
                self._records(other, other.stream.flush())
        self._holding = {at: held for at, held in self._holding.items() if held.waits_from_ns is not None}
        self._release(packet.time_ns)

    def finish(self) -> Reframed:
        """Take the end of the file: write what is held, and the statistics."""
        for line in self._lines.values():
            self._records(line, line.stream.flush())
        while self._heap:
            self._write(heapq.heappop(self._heap))
        for number in range(len(self._interfaces)):
            self._write_statistics(number)
        return self.result

    def _described(self, interface: Interface) -> None:
        if interface.link_type == RTAC:
            interface = replace(interface, link_type=DEFAULT_LINK_TYPE)
        if interface.link_type in DALY_LINK_TYPES:
            speed = interface.speed or self._options.baud
            if "dalyshark" not in interface.description:
                bus = f" bus={self._bus}" if self._bus else ""
                was = f"; was: {interface.description}" if interface.description else ""
                words = f"dalyshark{bus} {speed} 8N1 {interface.name}".rstrip()
                interface = replace(interface, description=f"{words}; reframed{was}", speed=speed)
        self._interfaces.append(interface)
        self._writer.add_interface(interface)

    def _counted(self, statistics: Statistics) -> None:
        self._statistics[statistics.interface] = statistics

    def _records(self, line: _Line, located: Iterable[Located]) -> None:
        for each in located:
            record = each.record
            if record is None:
                continue
            flags, comment, dropped = line.carried(record.start, len(record.data))
            if record.kind is Kind.BAD_CHECKSUM:
                flags |= CRC_ERROR
            elif record.kind is Kind.SHORT:
                flags |= TOO_SHORT
            line.latest_ns = max(line.latest_ns, each.start_ns)
            self.result.records += 1
            self.result.kinds[record.kind] += 1
            self._put(line.latest_ns, each.packet, record.data, each.start_ns, (flags, comment, dropped))

    def _pass(self, packet: CapturedPacket) -> None:
        """Write an event, or what is no serial line's, as it is."""
        self._put(packet.time_ns, packet, packet.data, packet.time_ns, (packet.flags, packet.comment, packet.dropped))

    def _put(self, at_ns: int, packet: Packet, data: bytes, time_ns: int, carried: tuple[int, str, int]) -> None:
        self._place += 1
        heapq.heappush(self._heap, _Ready(at_ns, self._place, time_ns, data, packet.interface, *carried))

    def _release(self, now_ns: int) -> None:
        """Write what nothing that is still to come can precede."""
        held = [since for line in self._holding.values() if (since := line.waits_from_ns) is not None]
        until = min([*held, now_ns])
        while self._heap and (self._heap[0].at_ns <= until or len(self._heap) > _MOST_HELD):
            self._write(heapq.heappop(self._heap))

    def _write(self, ready: _Ready) -> None:
        self._writer.write_packet(
            ready.time_ns,
            ready.data,
            interface=ready.interface,
            flags=ready.flags,
            comment=ready.comment,
            dropped=ready.dropped,
        )
        self._written[ready.interface] += bool(ready.data)
        first, last = self._span.get(ready.interface, (ready.time_ns, ready.time_ns))
        self._span[ready.interface] = min(first, ready.time_ns), max(last, ready.time_ns)

    def _write_statistics(self, number: int) -> None:
        """Count the records; times and losses are those of the old capture, where it has them."""
        old = self._statistics.get(number, Statistics(number))
        first, last = self._span.get(number, (0, 0))
        dropped = old.dropped or 0
        self._writer.write_statistics(
            number,
            start_ns=first if old.start_ns is None else old.start_ns,
            end_ns=last if old.end_ns is None else old.end_ns,
            received=self._written[number] + dropped,
            dropped=dropped,
            os_dropped=old.os_dropped or 0,
        )


def raw_packets(path: Path, options: Options, told: Told) -> Iterator[CapturedPacket]:
    """Read a file of nothing but bytes as they came from a port, and say so.

    It has no times: bytes follow each other at the pace of the wire, from 1970 on. Raises OSError.
    """
    told.interface(Interface(path.name, f"dalyshark bus=main {options.baud} 8N1 {path.name}; {NO_TIMES}"))
    yield CapturedPacket(number=1, time_ns=0, data=b"", comment=NO_TIMES)
    at, number = 0, 1
    with path.open("rb") as file:
        while piece := file.read(_PIECE):
            number += 1
            yield CapturedPacket(number=number, time_ns=options.characters_ns(at), data=piece)
            at += len(piece)
