# SPDX-License-Identifier: GPL-2.0-or-later
"""Modbus RTU as Daly boards speak it (field notes d): frames built and taken apart.

    address  03  register  count                      crc     read          address  03  bytes  values ..  crc
    address  06  register  value                      crc     write one     the same frame again
    address  10  register  count  (bytes)  values ..  crc     write many    address  10  register  count   crc

Everything high byte first, but the CRC: low byte first. Daly sends 10 without the byte count; both are taken.

    dialect   asks        answers    board
    d2        D2          D2         whatever its number
    81        80 + N      50 + N     N
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

READ, WRITE_ONE, WRITE_MANY = 0x03, 0x06, 0x10
D2: Final = 0xD2
ASKS_81, ANSWERS_81 = 0x80, 0x50
MAX_READ: Final = 126  # registers; the WiFi module asks for so many at once (field notes d)
MAX_WRITTEN: Final = 123
MAX_REQUEST: Final = 9 + 2 * MAX_WRITTEN  # bytes


def _crc_table() -> tuple[int, ...]:
    table: list[int] = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
        table.append(crc)
    return tuple(table)


_CRC_TABLE: Final = _crc_table()


def sealed(body: bytes) -> bytes:
    """Return the frame with its CRC-16 behind it."""
    crc = 0xFFFF
    for byte in body:
        crc = crc >> 8 ^ _CRC_TABLE[(crc ^ byte) & 0xFF]
    return body + crc.to_bytes(2, "little")


def read_request(address: int, register: int, count: int) -> bytes:
    """Ask for registers."""
    return sealed(bytes((address, READ)) + register.to_bytes(2) + count.to_bytes(2))


def write_request(address: int, register: int, values: list[int], *, function: int | None = None) -> bytes:
    """Write one register by 06, several by 10 hex without a byte count, as Daly's own programs do."""
    head = bytes((address,))
    if function == WRITE_ONE or (function is None and len(values) == 1):
        return sealed(head + bytes((WRITE_ONE,)) + register.to_bytes(2) + values[0].to_bytes(2))
    data = b"".join(value.to_bytes(2) for value in values)
    return sealed(head + bytes((WRITE_MANY,)) + register.to_bytes(2) + len(values).to_bytes(2) + data)


@dataclass(frozen=True, slots=True)
class Request:
    """A good request: address, function, first register, how many, and the values that it writes."""

    address: int
    function: int
    register: int
    count: int
    values: tuple[int, ...] = ()

    @property
    def writes(self) -> bool:
        """Whether it changes something."""
        return self.function != READ


def request_length(data: bytes) -> int:
    """Length of the good request that begins here, 0 where there is none (or not the whole of it yet)."""
    if len(data) < 8 or not (data[0] == D2 or 0x81 <= data[0] <= 0x90):
        return 0
    if data[1] in {READ, WRITE_ONE}:
        return 8 if sealed(data[:6]) == data[:8] else 0
    if data[1] == WRITE_MANY:
        values = 2 * int.from_bytes(data[4:6])
        for size in (6 + values, 7 + values):
            if 0 < values <= 2 * MAX_WRITTEN and len(data) >= size + 2 and sealed(data[:size]) == data[: size + 2]:
                return size + 2
    return 0


def may_become_request(data: bytes) -> bool:
    """Whether these bytes begin like a request that is not whole yet."""
    if not (data[0] == D2 or 0x81 <= data[0] <= 0x90) or (
        len(data) > 1 and data[1] not in {READ, WRITE_ONE, WRITE_MANY}
    ):
        return False
    if len(data) < 8:
        return True
    count = int.from_bytes(data[4:6])
    return data[1] == WRITE_MANY and 0 < count <= MAX_WRITTEN and len(data) < 9 + 2 * count


def parse(data: bytes) -> Request | None:
    """Take a whole request apart; None where the bytes are none, or not exactly one."""
    if request_length(data) != len(data):
        return None
    register, number = int.from_bytes(data[2:4]), int.from_bytes(data[4:6])
    if data[1] == READ:
        return Request(data[0], READ, register, number) if 0 < number <= MAX_READ else None
    if data[1] == WRITE_ONE:
        return Request(data[0], WRITE_ONE, register, 1, (number,))
    body = data[-2 - 2 * number : -2]
    values = tuple(int.from_bytes(body[at : at + 2]) for at in range(0, len(body), 2))
    return Request(data[0], WRITE_MANY, register, number, values)


def reply(request: Request, values: list[int]) -> bytes:
    """Answer a request: the values read, or what a write says back."""
    address = D2 if request.address == D2 else request.address - ASKS_81 + ANSWERS_81
    if request.function == READ:
        body = b"".join(value.to_bytes(2) for value in values)
        return sealed(bytes((address, READ, len(body))) + body)
    head = bytes((address, request.function)) + request.register.to_bytes(2)
    said = values[0] if request.function == WRITE_ONE else request.count
    return sealed(head + said.to_bytes(2))
