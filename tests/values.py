# SPDX-License-Identifier: GPL-2.0-or-later
"""What frames say: one table of small sessions, worked out by hand from docs/protocol.md and docs/wires.md.

A record of a case shows exactly what is expected of it, but for what :data:`ELSEWHERE` names.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.meaning import Heard, a5

if TYPE_CHECKING:
    from collections.abc import Mapping

_ELSEWHERE = """
kind transport dialect start address data_id length data checksum checksum.status direction board request_in reply_in
response_time unanswered modbus.address modbus.function modbus.crc modbus.crc.status
"""
ELSEWHERE = {f"daly.{name}" for name in _ELSEWHERE.split()} | {f"daly.cell.{number:02d}" for number in range(1, 49)}
"""Fields that other tests look at."""


def h(text: str) -> str:
    """Hex without its spaces."""
    return text.replace(" ", "")


def reply(data_id: int, data: str, expect: Mapping[str, object]) -> list[Heard]:
    return [Heard(a5(1, data_id, h(data)), 0, expect)]


def write(data_id: int, data: str, expect: Mapping[str, object]) -> list[Heard]:
    return [Heard(a5(0x40, data_id, h(data)), 0, {"write": True, **expect})]


def limits(name: str, *values: float) -> dict[str, object]:
    keys = (f"setting.{name}_high_1", f"setting.{name}_high_2", f"setting.{name}_low_1", f"setting.{name}_low_2")
    return dict(zip(keys, values, strict=True))


TEMPERATURES = {
    "setting.charge_temp_high_1": 55,
    "setting.charge_temp_high_2": 60,
    "setting.charge_temp_low_1": 5,
    "setting.charge_temp_low_2": 0,
    "setting.discharge_temp_high_1": 65,
    "setting.discharge_temp_high_2": 70,
    "setting.discharge_temp_low_1": -15,
    "setting.discharge_temp_low_2": -20,
}


def alarm(level: int, name: str, **values: float) -> dict[str, object]:
    return {"alarm.level": level, "alarm.class": name, **{f"alarm.{key}": value for key, value in values.items()}}


A5_CASES: dict[str, list[Heard]] = {
    # a.2
    "a probe": [Heard(a5(0x80, 0x02), 0)],
    "50": reply(0x50, "00007530 00000e10", {"setting.rated_capacity": 30000, "setting.cell_nominal_voltage": 3600}),
    "50, all ones": reply(
        0x50, "ffffffff ffffffff", {"setting.rated_capacity": 2**32 - 1, "setting.cell_nominal_voltage": 65535}
    ),
    "50, filling before the voltage": reply(
        0x50, "00007530 aaaa0e10", {"setting.rated_capacity": 30000, "setting.cell_nominal_voltage": 3600}
    ),
    "51": reply(
        0x51,
        "02 08 07 00 02 01 00 ff",
        {
            "setting.board_count": 2,
            "setting.cells_1": 8,
            "setting.cells_2": 7,
            "setting.cells_3": 0,
            "setting.sensors_1": 2,
            "setting.sensors_2": 1,
            "setting.sensors_3": 0,
        },
    ),
    "52": reply(0x52, "00000123 00010000", {"total.charged": 291, "total.discharged": 65536}),
    "53": reply(
        0x53,
        "01 02 1a0602 1c20 0b",
        {
            "setting.battery_type": 1,
            "setting.operating_mode": 2,
            "production_date": "2026-06-02",
            "setting.sleep": 7200,
            "setting.current_drift": 1.1,
        },
    ),
    "53 without a date": reply(
        0x53,
        "07 00 ffffff 0000 00",
        {
            "setting.battery_type": 7,
            "setting.operating_mode": 0,
            "setting.sleep": 0,
            "setting.current_drift": 0,
        },
    ),
    "53 with a date that no calendar has": reply(
        0x53,
        "00 01 00ff00 0000 00",
        {
            "setting.battery_type": 0,
            "setting.operating_mode": 1,
            "production_date": "2000-255-00",
            "setting.sleep": 0,
            "setting.current_drift": 0,
        },
    ),
    "54": reply(0x54, b"20220810".hex(), {"firmware_index": "20220810"}),
    "54, padded, and what can't be shown": reply(0x54, "41 07 42 00 20 ff 00 00", {"firmware_index": "A?B"}),
    "54, nothing": reply(0x54, "00 20 ff 00 20 ff 00 00", {}),
    "58 has no layout": reply(0x58, "1a0602", {}),
    "59": reply(0x59, "0e42 0e74 0af0 09c4", limits("cell", 3650, 3700, 2800, 2500)),
    "5A": reply(0x5A, "0248 0250 01c0 0190", limits("pack", 58.4, 59.2, 44.8, 40)),
    "5B": reply(
        0x5B,
        "7148 6f54 7918 7b0c",
        {
            "setting.charge_current_1": -100,
            "setting.charge_current_2": -150,
            "setting.discharge_current_1": 100,
            "setting.discharge_current_2": 150,
        },
    ),
    "5C": reply(0x5C, "5f 64 2d 28 69 6e 19 14", TEMPERATURES),
    "5D": reply(0x5D, "03e7 03e8 0064 0032", limits("soc", 99.9, 100, 10, 5)),
    "5E": reply(
        0x5E,
        "012c 01f4 0f 14 ffff",
        {
            "setting.cell_difference_1": 300,
            "setting.cell_difference_2": 500,
            "setting.temp_difference_1": 15,
            "setting.temp_difference_2": 20,
        },
    ),
    "5F": reply(0x5F, "0ed8 0032 1234", {"setting.balance_start": 3800, "setting.balance_difference": 50}),
    "60": reply(0x60, "0258 014d", {"setting.short_circuit_current": 600, "setting.shunt_raw": 333}),
    "61": reply(0x61, "1a 03 05 17 3b 09 ffff", {"clock": "2026-03-05 23:59:09"}),
    "61, not set": reply(0x61, "00 00 00 00 00 00 0102", {}),
    "64 is bytes": reply(0x64, "01 02 03", {}),
    "65": reply(0x65, "02 01 ff", {"setting.board_number": 2, "setting.acquisition_units": 1}),
    "66": reply(
        0x66, "28 ff 55 ff a5 01", {"setting.heater_start": 0, "setting.fan_start": 45, "setting.key_logic": 0xA5}
    ),
    "67": reply(0x67, "02", {"setting.balancer": True}),
    "67, off": reply(0x67, "00 01", {"setting.balancer": False}),
    "68": reply(0x68, "10 03e8", {"setting.series_count": 16, "setting.balance_current_raw": 1000}),
    "69": reply(0x69, "08 01", {"setting.inverter": 8, "setting.inverter_bus": 1}),
    "70": reply(
        0x70, "0e42 0064 0ddb 0001", alarm(1, "cell_high", value=3650, delay=1, recovery=3547, recovery_delay=0.01)
    ),
    "7A": reply(
        0x7A, "0af0 00c8 0b54 0000", alarm(2, "cell_low", value=2800, delay=2, recovery=2900, recovery_delay=0)
    ),
    "84": reply(
        0x84, "7918 0064 7148 00c8", alarm(3, "current", discharge=100, discharge_delay=1, charge=-100, charge_delay=2)
    ),
    "73 and its neighbour are temperatures of unknown layout": [
        Heard(a5(1, 0x73, "41464b50"), 0, alarm(1, "temp_high")),
        Heard(a5(1, 0x7D, "41464b50"), 1, alarm(2, "temp_low")),
    ],
    "75": reply(
        0x75, "0248 0064 0238 0064", alarm(1, "pack_high", value=58.4, delay=1, recovery=56.8, recovery_delay=1)
    ),
    "88": reply(0x88, "0190 0064 01c0 0064", alarm(3, "pack_low", value=40, delay=1, recovery=44.8, recovery_delay=1)),
    "77": reply(
        0x77, "012c 0064 00c8 0064", alarm(1, "cell_difference", value=300, delay=1, recovery=200, recovery_delay=1)
    ),
    "8A": reply(
        0x8A, "0014 0064 000f 0064", alarm(3, "temp_difference", value=20, delay=1, recovery=15, recovery_delay=1)
    ),
    "99": reply(0x99, "01 7594 07", {"balance.active": True, "balance.current_raw": 30100, "balance.position": 7}),
    "9A is bytes": reply(0x9A, "0064", {}),
    "D8": reply(
        0xD8,
        "00 01 00 ff 01 01",
        {
            "wakeup.key": False,
            "wakeup.button": True,
            "wakeup.rs485": False,
            "wakeup.can": True,
            "wakeup.current": True,
        },
    ),
    "what no table names": [
        Heard(a5(1, 0xAB, "01"), 0, {"unknown_id": True}),
        Heard(a5(0x40, 0x6B), 1, {"unknown_id": True}),
        Heard(a5(0x40, 0x0F), 1.1, {"unknown_id": True}),
        Heard(a5(0x40, 0x0F), 1.15, {"unknown_id": True}),
        Heard(a5(1, 0x01), 1.2, {"unknown_id": True, "unasked": True}),
        Heard(a5(1, 0x8B), 1.3, {"unknown_id": True, "unasked": True}),
        Heard(a5(1, 0xDB), 1.4, {"unknown_id": True, "unasked": True}),
    ],
    "requests of settings tell nothing": [Heard(a5(0x40, 0x50, "00007530"), 0), Heard(a5(0x40, 0x70, "01"), 0.1)],
    # a.3
    "00": write(0x00, "", {"command": "restart"}),
    "10": write(0x10, "000493e0 00000ce4", {"setting.rated_capacity": 300000, "setting.cell_nominal_voltage": 3300}),
    "10, filling before the voltage": write(
        0x10, "000493e0 aaaa0ce4", {"setting.rated_capacity": 300000, "setting.cell_nominal_voltage": 3300}
    ),
    "13": write(
        0x13,
        "02 01 000000 0708 00",
        {
            "setting.battery_type": 2,
            "setting.operating_mode": 1,
            "setting.sleep": 1800,
            "setting.current_drift": 0,
        },
    ),
    "14": write(0x14, b"20220810".hex(), {"firmware_index": "20220810"}),
    "19": write(0x19, "0e42 0e74 0af0 09c4", limits("cell", 3650, 3700, 2800, 2500)),
    "1C": write(0x1C, "5f 64 2d 28 69 6e 19 14", TEMPERATURES),
    "21": write(0x21, "1a 03 05 17 3b 09 03e8", {"clock": "2026-03-05 23:59:09", "setting.soc": 100}),
    "21 of a real program": [
        Heard(  # set-soc
            "a5402108160c0d151d27012cc3", 0, {"write": True, "clock": "2022-12-13 21:29:39", "setting.soc": 30}
        )
    ],
    "21 without a clock": write(0x21, "000000000000 01f4", {"setting.soc": 50}),
    "22 and 24 write bytes": [
        Heard(a5(0x40, 0x22, "0141"), 0, {"write": True}),
        Heard(a5(0x40, 0x24, "0141"), 0.1, {"write": True}),
    ],
    "29": write(0x29, "02 00", {"setting.inverter": 2, "setting.inverter_bus": 0}),
    "D9 and DA": [
        Heard(a5(0x40, 0xD9, "01"), 0, {"write": True, "setting.mos_discharge": True}),
        Heard(a5(1, 0xD9, h("01 0d130d210d17c0")), 0.05, {"setting.mos_discharge": True, "write_result": "confirmed"}),
        Heard(a5(0x40, 0xDA, "02"), 0.1, {"write": True, "setting.mos_charge": True}),
        Heard(a5(1, 0xDA, "00"), 0.15, {"setting.mos_charge": False, "write_result": "denied"}),
    ],
    "the reply to a write of settings is bytes": [
        Heard(
            a5(0x40, 0x1F, "0ed80032"),
            0,
            {"write": True, "setting.balance_start": 3800, "setting.balance_difference": 50},
        ),
        Heard(a5(1, 0x1F, "0ed80032"), 0.05, {"write_result": "confirmed"}),
    ],
    "an echo sets nothing": [
        Heard(a5(0x40, 0xD9, "01"), 0, {"write": True, "setting.mos_discharge": True}),
        Heard(a5(0x40, 0xD9, "01"), 0.05),
    ],
}
