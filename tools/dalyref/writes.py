# SPDX-License-Identifier: GPL-2.0-or-later
"""Requests that change something on a board, and what the reply says of it (docs/records.md, 10; field notes, a.3).

| ID     | writes                                       | reply                            |
|--------|----------------------------------------------|----------------------------------|
| 00     | restart                                      | rarely seen                      |
| D9, DA | discharge, charge MOS: byte 0 01 on, 00 off  | byte 0 is the new state          |
| 21     | clock and SOC                                | byte 0 is 1 when it was taken    |
| 10..2A | write = read - 40 of the settings 50..6A     | not known                        |
"""

from __future__ import annotations

RESTART, SET_CLOCK, DISCHARGE_MOS, CHARGE_MOS = 0x00, 0x21, 0xD9, 0xDA
_SETTINGS = range(0x10, 0x2B)

CONFIRMED, DENIED, ANSWERED = "confirmed", "denied", "answered"


def is_write(data_id: int) -> bool:
    """Tell a request that writes from one that reads."""
    return data_id in (RESTART, DISCHARGE_MOS, CHARGE_MOS) or data_id in _SETTINGS


def result(data_id: int, written: bytes, answer: bytes) -> str:
    """Return what a reply's eight data bytes say of a write's eight."""
    if data_id in (DISCHARGE_MOS, CHARGE_MOS):
        return CONFIRMED if answer[0] == written[0] else DENIED
    if data_id == SET_CLOCK:
        return CONFIRMED if answer[0] == 1 else DENIED
    return CONFIRMED if data_id != RESTART and answer == written else ANSWERED
