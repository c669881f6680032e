# SPDX-License-Identifier: GPL-2.0-or-later
"""Requests that change something on a board, and what the reply says of it (docs/records.md, 10; field notes, a.3).

| ID     | writes                                       | reply                            |
|--------|----------------------------------------------|----------------------------------|
| 00     | restart                                      | rarely seen                      |
| D9, DA | discharge, charge MOS: byte 0 01 on, 00 off  | byte 0 is the new state          |
| 21     | clock (bytes 0-5), SOC (6-7, 0.1 %)          | byte 0 is 1 when it was taken,   |
|        |                                              | by one source; 0 when not        |
| 10..2A | write = read - 40 of the settings 50..6A     | not known                        |

On and off of D9 and DA are as devices have them; the vendor's article of 2024 has them the other way round (fact 7).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref import quantities, settings

if TYPE_CHECKING:
    from dalyref.values import Fields

RESTART, SET_CLOCK, DISCHARGE_MOS, CHARGE_MOS = 0x00, 0x21, 0xD9, 0xDA
_SETTINGS = range(0x10, 0x2B)
_READ = 0x40
"""What the ID of a read is above that of its write."""
SWITCHES = {DISCHARGE_MOS: "daly.setting.mos_discharge", CHARGE_MOS: "daly.setting.mos_charge"}
"""The field that byte 0 stands for, of a request and of its reply."""

CONFIRMED, DENIED, ANSWERED = "confirmed", "denied", "answered"


def is_write(data_id: int) -> bool:
    """Tell a request that writes from one that reads."""
    return data_id in (RESTART, DISCHARGE_MOS, CHARGE_MOS) or data_id in _SETTINGS


def switched(data_id: int, data: bytes) -> Fields:
    """Return what byte 0 of D9 or DA, request or reply, says. What stands behind it in a reply is stale."""
    return {SWITCHES[data_id]: quantities.switch(data[:1])}


def would_set(data_id: int, data: bytes) -> Fields:
    """Return what a write's eight data bytes ask for."""
    if data_id == RESTART:
        return {"daly.command": "restart"}
    if data_id in SWITCHES:
        return switched(data_id, data)
    if data_id == SET_CLOCK:
        fields: Fields = {"daly.setting.soc": quantities.tenths(data[6:8])}
        clock = quantities.clock(data[:6])
        return fields if clock is None else {"daly.clock": clock, **fields}
    return settings.decode(data_id + _READ, data)


def result(data_id: int, written: bytes, answer: bytes) -> str:
    """Return what a reply's eight data bytes say of a write's eight."""
    if data_id in (DISCHARGE_MOS, CHARGE_MOS):
        # States: 02 asks for on as 01 does.
        return CONFIRMED if bool(answer[0]) == bool(written[0]) else DENIED
    if data_id == SET_CLOCK:
        if answer == written:  # whether it was taken is not known: byte 0 is the year's, 1 or not
            return ANSWERED
        return {1: CONFIRMED, 0: DENIED}.get(answer[0], ANSWERED)
    return CONFIRMED if data_id != RESTART and answer == written else ANSWERED
