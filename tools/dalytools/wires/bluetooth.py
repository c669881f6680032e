# SPDX-License-Identifier: GPL-2.0-or-later
"""Bluetooth: the values of Daly's attributes in HCI captures (link types 187, 201, 254), over scapy's ATT.

    187   packet                                   packet: kind u8, 02 data, 04 event; H4 of the Bluetooth papers
    201   direction u32, high byte first | packet
    254   adapter u16, opcode u16, high byte first | packet without its kind

    data  02 | connection (12 bits), PB flags | length u16 | L2CAP: length u16, channel u16 | ATT ...

Low byte first, but where said. ATT packets over several data packets are put together. Which attributes are Daly's, and
from which value on: docs/wires.md, 3.
"""

# scapy's fields have no types that a checker could follow.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportAttributeAccessIssue=false

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

from dalyref.beginning import begins
from dalyref.packet import Packet
from dalytools.extra import missing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalyref.packet import Direction
    from dalytools.wires.choice import Numbers

HCI, HCI_WITH_DIRECTION, LINUX_MONITOR = 187, 201, 254
LINK_TYPES: Final = frozenset((HCI, HCI_WITH_DIRECTION, LINUX_MONITOR))

_DATA, _EVENT = 2, 4
_MONITOR_KINDS: Final = {3: (_EVENT, 1), 4: (_DATA, 0), 5: (_DATA, 1)}
"""What an opcode of the monitor carries, and whether it was received."""

_NOT_TOLD: Final = -1
"""Of an HCI packet whose direction the file does not tell."""

_ATT_CHANNEL: Final = 4
_CONNECTION_COMPLETE, _LE_META = 0x03, 0x3E
_CONNECTED: Final = frozenset((0x01, 0x0A, 0x29))
"""LE events: Connection Complete, Enhanced Connection Complete, and its version 2 (Bluetooth Core, vol 4, part E)."""
_FIND_INFORMATION_RESPONSE, _READ_BY_TYPE, _READ_BY_TYPE_RESPONSE = 0x05, 0x08, 0x09
_WRITES: Final = frozenset((0x12, 0x52))
_NOTICES: Final = frozenset((0x1B, 0x1D))
_CHARACTERISTIC: Final = 0x2803
_DALYS: Final = frozenset((0xFFF1, 0xFFF2, 0xFF01, 0xFF02))
_BASE: Final = bytes.fromhex("0000 1000 8000 00805f9b34fb")[::-1]
"""A short UUID's long form, low byte first: these twelve bytes, the short one, two of zero."""

_MOST_CONNECTIONS: Final = 256
_MOST_HANDLES: Final = 256  # of Daly's, in one connection
_MOST_TOLD: Final = 16  # of others, in a message


@dataclass(slots=True)
class _Unfinished:
    """An L2CAP packet of which more is to come."""

    data: bytes = b""
    length: int = 0


@dataclass(slots=True)
class _Connection:
    """One connection handle, from a Connection Complete event to the next."""

    name: str
    handles: set[int] = field(default_factory=set[int])
    """Of attributes with Daly's UUIDs."""
    begun: bool = False
    """They are Daly's: a value of its own was seen, or one of a handle that the user chose."""
    asks_characteristics: bool = False
    """The newest Read By Type request is for 2803."""
    unfinished: dict[int, _Unfinished] = field(default_factory=dict[int, _Unfinished])  # by direction
    lost: set[Direction] = field(default_factory=set["Direction"])
    """Sides of Daly's attributes that a packet is missing of."""


def _speaker(received: int, pdu: bytes) -> Direction:
    """Return whose value an ATT packet holds; nothing: it holds none, or the host is somebody's device itself."""
    opcode = pdu[0] if pdu else 0
    if opcode in _WRITES and received != 1:
        return "outbound"
    return "inbound" if opcode in _NOTICES and received != 0 else ""


def short_uuid(uuid: bytes) -> int | None:
    """Return the short form of a UUID, given as it is sent; None: it has none."""
    if len(uuid) == 16 and uuid[:12] == _BASE and uuid[14:] == b"\0\0":
        uuid = uuid[12:14]
    return int.from_bytes(uuid, "little") if len(uuid) == 2 else None


class Bluetooth:
    """Takes the HCI packets of a capture, in order."""

    def __init__(self, handles: Numbers) -> None:
        self._handles = handles
        self._connections: dict[tuple[int, int, int], _Connection] = {}  # by interface, adapter, connection handle
        self._names = 0
        self._scapy: Any = None
        self.found = False
        """A value of Daly's was seen."""
        self.others: set[int] = set()
        """Some handles of attributes that carry values which are not known as Daly's."""
        self.incomplete = 0
        """Packets of Daly's attributes that stayed incomplete."""
        self.before = 0
        """Values of attributes with Daly's UUIDs that came before one of Daly's, and are left out."""

    def values(self, packet: Packet) -> Sequence[Packet]:
        """Return the value of Daly's that a packet holds or completes; most hold none."""
        data, adapter, received = packet.data, 0, 0
        if packet.link_type == LINUX_MONITOR:
            if len(data) < 4:
                return ()
            adapter, opcode = struct.unpack_from(">HH", data)
            kind, received = _MONITOR_KINDS.get(opcode, (0, 0))
            data = data[4:]
        else:
            if packet.link_type == HCI_WITH_DIRECTION:
                received = int.from_bytes(data[:4], "big") & 1
                data = data[4:]
            else:
                received = {"outbound": 0, "inbound": 1}.get(packet.direction, _NOT_TOLD)
            kind, data = (data[0], data[1:]) if data else (0, b"")
        if kind == _EVENT:
            self._event(packet.interface, adapter, data)
        elif kind == _DATA:
            return self._data(packet, adapter, received, data)
        return ()

    def _event(self, interface: int, adapter: int, data: bytes) -> None:
        """Begin a connection anew where an event says so."""
        if len(data) < 3:
            return
        at = 2  # of the status, which the handle follows in all of them; by hand, for scapy knows no version 2
        if data[0] == _LE_META and data[at] in _CONNECTED:
            at += 1
        elif data[0] != _CONNECTION_COMPLETE:
            return
        if len(data) >= at + 3 and data[at] == 0:
            handle = int.from_bytes(data[at + 1 : at + 3], "little") & 0xFFF
            self._connections.pop((interface, adapter, handle), None)

    def _data(self, packet: Packet, adapter: int, received: int, data: bytes) -> Sequence[Packet]:
        """Put an L2CAP packet together; read it when it is whole."""
        if len(data) < 4:
            return ()
        word, length = struct.unpack_from("<HH", data)
        data = data[4 : 4 + length]
        connection = self._connection(packet.interface, adapter, word & 0xFFF)
        whole = connection.unfinished.pop(received, None)
        if word >> 12 & 3 == 1:
            if whole is None:
                return ()
            whole.data += data
        else:
            if whole is not None:
                self._lose(connection, received, whole)
            whole = _Unfinished(data, 4 + int.from_bytes(data[:2], "little"))
        if len(data) < length or len(whole.data) > whole.length:  # cut off by the snap length, or not a part of it
            self._lose(connection, received, whole)
        elif len(whole.data) < whole.length:
            connection.unfinished[received] = whole
        elif int.from_bytes(whole.data[2:4], "little") == _ATT_CHANNEL:
            return self._att(packet, connection, received, whole.data[4:])
        return ()

    def _lose(self, connection: _Connection, received: int, part: _Unfinished) -> None:
        """Note that a packet stays incomplete: where it is one of Daly's, bytes are missing."""
        if connection.begun and int.from_bytes(part.data[2:4], "little") == _ATT_CHANNEL:
            direction = self._side(connection, received, part.data[4:])
            if direction:
                self.incomplete += 1
                connection.lost.add(direction)

    def _begins(self, connection: _Connection, pdu: bytes) -> bool:
        """Tell whether a connection's attributes are Daly's, now that this value has come."""
        if not connection.begun:
            connection.begun = int.from_bytes(pdu[1:3], "little") in self._handles or begins(pdu[3:])
        return connection.begun

    def _side(self, connection: _Connection, received: int, pdu: bytes) -> Direction:
        """Return which side's value an ATT packet holds, where its attribute may be Daly's; else nothing."""
        handle = int.from_bytes(pdu[1:3], "little")
        known = len(pdu) >= 3 and (handle in connection.handles or handle in self._handles)
        return _speaker(received, pdu) if known else ""

    def _connection(self, interface: int, adapter: int, handle: int) -> _Connection:
        key = (interface, adapter, handle)
        connection = self._connections.get(key)
        if connection is None:
            if len(self._connections) >= _MOST_CONNECTIONS:
                del self._connections[next(iter(self._connections))]
            self._names += 1
            connection = self._connections[key] = _Connection(f"ble {self._names}")
        return connection

    def _att(self, packet: Packet, connection: _Connection, received: int, pdu: bytes) -> Sequence[Packet]:
        opcode = pdu[0] if pdu else 0
        if len(pdu) > 3 and _speaker(received, pdu):
            direction = self._side(connection, received, pdu)
            if direction and self._begins(connection, pdu):
                self.found = True
                return (self._value(packet, connection, pdu[3:], direction),)
            if direction:
                self.before += 1
            if len(self.others) < _MOST_TOLD:
                self.others.add(int.from_bytes(pdu[1:3], "little"))
        if opcode == _READ_BY_TYPE and received != 1:
            connection.asks_characteristics = short_uuid(pdu[5:]) == _CHARACTERISTIC
        elif received == 0:
            pass  # replies of this host, which is asked by somebody
        elif opcode == _READ_BY_TYPE_RESPONSE and connection.asks_characteristics:
            for one in self._entries(pdu, "value"):
                value: bytes = one.value  # properties, handle of the value, UUID
                self._found(connection, int.from_bytes(value[1:3], "little"), value[3:])
        elif opcode == _FIND_INFORMATION_RESPONSE:
            size = 2 if pdu[1:2] == b"\x01" else 16
            for one in self._entries(pdu, "handle"):
                self._found(connection, one.handle, int(one.value).to_bytes(size, "little"))
        return ()

    def _entries(self, pdu: bytes, wanted: str) -> list[Any]:
        """Return the entries of a discovery's answer; scapy gives an incomplete one as bytes without that field."""
        entries = getattr(self._layers().ATT_Hdr(pdu).payload, "handles", ())
        return [one for one in entries if hasattr(one, wanted)]

    @staticmethod
    def _found(connection: _Connection, handle: int, uuid: bytes) -> None:
        """Note whose attribute a handle is; a later discovery is right."""
        if short_uuid(uuid) in _DALYS:
            if len(connection.handles) < _MOST_HANDLES:
                connection.handles.add(handle)
        else:
            connection.handles.discard(handle)

    @staticmethod
    def _value(packet: Packet, connection: _Connection, value: bytes, direction: Direction) -> Packet:
        after_gap = direction in connection.lost
        connection.lost.discard(direction)
        return Packet(
            number=packet.number,
            time_ns=packet.time_ns,
            data=value,
            interface=packet.interface,
            direction=direction,
            comment=packet.comment,
            link_type=packet.link_type,
            transport="ble",
            connection=connection.name,
            after_gap=after_gap,
        )

    def _layers(self) -> Any:
        if self._scapy is None:
            try:
                from scapy.layers import bluetooth
            except ImportError:
                raise missing("Bluetooth is read with", "scapy", "scapy") from None
            self._scapy = bluetooth
        return self._scapy
