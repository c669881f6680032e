# SPDX-License-Identifier: GPL-2.0-or-later
"""Reply 98, battery failure status: 0 -> no error, 1 -> error (vendor's paper V1.2, section 3).

Byte 6 bits 4 and 5 are reserved in the paper; their meaning is from the field notes (a.1). Bit 4 is a state, not a
fault, and neither of the two is counted. Byte 7 is the fault code.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dalyref.values import Fields, Value

PREFIX = "daly.fault."

TABLE: tuple[tuple[str, ...], ...] = (
    (  # Byte 0
        "cell_volt_high_level_1",  # Bit 0
        "cell_volt_high_level_2",
        "cell_volt_low_level_1",
        "cell_volt_low_level_2",
        "sum_volt_high_level_1",
        "sum_volt_high_level_2",
        "sum_volt_low_level_1",
        "sum_volt_low_level_2",
    ),
    (  # Byte 1
        "chg_temp_high_level_1",
        "chg_temp_high_level_2",
        "chg_temp_low_level_1",
        "chg_temp_low_level_2",
        "dischg_temp_high_level_1",
        "dischg_temp_high_level_2",
        "dischg_temp_low_level_1",
        "dischg_temp_low_level_2",
    ),
    (  # Byte 2
        "chg_overcurrent_level_1",
        "chg_overcurrent_level_2",
        "dischg_overcurrent_level_1",
        "dischg_overcurrent_level_2",
        "soc_high_level_1",
        "soc_high_level_2",
        "soc_low_level_1",
        "soc_low_level_2",
    ),
    (  # Byte 3; bits 4 to 7 reserved
        "diff_volt_level_1",
        "diff_volt_level_2",
        "diff_temp_level_1",
        "diff_temp_level_2",
    ),
    (  # Byte 4
        "chg_mos_temp_high",
        "dischg_mos_temp_high",
        "chg_mos_temp_sensor",
        "dischg_mos_temp_sensor",
        "chg_mos_adhesion",
        "dischg_mos_adhesion",
        "chg_mos_open_circuit",
        "dischg_mos_open_circuit",
    ),
    (  # Byte 5
        "afe_collect_chip",
        "voltage_collect_dropped",
        "cell_temp_sensor",
        "eeprom",
        "rtc",
        "precharge",
        "communication",
        "internal_communication",
    ),
    (  # Byte 6; bits 4 and 5 by the field notes, 6 and 7 reserved
        "current_module",
        "sum_voltage_detect",
        "short_circuit_protect",
        "low_volt_forbidden_chg",
        "mos_off_by_command",
        "charging_cabinet_offline",
    ),
)

NAMES = tuple(name for row in TABLE for name in row)
"""All fifty, in bit order."""

_BITS = tuple((byte * 8 + bit, name) for byte, row in enumerate(TABLE) for bit, name in enumerate(row))
"""(Bit of the payload read as a little-endian number, name)."""
NAMED = sum(1 << bit for bit, _ in _BITS)
_COUNTED = NAMED & ~(0b110000 << 48)

_NONE: Fields = {PREFIX + name: False for name in NAMES}
_NONE["daly.fault_code"] = _NONE["daly.fault_count"] = 0
_CLEAR = bytes(8)
_FIELDS = {bit: PREFIX + name for bit, name in _BITS}


def bits(data: bytes) -> int:
    """Return the named bits of the eight data bytes as one number: bit 0 of byte 0 is bit 0, of byte 1 bit 8."""
    return int.from_bytes(data, "little") & NAMED


def decode(data: bytes) -> Fields:
    """Decode the eight data bytes: every named bit, the code, and how many of the paper's 48 faults are set."""
    fields = _NONE.copy()
    if data == _CLEAR:
        return fields
    left = found = bits(data)
    while left:
        lowest = left & -left
        fields[_FIELDS[lowest.bit_length() - 1]] = True
        left ^= lowest
    fields["daly.fault_code"] = data[7]
    fields["daly.fault_count"] = (found & _COUNTED).bit_count()
    return fields


def names(found: int) -> list[Value]:
    """Return the names of the bits set in `found` (a number as ``bits`` gives), in bit order."""
    return [name for bit, name in _BITS if found >> bit & 1]
