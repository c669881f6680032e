# SPDX-License-Identifier: GPL-2.0-or-later
"""The texts of a board: names, codes, versions."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Texts:
    """What a board says of itself, ASCII. Made up; the shapes are those of real boards."""

    manufacturer: str = "DALY"
    battery_name: str = "LFP 16S 100Ah"
    battery_code: str = "DL-SIM-0001-20240315"
    software_version: str = "11_240123_K00T"
    hardware_version: str = "DL-BMS-R32-01E"
    serial_number: str = "SN24031500001"
    firmware_index: str = "20240315"
    password: str = "123456"  # noqa: S105 - the one that boards are sold with
