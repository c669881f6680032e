# SPDX-License-Identifier: GPL-2.0-or-later
"""From a log to packets with times, and what was made of each line.

    log --> lines --> entries (bytes, time, direction) --> packets --> dalycapture.reframe --> one packet a record

Where a log has no times, lines are laid out one behind the other: at the pace of the wire, with a gap where a new line
is a new message. Where it has times that are too coarse, bytes that would overlap are moved behind each other.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from itertools import islice
from typing import TYPE_CHECKING, BinaryIO, Final

from dalycapture.captured import CapturedPacket
from dalycapture.interface import Interface, tap
from dalycapture.linktype import DEFAULT_LINK_TYPE
from dalycapture.pcapng import INBOUND, OUTBOUND, SYMBOL_ERROR
from dalytools.logs.entry import DAY_NS
from dalytools.logs.kinds import KINDS, RAW
from dalytools.logs.sigrok import Sigrok
from dalytools.logs.text_lines import PIECE, text_lines

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from dalycapture.captured import Told
    from dalyref.options import Options
    from dalytools.logs.entry import Entry, LineLog, Stamp

SOCKETCAN: Final = 227
GAP_NS: Final = 120_000_000  # between lines without times: an echo comes sooner, a burst ends later
FINE_NS: Final = 1000  # times as fine as this are a logic analyser's: taken as they are
OVERLAP_NS: Final = 5 * 10**9  # bytes are moved by so much at most; more is a clock that was set
NO_TIMES: Final = "imported: the log has no times, its bytes are laid out from 1970 on"
_STANDARD_MOST: Final = 0x7FF
_EXTENDED_MOST: Final = 0x1FFF_FFFF
_EXTENDED: Final = 0x8000_0000
_FLAGS: Final = {"": 0, "inbound": INBOUND, "outbound": OUTBOUND}
_RAW_PIECE: Final = 4096
LOOKED_AT: Final = 400  # lines


@dataclass(slots=True)
class Tally:
    """What was made of a log."""

    lines: int = 0
    with_bytes: int = 0
    not_understood: int = 0
    bytes: int = 0
    timed: int = 0  # entries that had a time
    day_unknown: bool = False
    moved: int = 0  # entries that would have overlapped
    coarsest_ns: int = 0
    directions: set[str] = field(default_factory=set[str])


class Importer:
    """Reads one log. told: who is told of the interfaces; date_ns: midnight of the day that times of day are of."""

    def __init__(
        self, name: str, kind: str, options: Options, told: Told, *, date_ns: int = 0, samplerate: float = 0.0
    ) -> None:
        self.tally = Tally()
        self._name = name
        self._kind = kind
        self._options = options
        self._told = told
        self._samplerate = samplerate
        self._day_ns = self._start_ns = date_ns
        self._last_day_ns = 0
        self._free_ns = date_ns  # when the wire is free again
        self._number = 0
        self._interfaces: dict[int, int] = {}  # link type: number

    def packets(
        self, stream: BinaryIO, start: bytes = b"", *, lost: Callable[[int, str], None] | None = None
    ) -> Iterator[CapturedPacket]:
        """Yield the packets of a log, of which ``start`` was read already; ``lost`` gets each line not understood."""
        if self._kind == RAW:
            yield from self._raw(stream, start)
            return
        log: LineLog = (
            Sigrok(self._options.baud, self._samplerate) if self._kind == Sigrok.name else KINDS[self._kind]()
        )
        start = start or stream.read(PIECE)
        log.look(list(islice(text_lines(io.BytesIO(), start), LOOKED_AT)))
        for line in text_lines(stream, start):
            self.tally.lines += 1
            if not line.strip():
                continue
            entries = log.parse(line)
            if entries is None:
                self.tally.not_understood += 1
                if lost is not None:
                    lost(self.tally.lines, line)
                continue
            yield from self._placed(entries, log)
        yield from self._placed(log.finish(), log)

    def _raw(self, stream: BinaryIO, start: bytes) -> Iterator[CapturedPacket]:
        at = 0
        piece = start or stream.read(PIECE)
        while piece:
            for place in range(0, len(piece), _RAW_PIECE):
                part = piece[place : place + _RAW_PIECE]
                self.tally.bytes += len(part)
                yield from self._packet(part, self._start_ns + self._options.characters_ns(at), timed=False)
                at += len(part)
            piece = stream.read(PIECE)

    def _placed(self, entries: list[Entry], log: LineLog) -> Iterator[CapturedPacket]:
        tally = self.tally
        tally.with_bytes += bool(entries)
        for entry in entries:
            if not entry.data and entry.can_id is None:
                continue
            length_ns = self._options.characters_ns(len(entry.data))
            stamp = entry.stamp
            if stamp is None:
                gap = GAP_NS if log.gaps and tally.bytes else 0
                at = self._free_ns + gap
            else:
                tally.timed += 1
                tally.coarsest_ns = max(tally.coarsest_ns, stamp.step_ns)
                at = self._moment(stamp)
                if log.stamped_at_end:
                    at = max(0, at - length_ns)
                if stamp.step_ns > FINE_NS and 0 < self._free_ns - at < OVERLAP_NS:
                    at = self._free_ns
                    tally.moved += 1
            self._free_ns = at + length_ns
            tally.bytes += len(entry.data)
            tally.directions.add(entry.direction)
            if entry.can_id is not None:
                identifier = entry.can_id | (_EXTENDED if _STANDARD_MOST < entry.can_id <= _EXTENDED_MOST else 0)
                data = identifier.to_bytes(4) + bytes((len(entry.data), 0, 0, 0)) + entry.data
                yield from self._packet(data, at, link_type=SOCKETCAN)
            else:
                yield from self._packet(entry.data, at, entry, timed=stamp is not None)

    def _moment(self, stamp: Stamp) -> int:
        """When that was, in ns since 1970."""
        if stamp.what == "moment":
            return stamp.ns
        if stamp.what == "start":
            return self._start_ns + stamp.ns
        self.tally.day_unknown = True
        if stamp.ns < self._last_day_ns - DAY_NS // 2:  # past midnight
            self._day_ns += DAY_NS
        self._last_day_ns = stamp.ns
        return self._day_ns + stamp.ns

    def _packet(
        self,
        data: bytes,
        at_ns: int,
        entry: Entry | None = None,
        *,
        timed: bool = True,
        link_type: int = DEFAULT_LINK_TYPE,
    ) -> Iterator[CapturedPacket]:
        interface = self._interfaces.get(link_type)
        if interface is None:
            interface = self._interfaces[link_type] = len(self._interfaces)
            self._told.interface(self._described(link_type))
            if not timed:
                self._number += 1
                yield CapturedPacket(self._number, at_ns, b"", interface, comment=NO_TIMES)
        self._number += 1
        direction = entry.direction if entry else ""
        flags = _FLAGS[direction] | (SYMBOL_ERROR if entry and entry.bad else 0)
        yield CapturedPacket(
            self._number, at_ns, data, interface, direction=direction, link_type=link_type, flags=flags
        )

    def _described(self, link_type: int) -> Interface:
        origin = f"imported from {self._name}, kind {self._kind}"
        if link_type == SOCKETCAN:
            return Interface(self._name, origin, SOCKETCAN)
        return tap(self._name.replace(";", ","), baud=self._options.baud, facts=[origin])
