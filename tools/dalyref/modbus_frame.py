# SPDX-License-Identifier: GPL-2.0-or-later
"""What a Modbus frame with a right CRC says by itself (docs/wires.md, section 1; windows: ``modbus``).

| addr | 03 | start    | count | crc |                      read request, 8 bytes: a reply's length is odd
| addr | 03 | bytes    | data ...     | crc |               read reply
| addr | 06 | register | value | crc |                      write one: request and reply are alike
| addr | 10 | start    | count | [bytes] data ... | crc |   write many, request
| addr | 10 | start    | count | crc |                      write many, reply
| addr | 8x | code | crc |                                  exception
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto
from typing import TYPE_CHECKING

from dalyref import modbus
from dalyref.values import put

if TYPE_CHECKING:
    from dalyref.values import Fields

D2 = 0xD2


class Shape(Enum):
    """The six kinds of frames."""

    READ_REQUEST = auto()
    READ_REPLY = auto()
    WRITE_ONE = auto()
    WRITE_MANY = auto()
    WRITE_MANY_REPLY = auto()
    EXCEPTION = auto()


@dataclass(frozen=True, slots=True)
class ModbusFrame:
    """One frame, taken apart."""

    shape: Shape
    address: int
    function: int
    register: int = 0
    """First register; 0 where the frame does not say."""
    count: int = 0
    """How many registers it reads, writes or brings."""
    data: bytes = b""
    """Values of the registers, two bytes each."""
    byte_count: int | None = None
    """Of a write that has one."""
    code: int = 0
    """Of an exception."""

    @property
    def d2(self) -> bool:
        """Tell the D2 dialect from the 81 dialect."""
        return self.address == D2

    @property
    def board(self) -> int:
        """Number of the board that is asked or that answers, 0 where the address does not tell."""
        if 0x81 <= self.address <= 0x90:
            return self.address - 0x80
        return self.address - 0x50 if 0x51 <= self.address <= 0x60 else 0

    @property
    def asks(self) -> bool | None:
        """Tell a request from a reply; None where only what came before can (D2, write one)."""
        if 0x81 <= self.address <= 0x90:
            return True
        if 0x51 <= self.address <= 0x60:
            return False
        if self.shape is Shape.WRITE_ONE:
            return None
        return self.shape in (Shape.READ_REQUEST, Shape.WRITE_MANY)


def parse(raw: bytes) -> ModbusFrame:
    """Take a good window apart. `raw`: all of its bytes, CRC included."""
    address, function, content = raw[0], raw[1], raw[2:-2]
    if function not in (modbus.READ, modbus.WRITE_ONE, modbus.WRITE_MANY):
        return ModbusFrame(Shape.EXCEPTION, address, function, code=content[0])
    first, second = int.from_bytes(content[:2]), int.from_bytes(content[2:4])
    if function == modbus.WRITE_ONE:
        return ModbusFrame(Shape.WRITE_ONE, address, function, first, 1, content[2:])
    if function == modbus.READ:
        if len(raw) == 8:
            return ModbusFrame(Shape.READ_REQUEST, address, function, first, second)
        return ModbusFrame(Shape.READ_REPLY, address, function, count=content[0] // 2, data=content[1:])
    if len(raw) == 8:
        return ModbusFrame(Shape.WRITE_MANY_REPLY, address, function, first, second)
    counted = len(content) == 5 + 2 * second
    return ModbusFrame(
        Shape.WRITE_MANY, address, function, first, second, content[4 + counted :], content[4] if counted else None
    )


def describe(frame: ModbusFrame, fields: Fields) -> None:
    """Add what the frame says by itself."""
    if frame.board:
        fields["daly.board"] = frame.board
    if frame.shape is Shape.EXCEPTION:
        fields["daly.modbus.exception"] = frame.code
        return
    if frame.shape is not Shape.READ_REPLY:
        fields["daly.modbus.register"] = frame.register
        if frame.shape is not Shape.WRITE_ONE:
            fields["daly.modbus.count"] = frame.count
    if frame.byte_count is not None:
        fields["daly.modbus.byte_count"] = frame.byte_count
    put(fields, "daly.modbus.value", [int.from_bytes(frame.data[at : at + 2]) for at in range(0, len(frame.data), 2)])
