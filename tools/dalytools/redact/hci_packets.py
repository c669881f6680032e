# SPDX-License-Identifier: GPL-2.0-or-later
"""HCI packets (link types 187, 201, 254): what is not a board's line is blanked, but for the shape of things.

    187   kind u8 | packet                    kinds: 01 command, 02 data, 04 event
    201   direction u32 | kind u8 | packet
    254   adapter u16, opcode u16 | packet    high byte first; opcodes 2 command, 3 event, 4 and 5 data

    command   opcode u16, length u8 |         parameters blanked: addresses, names, keys
    event     code u8, length u8 |            kept: that a connection began or ended, how it goes; addresses replaced
    data      connection, flags u16, length u16 | L2CAP: length u16, channel u16 | ATT on channel 4 (``att``)

Low byte first, but where said. L2CAP packets over several data packets are put together.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from dalyref.packet import Packet
from dalytools.redact.att import Attributes, Fate
from dalytools.redact.lines import Line
from dalytools.redact.what import What

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalyref.packet import Direction
    from dalytools.redact.addresses import Addresses
    from dalytools.redact.blanker import Blanker
    from dalytools.redact.lines import Held

HCI, HCI_WITH_DIRECTION, LINUX_MONITOR = 187, 201, 254
LINK_TYPES: Final = frozenset((HCI, HCI_WITH_DIRECTION, LINUX_MONITOR))

_COMMAND, _DATA, _EVENT = 1, 2, 4
_MONITOR: Final = {2: (_COMMAND, 0), 3: (_EVENT, 1), 4: (_DATA, 0), 5: (_DATA, 1)}
"""By opcode: kind, and whether it was received."""

_LE: Final = 0x3E
_EVENT_KEPT: Final = {0x05: 4, 0x0E: 4, 0x0F: 4, 0x13: 255}
"""By event: so many of its parameters, from the first. Disconnection, command complete, status, packets sent."""
_LE_KEPT: Final = {0x03: 255, 0x07: 255, 0x0C: 255}
"""By LE event: connection update, data length, PHY."""
_ENHANCED: Final = ((6, 12), (12, 18), (18, 24))
_CONNECTED: Final = {0x01: ((6, 12),), 0x0A: _ENHANCED, 0x29: _ENHANCED}
"""Connection complete, enhanced, enhanced version 2: where the addresses stand, from the subevent on."""
_ADVERTISED: Final = {0x02: (4, 10), 0x0D: (5, 11)}
"""Advertising reports, of one device each: where its address stands."""

_ATT, _SIGNALS, _SECURITY = 4, 5, 6
_CHANNEL_HEADS: Final = {_SIGNALS: 4, _SECURITY: 1}
_L2CAP_HEAD: Final = 4
_MOST_CONNECTIONS: Final = 256
_MOST_BEGUN: Final = 256
_LONGEST_WAIT: Final = 1024
"""Packets that may come before the rest of an L2CAP packet does."""

_NAMES: Final = "Bluetooth"


@dataclass(slots=True)
class _Begun:
    """An L2CAP packet of which more is to come."""

    number: int
    length: int
    data: bytes = b""
    line: Line = field(default_factory=Line)


@dataclass(slots=True)
class _Connection:
    name: str
    attributes: Attributes = field(default_factory=Attributes)


class HciPackets:
    """Takes the HCI packets of a capture, in order. line: gives the line of a connection's name and direction."""

    def __init__(self, blanker: Blanker, addresses: Addresses, line: Callable[[str, Direction], Line]) -> None:
        self._blanker = blanker
        self._addresses = addresses
        self._line = line
        self._connections: dict[tuple[int, int, int], _Connection] = {}  # by interface, adapter, connection handle
        self._begun: dict[tuple[int, int, int, int], _Begun] = {}  # the same, and whether received
        self._names = 0

    def feed(self, held: Held) -> list[Packet]:
        """Blank a packet, and return what it holds, or completes, for the decoder."""
        packet, data = held.packet, held.packet.data
        self._give_up(packet.number - _LONGEST_WAIT)
        adapter = received = 0
        if packet.link_type == LINUX_MONITOR:
            head = 4
            adapter, opcode = int.from_bytes(data[:2]), int.from_bytes(data[2:4])
            kind, received = _MONITOR.get(opcode, (0, 0))
        else:
            head = 5 if packet.link_type == HCI_WITH_DIRECTION else 1
            kind = data[head - 1] if len(data) >= head else 0
            received = data[3] & 1 if head == 5 and len(data) > 3 else int(packet.direction == "inbound")
        if kind == _DATA:
            return self._data(held, head, adapter, received)
        if kind == _EVENT:
            self._event(held, head, adapter)
        else:
            self._blank(held, head + 3 if kind == _COMMAND else head, len(data))
        return []

    def finish(self) -> None:
        """Take the end of the capture."""
        self._give_up(None)

    def _give_up(self, before: int | None) -> None:
        """Blank L2CAP packets that were begun too long ago; None: all."""
        while self._begun:
            key = next(iter(self._begun))
            if before is not None and self._begun[key].number >= before and len(self._begun) <= _MOST_BEGUN:
                return
            self._abandon(key)

    def _abandon(self, key: tuple[int, int, int, int]) -> None:
        begun = self._begun.pop(key, None)
        if begun is not None:
            begun.line.replace(begun.data, self._blanked(begun.data))

    def _blanked(self, data: bytes) -> bytes:
        return self._blanker.whole(data, What.TRAFFIC, _NAMES)

    def _blank(self, held: Held, start: int, stop: int) -> None:
        if start < stop:
            held.data[start:stop] = self._blanked(held.packet.data[start:stop])

    def _address(self, held: Held, start: int, stop: int) -> None:
        old = held.packet.data[start:stop]
        if len(old) == stop - start:
            new = self._addresses.of(old, low_first=True)
            held.data[start:stop] = self._blanker.given(old, new, What.ADDRESS, _NAMES)
        else:
            self._blank(held, start, start + len(old))

    def _event(self, held: Held, head: int, adapter: int) -> None:
        data = held.packet.data
        end = len(data)
        if end < head + 3:
            self._blank(held, head, end)
            return
        code, at = data[head], head + 2
        if code != _LE:
            self._blank(held, at + _EVENT_KEPT.get(code, 0), end)
            return
        subevent = data[at]
        if subevent in _CONNECTED:
            for start, stop in _CONNECTED[subevent]:
                self._address(held, at + start, at + stop)
            if data[at + 1 : at + 2] == b"\0" and end >= at + 4:
                handle = int.from_bytes(data[at + 2 : at + 4], "little") & 0xFFF
                self._connections.pop((held.packet.interface, adapter, handle), None)
        elif subevent in _ADVERTISED and data[at + 1 : at + 2] == b"\1":
            start, stop = _ADVERTISED[subevent]
            self._address(held, at + start, at + stop)
            self._blank(held, at + stop, end)
        else:
            self._blank(held, at + 1 + _LE_KEPT.get(subevent, 0), end)

    def _data(self, held: Held, head: int, adapter: int, received: int) -> list[Packet]:
        packet, data = held.packet, held.packet.data
        start = head + 4
        word, length = int.from_bytes(data[head : head + 2], "little"), int.from_bytes(data[head + 2 : start], "little")
        stop = start + length
        self._blank(held, stop, len(data))
        handle = word & 0xFFF
        key = (packet.interface, adapter, handle, received)
        begins = word >> 12 & 3 != 1
        begun = self._begun.get(key)
        if begins:
            self._abandon(key)
            begun = None
        if len(data) < stop or (begins and length < _L2CAP_HEAD) or (not begins and begun is None):
            self._blank(held, start, min(stop, len(data)))
            return []
        content = data[start:stop]
        if begun is None:
            begun = self._begun[key] = _Begun(packet.number, _L2CAP_HEAD + int.from_bytes(content[:2], "little"))
        begun.line.add(held, start, length)
        begun.data += content
        if len(begun.data) < begun.length:
            return []
        if len(begun.data) > begun.length:
            self._abandon(key)
            return []
        del self._begun[key]
        return self._whole(packet, begun, self._connection(key[:3]))

    def _connection(self, key: tuple[int, int, int]) -> _Connection:
        connection = self._connections.get(key)
        if connection is None:
            if len(self._connections) >= _MOST_CONNECTIONS:
                del self._connections[next(iter(self._connections))]
            self._names += 1
            connection = self._connections[key] = _Connection(f"ble {self._names}")
        return connection

    def _whole(self, packet: Packet, begun: _Begun, connection: _Connection) -> list[Packet]:
        """Decide the bytes of a whole L2CAP packet, or hand them over to the connection's line."""
        line, data = begun.line, begun.data
        channel = int.from_bytes(data[2:_L2CAP_HEAD], "little")
        pdu = data[_L2CAP_HEAD:]
        if channel == _ATT:
            fates = connection.attributes.fates(pdu)
        else:
            kept = min(_CHANNEL_HEADS.get(channel, 0), len(pdu))
            fates = [(kept, Fate.KEPT), (len(pdu) - kept, Fate.BLANKED)]
        line.replace(data[:_L2CAP_HEAD], data[:_L2CAP_HEAD])
        at = 0
        out: list[Packet] = []
        for size, fate in fates:
            part = pdu[at : at + size]
            at += size
            if fate is Fate.KEPT:
                line.replace(part, part)
            elif fate is Fate.BLANKED:
                line.replace(part, self._blanked(part))
            elif part:
                direction: Direction = "outbound" if fate is Fate.SENT else "inbound"
                line.move(size, self._line(connection.name, direction))
                out.append(
                    Packet(
                        number=packet.number,
                        time_ns=packet.time_ns,
                        data=part,
                        interface=packet.interface,
                        direction=direction,
                        link_type=packet.link_type,
                        transport="ble",
                        connection=connection.name,
                    )
                )
        return out
