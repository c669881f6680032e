# SPDX-License-Identifier: GPL-2.0-or-later
"""Who speaks, by the address byte of an A5 frame (docs/records.md, section 5; field notes, fact 3).

| address byte            | is                                | board        |
|-------------------------|-----------------------------------|--------------|
| 40                      | host's request (PC, RS-485)       | 1            |
| 41..4F                  | host's request to board 2..16     | address - 3F |
| 80, 20, any other >= 20 | host's request (app, GPRS, other) | not known    |
| 01..10                  | reply of board 1..16              | address      |
| 00, 11..1F              | reply                             | not known    |
"""

from __future__ import annotations

REQUEST, REPLY, ECHO = 1, 2, 3
"""The values of ``daly.direction``."""

FIRST_HOST = 0x20


def is_request(address: int) -> bool:
    """Tell a host's request from a board's reply."""
    return address >= FIRST_HOST


def board(address: int) -> int:
    """Return the number of the board that is asked or that answers, 0 where it is not known."""
    if 0x01 <= address <= 0x10:
        return address
    if 0x40 <= address <= 0x4F:
        return address - 0x3F
    return 0


def named_board(address: int) -> int:
    """Return the board that a request to `address` names, 0 where it names none."""
    return address - 0x3F if 0x40 <= address <= 0x4F else 0


def host(address: int) -> int:
    """Return who asks: 40..4F are one host (a PC asking boards), any other address is one of its own."""
    return 0x40 if 0x40 <= address <= 0x4F else address


def only_board(address: int) -> int:
    """Return the board whose reply alone answers a request to `address`, 0 where any board's does."""
    return board(address) if 0x41 <= address <= 0x4F else 0
