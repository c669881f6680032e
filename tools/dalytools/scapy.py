# SPDX-License-Identifier: GPL-2.0-or-later
"""Daly's frames as scapy layers, to craft test traffic with: ``from dalytools.scapy import DalyFrame``.

    A5 frame     | A5 | address | data ID | 08 | d0 .. d7 | sum |           DalyFrame, on link type USER0 (147)
    Modbus RTU   | address | function | body ...  | crc lo, hi |            DalyModbus, the same
    CAN          | flags | priority | data ID | destination | source | length | - | data |     DalyCan, SocketCAN (227)

Fields have the names that the dissector has, without ``daly.``. Length, sum and CRC are filled in where they are left
out. ``pip install 'dalyshark[scapy]'``. Sources: vendor's paper V1.2 section 2.3, article of 2024; docs/protocol.md.
"""

# scapy's fields have no types that a checker could follow.
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false, reportUnknownArgumentType=false
# pyright: reportUntypedBaseClass=false, reportIncompatibleMethodOverride=false, reportUnannotatedClassAttribute=false
# pyright: reportUnknownParameterType=false, reportMissingParameterType=false, reportAttributeAccessIssue=false
# pyright: reportMissingTypeArgument=false, reportMissingTypeStubs=false

from __future__ import annotations

from typing import Any, ClassVar

from scapy.config import conf
from scapy.fields import (
    BitField,
    ByteField,
    FieldLenField,
    LEShortField,
    StrFixedLenField,
    StrLenField,
    X3BytesField,
    XByteField,
)
from scapy.layers.can import CAN
from scapy.packet import Packet, Raw

from dalyref import a5, addresses, can_classic, modbus

__all__ = ["DalyCan", "DalyFrame", "DalyModbus"]

USER0, SOCKETCAN = 147, 227
_EXTENDED = 4
"""Of the flags of a SocketCAN frame: 29 bits, no remote frame, no error."""
_MOST_CAN_BYTES = 8
_D2 = 0xD2
_REGISTERS = modbus.LARGEST_READ // 2
_LONGEST_BODY = modbus.LONGEST - 4  # address, function, CRC
_REPLY_OFFSET = 0x30
"""80 + N asks, 50 + N answers."""


class DalyFrame(Packet):
    """A frame of 13 bytes (V1.2, 2.3). ``data``: eight bytes; ``checksum``: filled in when None.

    >>> bytes(DalyFrame(address=0x40, data_id=0x90)).hex()
    'a540900800000000000000007d'
    """

    name = "Daly A5"
    fields_desc: ClassVar[list[Any]] = [
        XByteField("start", 0xA5),
        XByteField("address", 0x40),
        XByteField("data_id", 0x90),
        ByteField("length", 8),
        StrFixedLenField("data", bytes(8), 8),
        XByteField("checksum", None),
    ]

    def post_build(self, pkt: bytes, pay: bytes) -> bytes:
        """Fill in the sum."""
        if self.checksum is None:
            pkt = pkt[:12] + bytes((sum(pkt[:12]) & 0xFF,))
        return pkt + pay

    def guess_payload_class(self, payload: bytes) -> Any:
        """Take what follows for another frame."""
        return _first(payload)

    def hashret(self) -> bytes:
        """Return what a request and its reply have in common."""
        return bytes((self.data_id,))

    def answers(self, other: Any) -> int:
        """Tell a reply to `other`."""
        return int(
            isinstance(other, DalyFrame)
            and self.data_id == other.data_id
            and not addresses.is_request(self.address)
            and addresses.is_request(other.address)
            and addresses.only_board(other.address) in (0, addresses.board(self.address))
        )

    @classmethod
    def dispatch_hook(cls, _pkt: bytes = b"", *_args: Any, **_kargs: Any) -> Any:
        """Give Modbus frames to their own class."""
        return _first(_pkt) if _pkt else cls


class DalyModbus(Packet):
    """A Modbus RTU frame of Daly's. ``body``: what stands between function and CRC; ``crc``: filled in when None.

    >>> bytes(DalyModbus.read(0xD2, 0x000C, 1)).hex()
    'd203000c000157aa'
    """

    name = "Daly Modbus"
    fields_desc: ClassVar[list[Any]] = [
        XByteField("address", 0xD2),
        XByteField("function", modbus.READ),
        StrLenField("body", b"", length_from=lambda packet: packet.body_length, max_length=_LONGEST_BODY),
        LEShortField("crc", None),
    ]
    body_length = 0

    @classmethod
    def read(cls, address: int, register: int, count: int) -> DalyModbus:
        """Build a read request."""
        return cls(address=address, function=modbus.READ, body=register.to_bytes(2, "big") + count.to_bytes(2, "big"))

    @classmethod
    def write(cls, address: int, register: int, value: int) -> DalyModbus:
        """Build a write of one register."""
        body = register.to_bytes(2, "big") + value.to_bytes(2, "big")
        return cls(address=address, function=modbus.WRITE_ONE, body=body)

    @classmethod
    def reply(cls, address: int, *values: int) -> DalyModbus:
        """Build the reply to a read. Raise ValueError where the values are more than a frame has room for."""
        if len(values) > _REGISTERS:
            raise ValueError(f"a reply has room for {_REGISTERS} registers, not {len(values)}")
        body = bytes((2 * len(values),)) + b"".join(value.to_bytes(2, "big") for value in values)
        return cls(address=address, function=modbus.READ, body=body)

    def pre_dissect(self, s: bytes) -> bytes:
        """Find how long the frame is: the shortest length whose CRC is right, else all there is."""
        end, _ = modbus.window(s, 0, len(s))
        self.body_length = max(0, (end or len(s)) - 4)
        return s

    def post_build(self, pkt: bytes, pay: bytes) -> bytes:
        """Fill in the CRC."""
        if self.crc is None:
            pkt = pkt[:-2] + modbus.crc(pkt[:-2]).to_bytes(2, "little")
        return pkt + pay

    def guess_payload_class(self, payload: bytes) -> Any:
        """Take what follows for another frame."""
        return _first(payload)

    def hashret(self) -> bytes:
        """Return what a request and its reply have in common."""
        asked = self.address - _REPLY_OFFSET if modbus.asks(self.address) and self.address != _D2 else self.address
        return bytes((asked, self.function & 0x7F))

    def answers(self, other: Any) -> int:
        """Tell a reply to `other`."""
        return int(
            isinstance(other, DalyModbus)
            and self._may(reply=True)
            and other._may(reply=False)
            and self.hashret() == other.hashret()
        )

    def _may(self, *, reply: bool) -> bool:
        """Tell whether it may be a reply, or a request: by address, and of D2, which has one for both, by its shape.

        A write of one register and its reply are the same frame.
        """
        if not (modbus.answers if reply else modbus.asks)(self.address):
            return False
        if self.address != _D2 or self.function == modbus.WRITE_ONE:
            return True
        start_and_count = len(self.body) == 4
        is_reply = start_and_count if self.function == modbus.WRITE_MANY else not start_and_count
        return is_reply is reply


class DalyCan(Packet):
    """A SocketCAN frame of the classic dialect: 29-bit identifier 18 | data ID | destination | source (article, 1).

    >>> bytes(DalyCan(data_id=0x90, destination=1, source=0x40)).hex()
    '98900140080000000000000000000000'
    """

    name = "Daly CAN"
    fields_desc: ClassVar[list[Any]] = [
        BitField("flags", _EXTENDED, 3),
        BitField("priority", 0x18, 5),
        XByteField("data_id", 0x90),
        XByteField("destination", 0x01),
        XByteField("source", 0x40),
        FieldLenField("length", None, length_of="data", fmt="B"),
        X3BytesField("padding", 0),
        StrLenField("data", bytes(8), length_from=lambda packet: packet.length, max_length=_MOST_CAN_BYTES),
    ]

    def hashret(self) -> bytes:
        """Return what a request and its reply have in common."""
        return bytes((self.data_id,))

    def answers(self, other: Any) -> int:
        """Tell a reply to `other`."""
        return int(
            isinstance(other, DalyCan)
            and self.data_id == other.data_id
            and self.source == other.destination
            and addresses.is_request(other.source)
        )


class _SocketCan(CAN):
    """Whatever a SocketCAN capture holds: Daly's classic frames as DalyCan, others as scapy's own CAN."""

    @classmethod
    def dispatch_hook(cls, _pkt: bytes = b"", *_args: Any, **_kargs: Any) -> Any:
        """Choose by flags and identifier (docs/wires.md 2, first row), among frames of at most 8 bytes."""
        others = CAN.dispatch_hook(_pkt)  # CAN FD has a class of its own
        if others is not CAN or len(_pkt) < 8:
            return others
        word = int.from_bytes(_pkt[:4])
        identifier = word & 0x1FFFFFFF
        known = can_classic.fits(identifier) and can_classic.data_id(identifier) in can_classic.PAPER
        return DalyCan if known and word >> 29 == _EXTENDED else CAN


def _first(data: bytes) -> Any:
    """Return the class of the frame that some bytes begin with."""
    if data[:1] == bytes((a5.START,)):
        return DalyFrame
    if len(data) > 2 and (modbus.asks(data[0]) or modbus.answers(data[0])) and modbus.window(data, 0, len(data))[0]:
        return DalyModbus
    return Raw


conf.l2types.register(USER0, DalyFrame)
conf.l2types.register(SOCKETCAN, _SocketCan)
