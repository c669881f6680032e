# SPDX-License-Identifier: GPL-2.0-or-later
"""The faults of HKMS (docs/protocol.md, c.2): 0409, eight bytes much as 0x98, and the block of 040E (one source).

040E is 14 bytes on two pages:

    page 1   bytes 0-6       page 2   bytes 7-13

Levels are three bits, 0 none. A single bit that means what one of 0x98 means has its name.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalyref import faults

if TYPE_CHECKING:
    from dalyref.values import Fields

PAGE = 7
"""Bytes of the block on a page."""

_LEVELS: tuple[tuple[str, str, str, str], ...] = (
    # bits 0-2, bits 3-5, bit 6, bit 7
    ("cell_high", "cell_low", "", "smart_charger"),
    ("cell_difference", "charge_temp_high", "", "smart_discharger"),
    ("charge_temp_low", "discharge_temp_high", "chg_mos_temp_high", "chg_mos_temp_sensor"),
    ("discharge_temp_low", "temp_difference", "dischg_mos_temp_high", "dischg_mos_temp_sensor"),
    ("pack_high", "pack_low", "short_circuit_protect", ""),
    ("charge_current", "discharge_current", "charge_undervoltage", "discharge_overvoltage"),
    ("soc_low", "soh_low", "", "parallel_communication"),
    ("mos_temp_high", "thermal_runaway", "", ""),
)
"""Bytes 0 to 7."""

_BITS: dict[int, tuple[str, ...]] = {
    11: (
        "afe_collect_chip",  # bit 0
        "afe_communication",
        "afe_sampling",
        "voltage_detect",
        "voltage_collect_dropped",
        "sum_voltage_detect",
        "current_module",
        "cell_temp_sensor",
    ),
    12: (
        "cell_temp_disconnected",  # bit 0
        "eeprom",
        "flash",
        "rtc",
        "chg_mos",
        "dischg_mos",
        "precharge_mos",
        "precharge",
    ),
    13: ("", "", "", "", "", "", "", "heating"),
}
"""Bytes 11 to 13; 8 to 10 say nothing."""


_MORE: dict[int, tuple[str, ...]] = {
    3: ("mos_temp_high_level_1", "mos_temp_high_level_2", "board_temp_high_level_1", "board_temp_high_level_2"),
    6: ("", "", "thermal_runaway", "heating"),
    7: ("balance_communication", "balance_condition"),
}
"""Of 0409, what 0x98 does not have: byte 3 and 6 from bit 4 on, byte 7 from bit 0 on."""


def info(data: bytes) -> Fields:
    """Decode the eight bytes of 0409: every bit that has a name. Nothing is counted."""
    fields: Fields = {}
    for byte, value in enumerate(data):
        names = faults.TABLE[byte] if byte < len(faults.TABLE) else ()
        fields.update({f"daly.fault.{name}": bool(value >> bit & 1) for bit, name in enumerate(names)})
        more = enumerate(_MORE.get(byte, ()), 0 if byte == len(faults.TABLE) else 4)
        fields.update({f"daly.fault.{name}": bool(value >> bit & 1) for bit, name in more if name})
    return fields


def block(page: int, data: bytes) -> Fields:
    """Decode the seven bytes of page 1 or 2: every level and every bit that has a name."""
    fields: Fields = {}
    for byte, value in enumerate(data, (page - 1) * PAGE):
        if byte < len(_LEVELS):
            low, high, six, seven = _LEVELS[byte]
            fields[f"daly.level.{low}"] = value & 7
            fields[f"daly.level.{high}"] = value >> 3 & 7
            bits = ((6, six), (7, seven))
        else:
            bits = tuple(enumerate(_BITS.get(byte, ())))
        fields.update({f"daly.fault.{name}": bool(value >> bit & 1) for bit, name in bits if name})
    return fields
