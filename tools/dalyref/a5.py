# SPDX-License-Identifier: GPL-2.0-or-later
"""The A5 frame of the vendor's UART/485 paper V1.2, section 2.3.

    byte   0     1      2      3     4 ............ 11    12
         +----+------+------+----+--------------------+-----+
         | A5 | addr |  id  | 08 |    eight data bytes | sum |
         +----+------+------+----+--------------------+-----+

sum = low byte of the sum of the twelve bytes before. No length other than 8 was ever seen (field notes, section b).
"""

from __future__ import annotations

START = 0xA5
LENGTH = 0x08
SIZE = 13


def checksum(head: bytes) -> int:
    """Return the low byte of the sum of `head`, the twelve bytes before the checksum (paper, 2.3 note 2)."""
    return sum(head) & 0xFF


def build(address: int, data_id: int, data: bytes = bytes(8)) -> bytes:
    """Return the 13 bytes of a frame; ValueError where `data` is not eight bytes or a number is no byte."""
    if len(data) != LENGTH:
        raise ValueError(f"an A5 frame carries 8 data bytes, not {len(data)}")
    head = bytes((START, address, data_id, LENGTH)) + data
    return head + bytes((checksum(head),))


def is_good(data: bytes, start: int = 0) -> bool:
    """Tell whether a whole frame with a right checksum stands at `start`."""
    end = start + SIZE
    return (
        end <= len(data)
        and data[start] == START
        and data[start + 3] == LENGTH
        and checksum(data[start : end - 1]) == data[end - 1]
    )
