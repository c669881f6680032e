# SPDX-License-Identifier: GPL-2.0-or-later
"""Daly's two Modbus RTU dialects: D2 (both ways) and 80+N (requests) / 50+N (replies), N = 1..16.

    read request      | addr 03 | start  | count  | crc |                       8
    read reply        | addr 03 | bytes  | data ...     | crc |                 5 + bytes
    write one         | addr 06 | register | value | crc |                      8, both ways
    write many        | addr 10 | start  | count | data ... | crc |             8 + 2 x count  (Daly: no byte count)
                      | addr 10 | start  | count | bytes | data ... | crc |     9 + 2 x count  (the standard)
    write many reply  | addr 10 | start  | count | crc |                        8
    exception         | addr 83, 86 or 90 | code | crc |                        5

Registers and counts are big-endian, the CRC goes low byte first. Sources: the vendor's article of 2024, section 3;
field notes, fact 8 and section d; docs/records.md, section 2.
"""

from __future__ import annotations

READ, WRITE_ONE, WRITE_MANY = 0x03, 0x06, 0x10
EXCEPTIONS = (0x83, 0x86, 0x90)
LARGEST_READ = 252
"""Data bytes of a read reply: 126 registers, which the WiFi module reads at once (field notes d; Modbus allows 125)."""
LARGEST_WRITE = 123
"""Registers of a write: Modbus's own limit."""
LONGEST = 257
"""Bytes of the longest window."""

POLYNOMIAL = 0xA001


def _table() -> tuple[int, ...]:
    table: list[int] = []
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = value >> 1 ^ (POLYNOMIAL if value & 1 else 0)
        table.append(value)
    return tuple(table)


_TABLE = _table()


def crc(data: bytes) -> int:
    """Return the CRC-16 (polynomial A001, start FFFF); over a frame with its own CRC it is 0."""
    value = 0xFFFF
    for byte in data:
        value = value >> 8 ^ _TABLE[(value ^ byte) & 0xFF]
    return value


def asks(address: int) -> bool:
    """Tell whether a request can carry this address."""
    return address == 0xD2 or 0x81 <= address <= 0x90


def answers(address: int) -> bool:
    """Tell whether a reply can carry this address."""
    return address == 0xD2 or 0x51 <= address <= 0x60


def forms(data: bytes, start: int, end: int) -> list[int]:
    """Return the lengths of all windows that ``data[start:end]`` fits as far as it goes, shortest first.

    A length that stands in bytes behind `end` is given as the least it can be, which is more than is there.
    Both address and function must be there.
    """
    there = end - start
    address, function = data[start], data[start + 1]
    ask, answer = asks(address), answers(address)
    lengths: list[int] = []
    if function == READ:
        if ask:
            lengths.append(8)
        if answer:
            count = data[start + 2] if there > 2 else 2
            if count % 2 == 0 and 2 <= count <= LARGEST_READ:
                lengths.append(5 + count)
    elif function == WRITE_ONE:
        if ask or answer:
            lengths.append(8)
    elif function == WRITE_MANY:
        if answer:
            lengths.append(8)
        high = data[start + 4] if there > 4 else 0
        count = data[start + 5] if there > 5 else 1
        if ask and high == 0 and 1 <= count <= LARGEST_WRITE:
            lengths.append(8 + 2 * count)
            if there <= 6 or data[start + 6] == 2 * count:
                lengths.append(9 + 2 * count)
    elif function in EXCEPTIONS and answer:
        lengths.append(5)
    return sorted(lengths)


def window(data: bytes, start: int, end: int) -> tuple[int, bool]:
    """Look for a good window at `start`, with the bytes up to `end` at hand.

    Return (end of the shortest good one or 0, whether more bytes could still make one).
    """
    if end - start < 2:
        return 0, True
    waits = False
    for length in forms(data, start, end):
        stop = start + length
        if stop > end:
            waits = True
        elif crc(data[start:stop]) == 0:
            return stop, False
    return 0, waits
