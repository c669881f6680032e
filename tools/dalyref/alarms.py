# SPDX-License-Identifier: GPL-2.0-or-later
"""The alarm grid, 70 to 8A: nine classes at three levels (docs/protocol.md, a.2; one source, HAIDI).

ID = 70 + 9 x (level - 1) + class

class 2        | discharge | delay | charge   | delay |     A as sent (offset 30000, 0.1); delays 0.01 s
class 3, 4     | pairs of bytes, meaning not sure     |
the others     | value     | delay | recovery | delay |     mV, V (0.1) or C (a difference: no offset)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref.quantities import amperes, hundredths, number, tenths

if TYPE_CHECKING:
    from dalyref.quantities import Meaning
    from dalyref.values import Fields

IDS = range(0x70, 0x8B)

CLASSES: tuple[tuple[str, Meaning | None], ...] = (
    ("cell_high", number),  # mV
    ("cell_low", number),
    ("current", amperes),
    ("temp_high", None),
    ("temp_low", None),
    ("pack_high", tenths),  # V
    ("pack_low", tenths),
    ("cell_difference", number),  # mV
    ("temp_difference", number),  # C
)

_LIMIT = ("value", "delay", "recovery", "recovery_delay")
_CURRENT = ("discharge", "discharge_delay", "charge", "charge_delay")


def decode(data_id: int, data: bytes) -> Fields:
    """Decode the eight data bytes of one of ``IDS``: which alarm, from what value on and until what, after how long."""
    level, kind = divmod(data_id - IDS.start, len(CLASSES))
    name, meaning = CLASSES[kind]
    fields: Fields = {"daly.alarm.level": level + 1, "daly.alarm.class": name}
    if meaning is None:
        return fields
    for at, field in enumerate(_CURRENT if name == "current" else _LIMIT):
        value = (hundredths if at % 2 else meaning)(data[2 * at : 2 * at + 2])
        if value is not None:
            fields["daly.alarm." + field] = float(value)
    return fields
