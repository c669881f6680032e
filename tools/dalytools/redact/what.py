# SPDX-License-Identifier: GPL-2.0-or-later
"""What can be blanked, in the words that people are told; and which values of the protocol are no secret.

A value is kept only where its name says that it is harmless: what a later version of the decoder adds is blanked until
it stands here.
"""

from __future__ import annotations

import re
from enum import StrEnum
from functools import cache


class What(StrEnum):
    """What the blanked bytes were, or could have been."""

    BATTERY_CODE = "battery code"
    SERIAL_NUMBER = "serial number"
    PASSWORD = "password"  # noqa: S105 - the word, not one
    BATTERY_NAME = "battery name"
    MANUFACTURER = "manufacturer"
    PRODUCTION_DATE = "production date"
    CLOCK = "clock"
    POSITION = "IMEI, position"
    COPY = "copies of a code, number or password"
    STALE = "stale bytes"
    OLDER = "stale bytes of before the capture"
    UNKNOWN = "bytes that nobody explains"
    FOREIGN = "other protocols"
    TRAFFIC = "other traffic"
    ADDRESS = "addresses"
    DAMAGED = "damaged bytes"


_SECRET = {
    "battery_code": What.BATTERY_CODE,
    "serial_number": What.SERIAL_NUMBER,
    "password": What.PASSWORD,
    "battery_name": What.BATTERY_NAME,
    "manufacturer": What.MANUFACTURER,
    "production_date": What.PRODUCTION_DATE,
    "clock": What.CLOCK,
}
TEXTS = frozenset(
    (What.BATTERY_CODE, What.SERIAL_NUMBER, What.PASSWORD, What.BATTERY_NAME, What.MANUFACTURER),
)
"""Blanked with letters: a text stays one."""

LOOKED_FOR = frozenset((What.BATTERY_CODE, What.SERIAL_NUMBER, What.PASSWORD))
"""Looked for in the whole capture, wherever a copy of them may stand."""

LOOKED_FOR_FIELDS = tuple("daly." + name for name, what in _SECRET.items() if what in LOOKED_FOR)

DATES = frozenset((What.PRODUCTION_DATE, What.CLOCK))

OPAQUE = frozenset((What.UNKNOWN, What.FOREIGN, What.DAMAGED))
"""Nobody knows what is in there: where it is kept, texts in it are not."""

_HARMLESS = re.compile(
    r"""(setting|total|balance|wakeup|alarm|pack|cell|temperature|mos|heater|limit|uptime)\.\w+
    | state | soc | soh | life | cycles | charger | load | d[io][1-4] | power | energy | mileage | heater | fan
    | time_to_full | remaining_capacity | cell_count | sensor_count | firmware_index
    | software_version(_sent)? | hardware_version(_sent)?""",
    re.VERBOSE,
)


@cache
def named(field: str) -> What | None:
    """Return what the value of a field (without ``daly.``) is to be blanked as; None: it is harmless."""
    return None if _HARMLESS.fullmatch(field) else _SECRET.get(field, What.UNKNOWN)
