# SPDX-License-Identifier: GPL-2.0-or-later
"""A real poll of an 8-cell pack (``cpy-`` in real-frames.jsonl), and what stands in it, worked out by hand."""

from __future__ import annotations

import csv
from typing import TYPE_CHECKING

from tests.tools.dalytools.made import ASK, a5, write

if TYPE_CHECKING:
    from pathlib import Path

from dalytools.cli import main

REPLIES = tuple(
    map(
        bytes.fromhex,
        [
            "a501900800f80000753001815d",
            "a50191080c52050b6b0101819b",
            "a50192083d013d016b010181aa",
            "a50193080001002500009de9ed",
            "a501940808010000000001327e",
            "a5019508010b6b0c420c433289",
            "a5019508020c3c0c520c43326c",
            "a5019508030c000c480c433227",
            "a5019608013d000000000032b4",
            "a50197089000000000000000d5",
            "a5019808000000000000100056",
        ],
    )
)
"""90 .. 98."""
TOLD = {
    "time_UTC": "2023-11-14 22:13:20.000000",  # 1.7e9 s
    "interface": "0",
    "transport": "uart",
    "board": "1",
    "pack_voltage_V": "24.8",
    "pack_gather_voltage_V": "0.0",
    "pack_current_A": "0.0",
    "pack_current_raw": "30000",
    "soc_percent": "38.5",
    "cell_max_voltage_mV": "3154",
    "cell_max_number": "5",
    "cell_min_voltage_mV": "2923",
    "cell_min_number": "1",
    "temperature_max_C": "21",
    "state": "stationary",
    "mos_charge": "true",
    "mos_discharge": "false",
    "life": "37",
    "remaining_capacity_mAh": "40425",
    "cell_count": "8",
    "sensor_count": "1",
    "charger": "disconnected",
    "load": "disconnected",
    "cycles": "1",
    "cell_01_mV": "2923",
    "cell_02_mV": "3138",
    "cell_03_mV": "3139",
    "cell_04_mV": "3132",
    "cell_05_mV": "3154",
    "cell_06_mV": "3139",
    "cell_07_mV": "3072",
    "cell_08_mV": "3144",
    "cells_count": "8",
    "cells_min_mV": "2923",
    "cells_max_mV": "3154",
    "cells_average_mV": "3105.125",  # 24841 / 8
    "cells_spread_mV": "231",
    "sensor_01_C": "21",
    "balance_mask": "0x90",
    "balance_cell": "5 8",
    "fault_count": "0",
    "fault_mos_off_by_command": "true",
    "fault_eeprom": "false",
}

CELLS = [2923, 3138, 3139, 3132, 3154, 3139, 3072, 3144]


def poll(path: Path, *starts: float) -> Path:
    """Write a capture with a poll at each of these times (s from 1.7e9)."""
    return write(path, [(start + number * 0.1, reply) for start in starts for number, reply in enumerate(REPLIES)])


def ask_and_answer(path: Path, *starts: float, board: int = 1) -> Path:
    """Write a capture with requests of 0x90, replied after 50 ms."""
    reply = a5(board, 0x90, REPLIES[0][4:12])
    return write(path, [pair for start in starts for pair in ((start, ASK), (start + 0.05, reply))])


def decode(*words: object) -> int:
    """Run the command."""
    return main(["decode", *map(str, words)])


def table(path: Path) -> list[dict[str, str]]:
    """Read a CSV file."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
