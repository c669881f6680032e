# SPDX-License-Identifier: GPL-2.0-or-later
"""The fault bits of 0x98, laid out like the paper (UART/485 V1.2, section 3), written down for the simulator alone.

bit     0       1       2       3       4       5       6       7
byte 0  cell high       cell low        sum high        sum low          in pairs: level 1, level 2
byte 1  chg temp high   chg temp low    dischg t. high  dischg t. low    in pairs
byte 2  chg current     dischg current  SOC high        SOC low          in pairs
byte 3  diff voltage    diff temp       -               -                in pairs
byte 4  chg/dischg MOS: too hot x2, sensor x2, adhesion x2, open circuit x2
byte 5  AFE     dropped sensor  EEPROM  RTC     pre-ch. comm.   internal
byte 6  current sum     short   low V   MOS off cabinet -       -        bits 4, 5: field notes a.1
byte 7  fault code
"""

from __future__ import annotations

_PAIRS = (
    ("cell_volt_high", "cell_volt_low", "sum_volt_high", "sum_volt_low"),
    ("chg_temp_high", "chg_temp_low", "dischg_temp_high", "dischg_temp_low"),
    ("chg_overcurrent", "dischg_overcurrent", "soc_high", "soc_low"),
    ("diff_volt", "diff_temp"),
)
_SINGLE = {
    4: (
        "chg_mos_temp_high",
        "dischg_mos_temp_high",
        "chg_mos_temp_sensor",
        "dischg_mos_temp_sensor",
        "chg_mos_adhesion",
        "dischg_mos_adhesion",
        "chg_mos_open_circuit",
        "dischg_mos_open_circuit",
    ),
    5: (
        "afe_collect_chip",
        "voltage_collect_dropped",
        "cell_temp_sensor",
        "eeprom",
        "rtc",
        "precharge",
        "communication",
        "internal_communication",
    ),
    6: (
        "current_module",
        "sum_voltage_detect",
        "short_circuit_protect",
        "low_volt_forbidden_chg",
        "mos_off_by_command",
        "charging_cabinet_offline",
    ),
}


def _bits() -> dict[str, tuple[int, int]]:
    bits: dict[str, tuple[int, int]] = {}
    for byte, names in enumerate(_PAIRS):
        for pair, name in enumerate(names):
            bits[f"{name}_level_1"] = (byte, 2 * pair)
            bits[f"{name}_level_2"] = (byte, 2 * pair + 1)
    for byte, names in _SINGLE.items():
        bits.update({name: (byte, bit) for bit, name in enumerate(names)})
    return bits


FAULT_BITS = _bits()  # name -> (byte, bit)


def fault_payload(names: set[str], code: int = 0) -> bytes:
    """Build the 8 data bytes of a 0x98 reply with these faults set and this fault code."""
    payload = bytearray(8)
    for name in names:
        byte, bit = FAULT_BITS[name]
        payload[byte] |= 1 << bit
    payload[7] = code
    return bytes(payload)
