# SPDX-License-Identifier: GPL-2.0-or-later
"""From packets to decoded records, in the order of the file (docs/records.md, all of it).

    packets    -> streams (cut, time) -+-> file order -> buses (meaning) -> held until nothing can be added -> out
    CAN frames -> recognised          -+

Memory is bounded whatever the capture holds: see the limits below.
"""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.bus import Bus
from dalyref.can_bus import CanBus, Meaning
from dalyref.file_order import LATE_NS, MOST_HELD, MOST_STREAMS, FileOrder
from dalyref.kinds import Dialect, Kind
from dalyref.message import from_serial
from dalyref.options import NANO, Options
from dalyref.packet import SERIAL_LINK_TYPES, CanFrame
from dalyref.streams import Located

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator

    from dalyref.kinds import Record
    from dalyref.packet import Direction, Packet, Transport
    from dalyref.slate import Slate
    from dalyref.values import Fields

__all__ = ["Decoded", "Decoder", "Options", "decode"]

# Whether something on a bus has been given up by time is decided a little later than the rule would have it: see
# LATE_NS, and this where the bus itself tells the time.
_LATE_ON_BUS_NS = NANO // 2

_BUS_NAME = re.compile(r"bus=([^\s,;]+)")


@dataclass(slots=True, eq=False)
class Decoded:
    """One record, decoded. `fields` has the dissector's names (docs/fields.md)."""

    number: int
    """Of the packet in which the record ends."""
    time_ns: int
    """When its first byte began, in ns since 1970 UTC."""
    kind: Kind
    data: bytes
    fields: Fields = field(default_factory=dict)
    interface: int = 0
    direction: Direction = ""
    transport: Transport = "uart"
    comment: str = ""
    """The packet's comment, of an event its text: not from the wire, and not to be trusted."""
    connection: str = ""
    """Bluetooth, TCP: as the packet names it."""
    held: bool = False
    """TCP: an incomplete record, given up because bytes behind it are lost or the capture ended."""


@dataclass(frozen=True, slots=True)
class _Recognised:
    """A CAN frame that is ours."""

    frame: CanFrame
    bus: CanBus
    meaning: Meaning
    foreign: str


class Decoder:
    """Decodes packets as they come. A record comes out when nothing later can change it: after about two seconds.

    early: called with each record at once, in the order in which they come out; later ones may still add to its fields.
    """

    def __init__(self, options: Options | None = None, *, early: Callable[[Decoded], None] | None = None) -> None:
        self._options = options or Options()
        self._early = early
        self._order = FileOrder[_Recognised](self._options)
        self._buses: dict[tuple[Transport, int | str], Bus] = {}
        self._bus_of: dict[int, tuple[str, Bus]] = {}  # by serial interface: its description, its bus
        self._can_buses: dict[int, CanBus] = {}  # by interface
        self._held: deque[tuple[Decoded, Slate | None]] = deque()
        self._now_ns = 0
        self._latest_ns = 0  # beginning of the latest packet

    def feed(self, packet: Packet) -> list[Decoded]:
        """Take the next packet of the file; return the records that are final, in the order of the file.

        Passed over: serial packets of other link types than a serial line's (147 to 162), CAN frames that are not ours.
        """
        if isinstance(packet, CanFrame):
            return self._feed_can(packet)
        serial = packet.transport == "uart"
        if serial and packet.link_type not in SERIAL_LINK_TYPES:
            return []
        if serial or packet.data:
            self._latest_ns = max(self._latest_ns, packet.time_ns)
        self._order.feed(packet)
        self._decode_all(self._order.released())
        return self._final()

    def finish(self) -> list[Decoded]:
        """Take the end of the file; return all that was held."""
        self._decode_all(self._order.finish())
        return self._final(everything=True)

    def _feed_can(self, frame: CanFrame) -> list[Decoded]:
        """Take a CAN frame: it is a record by itself, or not ours."""
        bus = self._can_buses.get(frame.interface)
        if bus is None:
            if len(self._can_buses) >= MOST_STREAMS:
                self._can_buses.clear()
            bus = self._can_buses[frame.interface] = CanBus(self._options)
        recognised = bus.recognise(frame)
        if recognised is None:
            return []
        self._latest_ns = max(self._latest_ns, frame.time_ns)
        self._order.put(frame.number, frame.time_ns, _Recognised(frame, bus, *recognised))
        self._decode_all(self._order.released())
        return self._final()

    def _decode_all(self, items: Iterable[Located | _Recognised]) -> None:
        for item in items:
            if isinstance(item, _Recognised):
                self._decode_can(item)
            else:
                self._decode(item)

    def _bus(self, packet: Packet) -> Bus:
        if packet.transport != "uart":
            return self._bus_named((packet.transport, packet.connection))
        known = self._bus_of.get(packet.interface)
        if known is not None and known[0] == packet.description:
            return known[1]
        named = _BUS_NAME.search(packet.description)
        bus = self._bus_named(("uart", named[1] if named else packet.interface))
        self._bus_of[packet.interface] = (packet.description, bus)
        return bus

    def _bus_named(self, key: tuple[Transport, int | str]) -> Bus:
        bus = self._buses.get(key)
        if bus is None:
            if len(self._buses) >= MOST_STREAMS:
                self._buses.clear()
                self._bus_of.clear()
            bus = self._buses[key] = Bus(self._options)
        return bus

    def _decode_can(self, item: _Recognised) -> None:
        frame = item.frame
        self._now_ns = max(self._now_ns, frame.time_ns)
        kind = item.bus.kind(item.meaning)
        fields: Fields = {"daly.kind": kind.value, "daly.transport": "can"}
        if item.foreign:
            fields["daly.foreign"] = item.foreign
        slate = item.bus.take(Located(None, frame, frame.time_ns, frame.time_ns), frame, item.meaning, fields)
        decoded = Decoded(
            frame.number,
            frame.time_ns,
            kind,
            frame.data,
            fields,
            frame.interface,
            frame.direction,
            "can",
            frame.comment,
        )
        self._hold(decoded, slate)

    def _decode(self, located: Located) -> None:
        packet, record = located.packet, located.record
        bus = self._bus(packet)
        bus.now_ns = max(bus.now_ns, located.start_ns)
        self._now_ns = max(self._now_ns, located.start_ns)
        kind, data = (record.kind, record.data) if record is not None else (Kind.EVENT, b"")
        fields: Fields = {"daly.kind": kind.value, "daly.transport": packet.transport}
        slate: Slate | None = None
        if record is not None:
            _describe(record, fields)
            if kind is Kind.FRAME:
                if record.dialect is Dialect.A5:
                    slate = bus.frame(located, from_serial(data), fields)
                else:
                    slate = bus.modbus_frame(located, data, fields)
        decoded = Decoded(
            packet.number,
            located.start_ns,
            kind,
            data,
            fields,
            packet.interface,
            packet.direction,
            packet.transport,
            packet.comment,
            connection=packet.connection,
            held=located.held,
        )
        self._hold(decoded, slate)

    def _hold(self, decoded: Decoded, slate: Slate | None) -> None:
        self._held.append((decoded, slate))
        if self._early:
            self._early(decoded)

    def _final(self, *, everything: bool = False) -> list[Decoded]:
        out: list[Decoded] = []
        held = self._held
        while held:
            decoded, slate = held[0]
            if slate is not None and (late_ns := slate.waits_until()):
                over = slate.bus.now_ns > late_ns + _LATE_ON_BUS_NS or self._now_ns > late_ns + LATE_NS
                # Bytes of a long packet may lie behind the beginning of the newest, which decides what is unanswered.
                if not (everything or (over and self._latest_ns > late_ns) or len(held) > MOST_HELD):
                    break
                slate.bus.settle(slate, self._latest_ns)
            out.append(decoded)
            held.popleft()
        return out


def _describe(record: Record, fields: Fields) -> None:
    """Add what stands in the record itself."""
    data, kind = record.data, record.kind
    if record.dialect is Dialect.A5:
        fields["daly.dialect"] = "a5"
        fields["daly.start"] = data[0]
        fields["daly.address"] = data[1]
        fields["daly.data_id"] = data[2]
        fields["daly.length"] = data[3]
        fields["daly.data"] = data[4:12].hex()
        fields["daly.checksum"] = data[12]
        fields["daly.checksum.status"] = 1 if kind is Kind.FRAME else 0
    elif record.dialect is not None:
        fields["daly.dialect"] = record.dialect.value
        fields["daly.modbus.address"] = data[0]
        fields["daly.modbus.function"] = data[1]
        fields["daly.modbus.crc"] = int.from_bytes(data[-2:], "little")
        fields["daly.modbus.crc.status"] = 1
    else:
        if kind is Kind.FOREIGN:
            fields["daly.foreign"] = record.foreign
        fields["daly.undecoded"] = data.hex()


def decode(packets: Iterable[Packet], options: Options | None = None) -> Iterator[Decoded]:
    """Decode a whole capture, record by record, in the order of the file."""
    decoder = Decoder(options)
    for packet in packets:
        yield from decoder.feed(packet)
    yield from decoder.finish()
