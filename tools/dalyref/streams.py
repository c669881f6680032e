# SPDX-License-Identifier: GPL-2.0-or-later
"""From packets to records that know their packet and their time (docs/records.md, section 1).

packet   |---- 13 ----|--- 7 ---|--------- 19 ---------|        as captured: cut anywhere
record   |-- frame ---|---- frame ----|-- frame --|junk|        as decoded
number         1              3            3        3           of the packet in which the record ends

Time decides nothing here but when an incomplete record is given up. On Bluetooth and TCP it does not even that, and a
frame takes no time (docs/wires.md, 3 and 4).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dalyref import bluetooth_module
from dalyref.kinds import DAMAGED, Kind, Record
from dalyref.records import Splitter

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dalyref.options import Options
    from dalyref.packet import Packet, Transport


@dataclass(slots=True, eq=False)
class Located:
    """A record with its place in the file and on the wire. `record` is None for an event."""

    record: Record | None
    packet: Packet
    """The packet in which it ends."""
    start_ns: int
    """When its first byte began."""
    end_ns: int
    """When its last byte had ended."""
    held: bool = False
    """TCP: given up, because bytes behind it are lost or the capture ended."""
    behind_damage: bool = False
    """The record right before it in its stream, without those that were held, is damaged: a frame may be lost there."""


class Stream:
    """All bytes of one interface, or connection, and one direction."""

    __slots__ = (
        "_chunks",
        "_damaged",
        "_end_ns",
        "_length",
        "_options",
        "_quiet_ns",
        "_splitter",
        "_text_at",
        "_transport",
    )

    def __init__(self, options: Options, transport: Transport = "uart") -> None:
        self._options = options
        self._transport = transport
        self._quiet_ns = options.limit_ns(options.quiet)
        self._splitter = Splitter()
        self._chunks: deque[tuple[int, Packet]] = deque()  # (stream offset, packet) that a record may still begin in
        self._length = 0
        self._end_ns: int | None = None  # when the last byte had ended
        self._damaged = False  # the last record is
        self._text_at: int | None = None  # offset of the record to come that stands behind a Bluetooth module's text

    @property
    def waits_from(self) -> int | None:
        """The number of the packet with the first byte that is in no record yet."""
        # What TCP holds counts to the packet that will decide it.
        return self._chunks[0][1].number if self._splitter.pending and self._transport != "tcp" else None

    def silent_at(self, time_ns: int, longer_ns: int = 0) -> bool:
        """Tell whether a packet that begins at `time_ns` comes after silence, by `longer_ns` more than needed."""
        return (
            self._transport == "uart"
            and self._end_ns is not None
            and time_ns - self._end_ns > self._quiet_ns + longer_ns
        )

    def feed(self, packet: Packet) -> list[Located]:
        """Take the next packet of the stream; return the records that are now certain."""
        out: list[Located] = []
        if not packet.data:
            if self._transport == "uart":
                self._splitter.event()
            elif packet.after_gap:
                out = self.flush()
            return out
        if packet.after_gap or self.silent_at(packet.time_ns):
            out = self.flush()
        if self._transport == "ble" and bluetooth_module.is_text(packet.data) and not self._splitter.begun:
            self._splitter.event()
            text = Record(self._length, packet.data, Kind.FOREIGN, foreign=bluetooth_module.NAME)
            out.append(Located(text, packet, packet.time_ns, packet.time_ns))
            self._text_at = self._length  # junk before it may not be located yet
            return out
        self._chunks.append((self._length, packet))
        self._length += len(packet.data)
        self._end_ns = packet.time_ns + self._lasts_ns(len(packet.data))
        if self._transport == "tcp":
            records = self._splitter.feed(packet.data, decide=True)
            if not self._splitter.begun:  # a gap ends here
                records += self._splitter.flush()
            located = self._locate(records)
            for item in located:
                item.packet = packet
            return out + located
        records = self._splitter.feed(packet.data)
        if records:
            out += self._locate(records)
        return out

    def passed(self, count: int, end_ns: int) -> None:
        """Take note of `count` bytes, whole frames up to `end_ns`, that were cut elsewhere while nothing was held."""
        self._length += count
        self._end_ns = end_ns
        self._damaged = False
        self._splitter.passed(count)

    def flush(self) -> list[Located]:
        """Silence or the end: return what is held."""
        damaged = self._damaged
        located = self._locate(self._splitter.flush())
        if self._transport == "tcp":
            self._damaged = damaged
            for item in located:
                item.held = True
        return located

    def _lasts_ns(self, count: int) -> int:
        """Return how long `count` characters take, in ns."""
        return self._options.characters_ns(count) if self._transport == "uart" else 0

    def _locate(self, records: Iterable[Record]) -> list[Located]:
        chunks = self._chunks
        time = self._lasts_ns
        out: list[Located] = []
        for record in records:
            offset, packet = chunks[0]
            start_ns = packet.time_ns + time(record.start - offset)
            end = record.start + len(record.data)
            while offset + len(packet.data) < end:
                chunks.popleft()
                offset, packet = chunks[0]
            end_ns = packet.time_ns + time(end - offset)
            if self._text_at is not None and record.start >= self._text_at:
                self._damaged, self._text_at = False, None
            out.append(Located(record, packet, start_ns, end_ns, behind_damage=self._damaged))
            self._damaged = record.kind in DAMAGED
            if offset + len(packet.data) == end:
                chunks.popleft()
        return out
