# SPDX-License-Identifier: GPL-2.0-or-later
"""What Modbus frames mean to each other: sessions worked out by hand from docs/wires.md, section 1.

As tests/meaning.py: both readings run it, and a field of WATCHED that a case does not name must not be there.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tests.meaning import Heard, a5

if TYPE_CHECKING:
    from collections.abc import Mapping

_WATCHED = """
direction request_in unanswered unasked late_to other_board second_host retry write write_result
modbus.register modbus.count modbus.byte_count modbus.value modbus.exception modbus.ambiguous modbus.assumed
modbus.absent changed changed_from contradiction contradicts fault_raised fault_cleared fault_count
cell.voltage temperature cells.voltage cells.count sensors.temperature sensors.average soc state cell_count
sensor_count mos.charge mos.discharge setting.soc setting.mos_charge setting.mos_discharge setting.cell_high_1
setting.balancer clock command password software_version setting.sleep setting.balance_current
setting.rated_capacity uptime.total uptime.since_start balance.current
temperature.mos temperature.board temperature.heater
"""
_LIMITS = """
cell_high_2 cell_low_1 cell_low_2 pack_high_1 pack_high_2 pack_low_1 pack_low_2 charge_current_1 charge_current_2
discharge_current_1 discharge_current_2 charge_temp_high_1 charge_temp_high_2 charge_temp_low_1 charge_temp_low_2
discharge_temp_high_1 discharge_temp_high_2 discharge_temp_low_1 discharge_temp_low_2 cell_difference_1
cell_difference_2 temp_difference_1 temp_difference_2 soc_low_1 soc_low_2
"""
WATCHED = tuple(f"daly.{name}" for name in (*_WATCHED.split(), *(f"setting.{name}" for name in _LIMITS.split())))

_A5_HAS_TOO = {"daly.direction", "daly.request_in"}
"""Left out of what is watched on A5 frames, which tests/meaning.py and the tests of exchanges look at."""


def watched(dialect: object) -> list[str]:
    """Return what is looked at on a frame of a dialect."""
    return [name for name in WATCHED if dialect != "a5" or name not in _A5_HAS_TOO]


def rtu(text: str) -> str:
    """Add the CRC-16 of Modbus to a frame in hex."""
    body = bytes.fromhex(text)
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return (body + crc.to_bytes(2, "little")).hex()


def wire(frame: str) -> float:
    """How long a frame takes at 9600 baud, s."""
    return len(frame) // 2 * 10 / 9600


def words(*values: int) -> str:
    return "".join(f"{value:04x}" for value in values)


def read(register: int, count: int, address: int = 0xD2) -> str:
    return rtu(f"{address:02x}03" + words(register, count))


def brings(*values: int, address: int = 0xD2) -> str:
    return rtu(f"{address:02x}03{2 * len(values):02x}" + words(*values))


def one(register: int, value: int, address: int = 0xD2) -> str:
    return rtu(f"{address:02x}06" + words(register, value))


def many(register: int, *values: int, address: int = 0xD2, counted: bool = False) -> str:
    count = f"{2 * len(values):02x}" if counted else ""
    return rtu(f"{address:02x}10" + words(register, len(values)) + count + words(*values))


def taken(register: int, count: int, address: int = 0xD2) -> str:
    return rtu(f"{address:02x}10" + words(register, count))


def refused(function: int, code: int, address: int = 0xD2) -> str:
    return rtu(f"{address:02x}{function | 0x80:02x}{code:02x}")


def asks(register: int, count: int, at: float, address: int = 0xD2, **more: object) -> Heard:
    """A read request, and what it shows."""
    expect = {"direction": 1, "modbus.register": register, "modbus.count": count, **dotted(more)}
    return Heard(read(register, count, address), at, expect)


def told(
    values: list[int],
    at: float,
    register: int | None = None,
    request: int = 0,
    address: int = 0xD2,
    also: Mapping[str, object] | None = None,
    **more: object,
) -> Heard:
    """A read reply, where its registers are known to begin, which packet asked (0: none), and what it shows."""
    expect: dict[str, object] = {"direction": 2, "modbus.value": values, **dotted({**(also or {}), **more})}
    if register is not None:
        expect |= {"modbus.register": register, "modbus.count": len(values)}
    if request:
        expect["request_in"] = request
    return Heard(brings(*values, address=address), at, expect)


def dotted(names: Mapping[str, object]) -> dict[str, object]:
    """``modbus__value`` is modbus.value."""
    return {name.replace("__", "."): value for name, value in names.items()}


def writes(frame: str, register: int, value: int, at: float, **more: object) -> Heard:
    return Heard(
        frame, at, {"direction": 1, "write": True, "modbus.register": register, "modbus.value": value, **dotted(more)}
    )


def written(values: list[int], register: int, at: float, address: int = 0xD2, **more: object) -> Heard:
    """A write of many, and what it shows."""
    expect = {"direction": 1, "write": True, "modbus.register": register, "modbus.count": len(values)}
    return Heard(many(register, *values, address=address), at, expect | {"modbus.value": values} | dotted(more))


def echoes(frame: str, register: int, value: int, at: float, **more: object) -> Heard:
    return Heard(frame, at, {"direction": 2, "modbus.register": register, "modbus.value": value, **dotted(more)})


# D2 registers 28 to 3D (docs/protocol.md, d): volts, current, SOC, extremes, state, capacity, counts, switches, faults.
def pack_d2(
    *, soc: int = 500, state: int = 1, cells: int = 4, sensors: int = 1, charge: int = 1, discharge: int = 1
) -> list[int]:
    return [132, 30000, soc, 3300, 3300, 60, 60, state, 1000, cells, sensors, 7, 0, charge, discharge]


PACK_REGISTERS = 15
"""28 to 36."""

# 81 registers 130 to 167 as a real board told them, four each (warning, protection, return, delay), currents five.
# fmt: off
LIMITS = [
    3450, 3550, 3400, 5000, 2800, 2700, 2900, 5000, 552, 562, 542, 1000, 456, 440, 450, 1000,
    28400, 28000, 1000, 27000, 1000, 31600, 32000, 1000, 33000, 1000,
    90, 95, 90, 1000, 45, 40, 45, 1000, 90, 95, 90, 1000, 25, 40, 25, 1000,
    450, 500, 450, 1000, 10, 15, 12, 1000, 0, 0, 20, 1000, 135, 140,
]
# fmt: on
BALANCE: dict[str, object] = {"setting__balance_current": 1000}
LIMITS_TOLD = {
    "setting.cell_high_1": 3450,
    "setting.cell_high_2": 3550,
    "setting.cell_low_1": 2800,
    "setting.cell_low_2": 2700,
    "setting.pack_high_1": 55.2,
    "setting.pack_high_2": 56.2,
    "setting.pack_low_1": 45.6,
    "setting.pack_low_2": 44.0,
    "setting.charge_current_1": -160.0,
    "setting.charge_current_2": -200.0,
    "setting.discharge_current_1": 160.0,
    "setting.discharge_current_2": 200.0,
    "setting.charge_temp_high_1": 50,
    "setting.charge_temp_high_2": 55,
    "setting.charge_temp_low_1": 5,
    "setting.charge_temp_low_2": 0,
}
MORE_LIMITS_TOLD = {
    "setting.discharge_temp_high_1": 50,
    "setting.discharge_temp_high_2": 55,
    "setting.discharge_temp_low_1": -15,
    "setting.discharge_temp_low_2": 0,
    "setting.cell_difference_1": 450,
    "setting.cell_difference_2": 500,
    "setting.temp_difference_1": 10,
    "setting.temp_difference_2": 15,
    "setting.soc_low_1": 0.0,
    "setting.soc_low_2": 0.0,
}


def pack_told(at: float, request: int, *, values: list[int], **more: object) -> Heard:
    shown: dict[str, object] = {
        "soc": values[2] / 10,
        "state": values[7],
        "cell_count": values[9],
        "sensor_count": values[10],
        "mos__charge": bool(values[13]),
        "mos__discharge": bool(values[14]),
    }
    return told(values, at, 0x28, request, also={**shown, **more})


def pack_asked(at: float) -> Heard:
    return asks(0x28, PACK_REGISTERS, at)


def a5_pack(soc: int, address: int = 1) -> str:
    return a5(address, 0x90, f"00840000 7530{soc:04x}".replace(" ", ""))


# The registers 00 to 3D of a D2 board with 4 cells of 3300 mV and one sensor: 62, the least that can prove itself.
ALL_D2 = [
    *([3300] * 4 + [0] * 28),
    *([60] + [0] * 7),
    *(132, 30000, 500, 3300, 3300, 60, 60, 1, 1000, 4, 1, 7, 0, 1, 1),
    *(3300, 0, 0, 0, 0, 0, 0),
]
ALL_D2_SHOWN: dict[str, object] = {
    "cell__voltage": [3300] * 4,
    "temperature": 20,
    "cells__voltage": [3300] * 4,
    "cells__count": 4,
    "sensors__temperature": 20,
    "sensors__average": 20.0,
    "soc": 50.0,
    "state": 1,
    "cell_count": 4,
    "sensor_count": 1,
    "mos__charge": True,
    "mos__discharge": True,
    "fault_count": 0,
}
# The same of an 81 board, 00 to 3D.
ALL_81 = [3300] * 4 + [0] * 44 + [60] + [0] * 7 + [132, 30000, 500, 0, 4, 1]
ALL_81_SHOWN: dict[str, object] = {
    name: value
    for name, value in ALL_D2_SHOWN.items()
    if name not in {"state", "mos__charge", "mos__discharge", "fault_count"}
}


def changed(values: list[int], *changes: tuple[int, int]) -> list[int]:
    """Return the values with some of them, by index, replaced."""
    out = list(values)
    for at, value in changes:
        out[at] = value
    return out


LIMITS_D2 = [
    *(1000, 3200, 1, 4, 0, 0, 1, 0, 0, 0, 3600, 3500, 3600, 2800, 2600, 140, 144, 104, 100),
    *(29900, 29900, 30160, 30160, 85, 85, 40, 40, 110, 110, 39, 39, 255, 255, 255, 255, 3200, 20, 1, 0, 680, 87),
]
"""80 to A8."""
LIMITS_D2_TOLD = {
    "setting.rated_capacity": 100000,
    "setting.sleep": 3600,
    "setting.cell_high_1": 3500,
    "setting.cell_high_2": 3600,
    "setting.cell_low_1": 2800,
    "setting.cell_low_2": 2600,
    "setting.pack_high_1": 14.0,
    "setting.pack_high_2": 14.4,
    "setting.pack_low_1": 10.4,
    "setting.pack_low_2": 10.0,
    "setting.charge_current_1": -10.0,
    "setting.charge_current_2": -10.0,
    "setting.discharge_current_1": 16.0,
    "setting.discharge_current_2": 16.0,
    "setting.charge_temp_high_1": 45,
    "setting.charge_temp_high_2": 45,
    "setting.charge_temp_low_1": 0,
    "setting.charge_temp_low_2": 0,
    "setting.discharge_temp_high_1": 70,
    "setting.discharge_temp_high_2": 70,
    "setting.discharge_temp_low_1": -1,
    "setting.discharge_temp_low_2": -1,
    "setting.cell_difference_1": 255,
    "setting.cell_difference_2": 255,
    "setting.temp_difference_1": 255,
    "setting.temp_difference_2": 255,
}
WIFI_D2 = [*ALL_D2, 0, 0, 30000, 0, 65, 62, *[0] * 58]
"""00 to 7D, 126 registers, as the WiFi module asks for them (field notes d): no balance current, MOS 25 C."""
WIFI_D2_SHOWN = {"balance.current": 0, "temperature.mos": 25, "temperature.board": 22}
VERSION_D2 = [0x3130, 0x5F32, *[0] * 14, *[0] * 16]
"""A9 to C8: "10_2" as sent."""


CASES: dict[str, list[Heard]] = {
    # Direction and exchange
    "a read and its reply": [asks(0x0C, 1, 0), told([1], 0.05, 0x0C, 1, cell__voltage=1)],
    "81 asks, 51 answers": [
        asks(0x38, 3, 0, address=0x81),
        told([530, 30000, 864], 0.05, 0x38, 1, address=0x51, soc=86.4),
    ],
    "board 3 does not answer for board 1": [
        asks(0x38, 1, 0, address=0x81, unanswered=True),
        told([530], 0.05, address=0x53, unasked=True),
        asks(0x38, 1, 3, address=0x83),
    ],
    "D2 does not answer for 81": [
        asks(0x00, 1, 0, address=0x81, unanswered=True),
        told([3300], 0.05, unasked=True),
        asks(0x00, 1, 3, address=0x81),
    ],
    "replies alone complain of nothing": [
        told([1, 2], 0),
        Heard(taken(0xA5, 1), 1, {"direction": 2, "modbus.register": 0xA5, "modbus.count": 1}),
        Heard(refused(3, 2), 2, {"direction": 2, "modbus.exception": 2}),
        echoes(one(0x121, 1, 0x51), 0x121, 1, 3),
    ],
    "another count is another request": [
        asks(0x28, 2, 0, unanswered=True),
        told([132], 0.05, unasked=True),
        asks(0x28, 1, 3),
    ],
    "just in time": [asks(0x2A, 1, 0), told([500], wire(read(0, 1)) + 1, 0x2A, 1, soc=50.0)],
    "late: nobody knows which registers": [
        asks(0x2A, 1, 0, unanswered=True),
        told([500], wire(read(0, 1)) + 1.001, unasked=True, late_to=1),
        told([500], 3, unasked=True),
    ],
    "late, to the newest, whatever its register": [
        asks(0x2A, 1, 0, unanswered=True),
        asks(0x28, 1, 1.2, unanswered=True),
        told([500], 2.5, unasked=True, late_to=2),
        told([500], 9, unasked=True, late_to=1),
    ],
    "too late to be late": [
        asks(0x2A, 1, 0, unanswered=True),
        told([500], wire(read(0, 1)) + 10.001, unasked=True),
    ],
    "the capture ends while it waits": [asks(0x2A, 1, 0), asks(0x28, 1, 0.9)],
    "unanswered, found out by an A5 frame": [
        asks(0x2A, 1, 0, unanswered=True),
        Heard(a5(0x40, 0x90), wire(read(0, 1)) + 1.0001),
    ],
    "an A5 frame a second later: it waits no more, though the clock steps back": [
        asks(0x2A, 1, 0, unanswered=True),
        Heard(a5(1, 0x97), 2),
        told([500], 0.5, unasked=True, late_to=1),
    ],
    "no echoes, no retries": [
        asks(0x2A, 1, 0, unanswered=True),
        asks(0x2A, 1, 0.03),
        told([500], 0.1, 0x2A, 2, soc=50.0),
        asks(0x2A, 1, 2),
    ],
    "two reads of one length: the same registers": [
        asks(0x2A, 1, 0, unanswered=True),
        asks(0x2A, 1, 0.1),
        told([500], 0.2, 0x2A, 2, soc=50.0),
        asks(0x2A, 1, 1.5),
        told([400], 1.6, 0x2A, 4, soc=40.0),
    ],
    "two reads of one length: ambiguous": [
        asks(0x2A, 1, 0),
        asks(0x28, 1, 0.1),
        told([500], 0.2, modbus__ambiguous=True),
        told([132], 0.3, 0x28, 2),
        told([132], 3, unasked=True),
    ],
    "of three reads two answers are ambiguous": [
        asks(0x2A, 1, 0),
        asks(0x28, 1, 0.1),
        asks(0x2A, 1, 0.2),
        told([500], 0.3, modbus__ambiguous=True),
        told([132], 0.4, modbus__ambiguous=True),
        told([500], 0.5, 0x2A, 3, soc=50.0),
    ],
    "one of two is no longer waited for": [
        asks(0x2A, 1, 0, unanswered=True),
        asks(0x28, 1, 0.9),
        told([132], 1.5, 0x28, 2),
    ],
    "ambiguous replies assume nothing": [
        asks(0x00, 62, 0),
        asks(0x80, 62, 0.1),
        told(ALL_D2, 0.2, modbus__ambiguous=True),
    ],
    "a read of other registers is not in the way": [
        asks(0x2A, 1, 0),
        asks(0x28, 2, 0.1),
        told([500], 0.2, 0x2A, 1, soc=50.0),
        told([132, 30000], 0.3, 0x28, 2),
    ],
    # Exceptions
    "refused": [
        asks(0x0F00, 1, 0),
        Heard(refused(3, 2), 0.05, {"direction": 2, "modbus.exception": 2, "request_in": 1}),
        writes(one(0xA5, 1), 0xA5, 1, 1, setting__mos_charge=True),
        Heard(refused(6, 1), 1.05, {"direction": 2, "modbus.exception": 1, "request_in": 3, "write_result": "denied"}),
    ],
    "refused, which read is not known": [
        asks(0x0F00, 1, 0),
        asks(0x0F01, 2, 0.1),
        Heard(refused(3, 2), 0.2, {"direction": 2, "modbus.exception": 2, "modbus.ambiguous": True}),
        Heard(refused(3, 2), 0.3, {"direction": 2, "modbus.exception": 2, "request_in": 2}),
        Heard(refused(3, 2), 0.4, {"direction": 2, "modbus.exception": 2, "unasked": True}),
    ],
    "a write's refusal is none of a read": [
        asks(0x0F00, 1, 0, unanswered=True),
        Heard(refused(16, 2), 0.1, {"direction": 2, "modbus.exception": 2, "unasked": True}),
        asks(0x0F00, 1, 3),
    ],
    # Writes
    "write one, D2: the identical bytes are the reply": [
        writes(one(0xA5, 1), 0xA5, 1, 0, setting__mos_charge=True),
        echoes(one(0xA5, 1), 0xA5, 1, 0.05, request_in=1, write_result="confirmed"),
        writes(one(0xA6, 0), 0xA6, 0, 0.1, setting__mos_discharge=False),
        writes(one(0xA6, 1), 0xA6, 1, 0.15, setting__mos_discharge=True),
        echoes(one(0xA6, 0), 0xA6, 0, 0.2, request_in=4, write_result="denied"),
        echoes(one(0xA6, 0), 0xA6, 0, 0.25, request_in=3, write_result="confirmed"),
    ],
    "write one, D2: again, when it waits no longer": [
        writes(one(0xA5, 1), 0xA5, 1, 0, setting__mos_charge=True, unanswered=True),
        writes(one(0xA5, 1), 0xA5, 1, 1.1, setting__mos_charge=True),
    ],
    "write one, D2: the side decides": [
        Heard(
            one(0xA7, 500),
            0,
            {
                "direction": 1,
                "write": True,
                "modbus.register": 0xA7,
                "modbus.value": 500,
                "setting.soc": 50.0,
                "unanswered": True,
            },
            "inbound",
        ),
        Heard(
            one(0xA7, 500),
            0.05,
            {"direction": 1, "write": True, "modbus.register": 0xA7, "modbus.value": 500, "setting.soc": 50.0},
            "inbound",
        ),
        Heard(
            one(0xA7, 499),
            0.1,
            {
                "direction": 2,
                "modbus.register": 0xA7,
                "modbus.value": 499,
                "request_in": 2,
                "write_result": "denied",
            },
            "outbound",
        ),
        asks(0x28, 1, 3),
    ],
    "write one, D2: of another register the side says nothing": [
        Heard(
            one(0xA7, 500),
            0,
            {"direction": 1, "write": True, "modbus.register": 0xA7, "modbus.value": 500, "setting.soc": 50.0},
            "inbound",
        ),
        Heard(
            one(0xA5, 1),
            0.05,
            {"direction": 1, "write": True, "modbus.register": 0xA5, "modbus.value": 1, "setting.mos_charge": True},
            "outbound",
        ),
    ],
    "write one, 81": [
        writes(one(0x122, 0, 0x81), 0x122, 0, 0, setting__mos_discharge=False),
        echoes(one(0x122, 0, 0x51), 0x122, 0, 0.05, request_in=1, write_result="confirmed"),
        writes(one(0x116, 500, 0x82), 0x116, 500, 1, setting__soc=50.0),
        echoes(one(0x116, 400, 0x52), 0x116, 400, 1.05, request_in=3, write_result="denied"),
        echoes(one(0x116, 400, 0x52), 0x116, 400, 1.1, unasked=True),
    ],
    "81: sleep and balance current": [
        asks(0x115, 3, 0, 0x81),
        told([360, 805, 1000], 0.1, 0x115, 1, 0x51, also={"setting.sleep": 3600, "setting.soc": 80.5}, **BALANCE),
        asks(0x115, 1, 1, 0x81),
        told([0xFFFF], 1.1, 0x115, 3, 0x51, modbus__absent=0x115),  # never
        writes(one(0x115, 6552, 0x81), 0x115, 6552, 2, setting__sleep=65520),
        echoes(one(0x115, 6552, 0x51), 0x115, 6552, 2.05, request_in=5, write_result="confirmed"),
    ],
    "81: limits, of ess-rsp-0301000051 and ess-rsp-0301510027": [
        asks(0x130, 32, 0, 0x81),
        told(LIMITS[:32], 0.1, 0x130, 1, 0x51, also=LIMITS_TOLD),
        asks(0x150, 24, 1, 0x81),
        told(LIMITS[32:], 1.1, 0x150, 3, 0x51, also=MORE_LIMITS_TOLD),
    ],
    "81: the vendor's app sets the charge current": [
        Heard(
            "811001400002743073f02ca9",  # field notes d
            0,
            {
                "direction": 1,
                "write": True,
                "modbus.register": 0x140,
                "modbus.count": 2,
                "modbus.value": [0x7430, 0x73F0],
                "setting.charge_current_1": -25.6,
                "setting.charge_current_2": -32.0,
            },
        ),
    ],
    "write many": [
        Heard(
            "d21000d40003180b0709341cf7d8",  # the vendor's app, field notes d
            0,
            {
                "direction": 1,
                "write": True,
                "modbus.register": 0xD4,
                "modbus.count": 3,
                "modbus.value": [0x180B, 0x0709, 0x341C],
                "clock": "2024-11-07 09:52:28",
            },
        ),
        Heard(
            taken(0xD4, 3),
            0.05,
            {
                "direction": 2,
                "modbus.register": 0xD4,
                "modbus.count": 3,
                "request_in": 1,
                "write_result": "confirmed",
            },
        ),
        Heard(
            many(0xA5, 0, 1, counted=True),
            1,
            {
                "direction": 1,
                "write": True,
                "modbus.register": 0xA5,
                "modbus.count": 2,
                "modbus.byte_count": 4,
                "modbus.value": [0, 1],
                "setting.mos_charge": False,
                "setting.mos_discharge": True,
                "unanswered": True,
            },
        ),
        Heard(taken(0xA5, 1), 1.05, {"direction": 2, "modbus.register": 0xA5, "modbus.count": 1, "unasked": True}),
        asks(0x28, 1, 3),
    ],
    "the article's switch is cell 13": [
        writes("d206000c00019baa", 0x0C, 1, 0),
        echoes("d206000c00019baa", 0x0C, 1, 0.05, request_in=1, write_result="confirmed"),
    ],
    "commands, whatever the value": [
        writes(one(0xF0, 0), 0xF0, 0, 0, command="restart"),
        writes(one(0xF1, 0xFFFF), 0xF1, 0xFFFF, 0.1, command="shutdown"),
        Heard(
            many(0xF2, 1, 1),
            0.2,
            {
                "direction": 1,
                "write": True,
                "modbus.register": 0xF2,
                "modbus.count": 2,
                "modbus.value": [1, 1],
                "command": ["zero_current", "reset"],
            },
        ),
        writes(one(0xF0, 1, 0x81), 0xF0, 1, 0.3),
    ],
    "what a write can't set": [
        writes(one(0x8B, 3500), 0x8B, 3500, 0, setting__cell_high_1=3500),
        writes(one(0x2A, 500), 0x2A, 500, 0.2),
        writes(one(0xD4, 0x180B), 0xD4, 0x180B, 0.3),
        writes(one(0xCF, 1), 0xCF, 1, 0.4, setting__balancer=True),
        writes(one(0x97, 0xFFFF), 0x97, 0xFFFF, 0.5),  # no temperature has a high byte
        writes(one(0x115, 0xFFFF, 0x81), 0x115, 0xFFFF, 0.6),  # never, which is no time
    ],
    # That FFFF is no register is a board's answer (field notes d); who writes it means it.
    "FFFF is a value in a write": [
        writes(one(0xA5, 0xFFFF), 0xA5, 0xFFFF, 0, setting__mos_charge=True),
        writes(one(0xA7, 0xFFFF), 0xA7, 0xFFFF, 0.1, setting__soc=6553.5),
        writes(one(0x8B, 0xFFFF), 0x8B, 0xFFFF, 0.2, setting__cell_high_1=65535),
        written([0x0001, 0xFFFF], 0x109, 0.3, 0x81, setting__rated_capacity=131071),
        written([0xFFFF, 0xFFFF], 0x109, 0.4, 0x81, setting__rated_capacity=4294967295),
        written([0xFFFF, 0xFFFF], 0xCC, 0.5),  # a date of FF is none
        written([0x180B, 0x0709, 0xFFFF], 0xD4, 0.6, clock="2024-11-07 09:255:255"),  # as sent, no calendar is asked
    ],
    "a password": [
        asks(0xC9, 3, 0),
        told([0x3132, 0x3334, 0x3536], 0.05, 0xC9, 1, password="123456"),  # `sys-password`
        asks(0xC9, 3, 1),
        told([0x3100, 0xFFFF, 0xFFFF], 1.05, 0xC9, 3, password="1", modbus__absent=[0xCA, 0xCB]),
    ],
    # What the registers hold
    "registers that are not there": [
        asks(0x29, 3, 0),
        told([0xFFFF, 0xFFFF, 3300], 0.05, 0x29, 1, modbus__absent=[0x29, 0x2A]),
    ],
    # At rest a board tells 30000 (field notes d.1): 0 is none, not -30 A.
    "a balance current of 0 is none": [
        asks(0x40, 1, 0),
        told([0], 0.05, 0x40, 1),
        asks(0x40, 1, 0.1),
        told([30000], 0.15, 0x40, 3, balance__current=0),
        asks(0x40, 1, 0.2),
        told([1], 0.25, 0x40, 5, balance__current=-29999),
        asks(0x4E, 1, 0.3, 0x81),
        told([0], 0.35, 0x4E, 7, 0x51),
        asks(0x4E, 1, 0.4, 0x81),
        told([30100], 0.45, 0x4E, 9, 0x51, balance__current=100),
    ],
    # Raw 0 and raw FF are no sensor (field notes a.92, d.1).
    "MOS, board and heater without a sensor": [
        asks(0x42, 2, 0),
        told([0x00FF, 0x00FE], 0.05, 0x42, 1, temperature__board=214),
        asks(0x42, 2, 0.1),
        told([0, 0x00FF], 0.15, 0x42, 3),
        asks(0x42, 2, 0.2),
        told([1, 0x01FF], 0.25, 0x42, 5, temperature__mos=-39),
        asks(0x5A, 3, 0.3, 0x81),
        told([0x00FF, 64, 0x00FF], 0.35, 0x5A, 7, 0x51, temperature__board=24),
        asks(0x5A, 3, 0.4, 0x81),
        told([65, 0x00FF, 0], 0.45, 0x5A, 9, 0x51, temperature__mos=25),
    ],
    "there are no registers behind FFFF": [
        asks(0xFFFF, 2, 0, 0x81),
        told([0xFFFF, 0xFFFF], 0.05, 0xFFFF, 1, 0x51, modbus__absent=0xFFFF),
        asks(0xFFFE, 4, 0.1),
        told([0xFFFF, 1, 0xFFFF, 3300], 0.15, 0xFFFE, 3, modbus__absent=0xFFFE),
        asks(0xFFFF, 3, 0.2),  # cell 1 is not what follows
        told([1, 3300, 3301], 0.25, 0xFFFF, 5),
    ],
    # Of a u32 FFFF is one half: 0001 FFFF is 131071. Only where both read so is it not there.
    "numbers of two registers": [
        asks(0x109, 2, 0, 0x81),
        told([0x0001, 0xFFFF], 0.05, 0x109, 1, 0x51, setting__rated_capacity=131071),
        asks(0x109, 2, 0.1, 0x81),
        told([0xFFFF, 0x0001], 0.15, 0x109, 3, 0x51, setting__rated_capacity=4294901761),
        asks(0x109, 2, 0.2, 0x81),
        told([0xFFFF, 0xFFFF], 0.25, 0x109, 5, 0x51, modbus__absent=[0x109, 0x10A]),
        asks(0xA9, 4, 0.3, 0x81),
        told([0x0001, 0xFFFF, 0xFFFF, 0xFFFF], 0.35, 0xA9, 7, 0x51, uptime__total=131071, modbus__absent=[0xAB, 0xAC]),
        asks(0xAA, 2, 0.4, 0x81),  # two halves
        told([0xFFFF, 0x0001], 0.45, 0xAA, 9, 0x51, modbus__absent=0xAA),
        asks(0xA9, 4, 0.5, 0x81),
        told([0, 0xFFFF, 1, 0], 0.55, 0xA9, 11, 0x51, uptime__total=65535, uptime__since_start=65536),
        # A date or a clock is no number: FF is no month.
        asks(0x129, 2, 0.6, 0x81),
        told([0xFFFF, 0x0100], 0.65, 0x129, 13, 0x51, modbus__absent=0x129),
    ],
    "cells without a count: all, and no table": [
        asks(0x00, 3, 0),
        told([3300, 0, 3301], 0.05, 0x00, 1, cell__voltage=[3300, 0, 3301]),
    ],
    "cells with the count of an earlier reply": [
        asks(0x31, 1, 0),
        told([2], 0.05, 0x31, 1, cell_count=2),
        asks(0x00, 3, 0.1),
        told(
            [3300, 3302, 7],
            0.15,
            0x00,
            3,
            cell__voltage=[3300, 3302],
            cells__voltage=[3300, 3302],
            cells__count=2,
        ),
        asks(0x01, 2, 0.2),
        told([3302, 7], 0.25, 0x01, 5, cell__voltage=3302),
    ],
    "a count that can't be is ignored": [
        asks(0x31, 2, 0),
        told([2, 1], 0.05, 0x31, 1, cell_count=2, sensor_count=1),
        asks(0x31, 2, 0.1),
        told([49, 22], 0.15, 0x31, 3, cell_count=49, sensor_count=22),
        asks(0x31, 2, 0.2),
        told([0x0110, 0], 0.25, 0x31, 5, sensor_count=0),
        asks(0x00, 2, 0.3),
        told([1, 2], 0.35, 0x00, 7, cell__voltage=[1, 2], cells__voltage=[1, 2], cells__count=2),
        asks(0x20, 2, 0.4),
        told([60, 61], 0.45, 0x20, 9, temperature=20, sensors__temperature=20, sensors__average=20.0),
    ],
    "a cell that is not there: no table": [
        asks(0x31, 1, 0),
        told([3], 0.05, 0x31, 1, cell_count=3),
        asks(0x00, 3, 0.1),
        told([3300, 0xFFFF, 3302], 0.15, 0x00, 3, cell__voltage=[3300, 3302], modbus__absent=1),
    ],
    "sensors: 00 and FF keep their place, other words are none": [
        asks(0x32, 1, 0),
        told([3], 0.05, 0x32, 1, sensor_count=3),
        asks(0x20, 3, 0.1),
        told(
            [0, 0xFF, 60],
            0.15,
            0x20,
            3,
            temperature=[-40, 215, 20],
            sensors__temperature=[-40, 215, 20],
            sensors__average=20.0,
        ),
        asks(0x20, 3, 0.2),
        told([60, 0x0100, 62], 0.25, 0x20, 5, temperature=[20, 22]),
    ],
    "cells 33 to 48 of D2 lie apart": [
        asks(0x47, 2, 0),
        told([3300, 3301], 0.05, 0x47, 1, cell__voltage=[3300, 3301]),
        asks(0x31, 1, 0.1),
        told([33], 0.15, 0x31, 3, cell_count=33),
        asks(0x47, 2, 0.2),
        told([3300, 3301], 0.25, 0x47, 5, cell__voltage=3300),
    ],
    # Assumed
    "nobody asked yet: it proves itself": [
        told(ALL_D2, 0, 0, modbus__assumed=True, also=ALL_D2_SHOWN),
        asks(0x2A, 1, 1),
    ],
    "unasked: it proves itself": [
        asks(0x2A, 1, 0, unanswered=True),
        told(ALL_D2, 0.1, 0, modbus__assumed=True, unasked=True, also=ALL_D2_SHOWN),
        asks(0x2A, 1, 3),
    ],
    "61 registers are too few": [told(ALL_D2[:61], 0)],
    "more than 62": [told([*ALL_D2, 0xFFFF], 0, 0, modbus__assumed=True, modbus__absent=0x3E, also=ALL_D2_SHOWN)],
    # The WiFi module reads 126 (field notes d): 252 bytes, the most that a reply can hold.
    "126 registers, the most there are": [
        told(WIFI_D2, 0, 0, modbus__assumed=True, also={**ALL_D2_SHOWN, **WIFI_D2_SHOWN}),
        told(
            [*ALL_81, *[0] * 64],
            1,
            0,
            address=0x51,
            modbus__assumed=True,
            also={**ALL_81_SHOWN, "state": 0, "mos.charge": False, "mos.discharge": False},
        ),
    ],
    "what proves nothing": [
        told(changed(ALL_D2, (0x28, 134)), 0),  # 13.4 V against 13.200: 1.5 %
        told(changed(ALL_D2, (0x31, 0)), 1),
        told(changed(ALL_D2, (0x31, 33)), 2),
        told(changed(ALL_D2, (0x32, 9)), 3),
        told(changed(ALL_D2, (0x2A, 1001)), 4),
        told(changed(ALL_D2, (0x2F, 3)), 5),
        told([0] * 62, 6),
        told(changed([0] * 62, (0x31, 4)), 7),
    ],
    "proven within 1 %": [
        # 133 x 100 = 13300 against 13200: 0.76 %; against 13168: 132 * 100 > 13168; 13169: 131 * 100 <= 13169
        told(
            changed(ALL_D2, (0x28, 133), (3, 3268)),
            0,
        ),
        told(
            changed(ALL_D2, (0x28, 133), (3, 3269)),
            1,
            0,
            modbus__assumed=True,
            also={
                **ALL_D2_SHOWN,
                "cell__voltage": [3300, 3300, 3300, 3269],
                "cells__voltage": [3300, 3300, 3300, 3269],
            },
        ),
        # 10100 against 10000 is 1 % and no more
        told(
            changed(ALL_D2, (0x28, 101), *((cell, 2500) for cell in range(4))),
            2,
            0,
            modbus__assumed=True,
            also={**ALL_D2_SHOWN, "cell__voltage": [2500] * 4, "cells__voltage": [2500] * 4},
        ),
    ],
    "81 proves itself": [
        told(ALL_81, 0, 0, address=0x51, modbus__assumed=True, also=ALL_81_SHOWN),
        told(changed(ALL_81, (0x3C, 49)), 1, address=0x51),
        told(ALL_81[:61], 2, address=0x51),
    ],
    "the WiFi module asks for 126 at once": [
        Heard("d2030000007ed649", 0, {"direction": 1, "modbus.register": 0, "modbus.count": 126}),
        told(WIFI_D2, 0.3, 0, 1, also={**ALL_D2_SHOWN, **WIFI_D2_SHOWN}),
    ],
    "81 is not read as D2": [told(ALL_81, 0), told(ALL_D2, 1, address=0x51)],
    "limits prove themselves": [
        told(
            LIMITS_D2,
            0,
            0x80,
            also=LIMITS_D2_TOLD,
            modbus__assumed=True,
            setting__mos_charge=True,
            setting__mos_discharge=False,
            setting__soc=68.0,
        ),
    ],
    "limits that prove nothing": [
        told(LIMITS_D2[:40], 0),
        told([*LIMITS_D2, 0], 0.2),
        *(
            told(changed(LIMITS_D2, (at - 0x80, value)), 1 + at / 100)
            for at, value in (
                (0x82, 0),
                (0x82, 4),
                (0x89, 3),
                (0x8B, 2800),
                (0x8C, 2600),
                (0x8F, 104),
                (0x90, 100),
                (0xA5, 2),
                (0xA6, 2),
                (0xA7, 1001),
            )
        ),
        told(LIMITS_D2, 4, address=0x51),
    ],
    "texts prove themselves": [
        told(VERSION_D2, 0, 0xA9, modbus__assumed=True, software_version="2_01"),
        told(changed(VERSION_D2, (0, 0x3100)), 1),  # three letters
        told(changed(VERSION_D2, (9, 0x001F)), 2),
        told(VERSION_D2, 3, address=0x51),
    ],
    # Memory
    "what changed": [
        pack_asked(0),
        pack_told(0.05, 1, values=pack_d2()),
        pack_asked(1),
        pack_told(1.05, 3, values=pack_d2()),
        pack_asked(2),
        pack_told(
            2.05,
            5,
            values=pack_d2(state=2, charge=0, cells=8, sensors=2),
            changed=["state", "charge_mos", "cell_count", "sensor_count"],
            changed_from=4,
        ),
        pack_asked(3),
        pack_told(
            3.05,
            7,
            values=pack_d2(state=2, charge=0, discharge=0, cells=0, sensors=2),
            changed="discharge_mos",
            changed_from=6,
        ),
    ],
    "against the newest that had it": [
        asks(0x2F, 1, 0),
        told([1], 0.05, 0x2F, 1, state=1),
        asks(0x35, 2, 0.1),
        told([1, 1], 0.15, 0x35, 3, mos__charge=True, mos__discharge=True),
        asks(0x2F, 1, 0.2),
        told([0xFFFF], 0.25, 0x2F, 5, modbus__absent=0x2F),
        asks(0x2F, 8, 0.3),
        told(
            [0, 0, 0, 0, 0, 0, 1, 0],
            0.35,
            0x2F,
            7,
            state=0,
            cell_count=0,
            sensor_count=0,
            mos__charge=True,
            mos__discharge=False,
            changed=["state", "discharge_mos"],
            changed_from=4,
        ),
    ],
    "each address by itself": [
        asks(0x48, 1, 0, address=0x81),
        told([1], 0.05, 0x48, 1, address=0x51, state=1),
        asks(0x48, 1, 0.1, address=0x82),
        told([2], 0.15, 0x48, 3, address=0x52, state=2),
        asks(0x48, 1, 0.2, address=0x81),
        told([2], 0.25, 0x48, 5, address=0x51, state=2, changed="state", changed_from=2),
    ],
    "faults": [
        asks(0x3A, 4, 0),
        told([0x0001, 0, 0, 0], 0.05, 0x3A, 1, fault_count=1),
        asks(0x3A, 4, 0.1),
        told(
            [0x0100, 0x0080, 0, 0],  # byte 1 bit 0, byte 2 bit 7: `rab-status`, 3B = 0080
            0.15,
            0x3A,
            3,
            fault_count=2,
            fault_raised=["chg_temp_high_level_1", "soc_low_level_2"],
            fault_cleared="cell_volt_high_level_1",
            changed_from=2,
        ),
        asks(0x3A, 3, 0.2),
        told([0, 0, 0], 0.25, 0x3A, 5),
        asks(0x3A, 4, 0.3),
        told([0, 0, 0xFFFF, 0], 0.35, 0x3A, 7, modbus__absent=0x3C),
        asks(0x3A, 4, 0.4),
        told([0x0100, 0x0080, 0, 0x0700], 0.45, 0x3A, 9, fault_count=2),
    ],
    "changes and faults: since the newest": [
        asks(0x3A, 4, 0),
        told([1, 0, 0, 0], 0.05, 0x3A, 1, fault_count=1),
        asks(0x35, 1, 0.1),
        told([1], 0.15, 0x35, 3, mos__charge=True),
        asks(0x35, 9, 0.2),
        told(
            [0, 0, 0, 0, 0, 0, 0, 0, 0],
            0.25,
            0x35,
            5,
            mos__charge=False,
            mos__discharge=False,
            fault_count=0,
            fault_cleared="cell_volt_high_level_1",
            changed="charge_mos",
            changed_from=4,
        ),
    ],
    # SOC between the dialects
    "SOC: D2 against the only A5 board": [
        Heard(a5_pack(500), 0, {"soc": 50.0}),
        asks(0x2A, 1, 0.1),
        told([510], 0.15, 0x2A, 2, soc=51.0),
        asks(0x2A, 1, 0.2),
        told([511], 0.25, 0x2A, 4, soc=51.1, contradiction="soc", contradicts=1),
        Heard(a5_pack(500), 0.5, {"soc": 50.0, "contradiction": "soc", "contradicts": 5}),
        Heard(a5_pack(501), 0.6, {"soc": 50.1}),
    ],
    "SOC: D2, and two A5 boards": [
        Heard(a5_pack(500), 0, {"soc": 50.0}),
        Heard(a5(2, 0x97), 0.05),
        asks(0x2A, 1, 0.1),
        told([900], 0.15, 0x2A, 3, soc=90.0),
        Heard(a5_pack(500), 0.5, {"soc": 50.0}),
    ],
    "SOC: board 2 is 52": [
        Heard(a5_pack(500), 0, {"soc": 50.0}),
        Heard(a5_pack(700, 2), 0.05, {"soc": 70.0}),
        asks(0x3A, 1, 0.1, address=0x82),
        told([500], 0.15, 0x3A, 3, address=0x52, soc=50.0, contradiction="soc", contradicts=2),
        asks(0x3A, 1, 0.2, address=0x81),
        told([500], 0.25, 0x3A, 5, address=0x51, soc=50.0),
    ],
    "SOC: a 90 against the newest of 51 and D2": [
        asks(0x3A, 1, 0, address=0x81),
        told([500], 0.05, 0x3A, 1, address=0x51, soc=50.0),
        asks(0x2A, 1, 0.1),
        told([900], 0.15, 0x2A, 3, soc=90.0),
        Heard(a5_pack(500), 0.5, {"soc": 50.0, "contradiction": "soc", "contradicts": 4}),
        asks(0x3A, 1, 0.6, address=0x81),
        told([500], 0.65, 0x3A, 6, address=0x51, soc=50.0),
        Heard(a5_pack(500), 0.7, {"soc": 50.0}),
    ],
    "SOC: grown old": [
        Heard(a5_pack(500), 0, {"soc": 50.0}),
        asks(0x2A, 1, 10.01),
        told([900], 10.02, 0x2A, 2, soc=90.0),
    ],
    "SOC: of no board": [
        Heard(a5_pack(500, 0x11), 0, {"soc": 50.0}),
        asks(0x2A, 1, 0.1),
        told([900], 0.15, 0x2A, 2, soc=90.0),
        Heard(a5_pack(500, 0x00), 0.5, {"soc": 50.0}),
    ],
    "SOC: behind the other contradictions": [
        Heard(a5(1, 0x94, "0401"), 0, {"cell_count": 4, "sensor_count": 1}),
        Heard(a5(1, 0x95, "010ce40ce40ce4"), 0.1, {"cell.voltage": [3300] * 3}),
        Heard(
            a5(1, 0x95, "020ce4"),
            0.12,
            {"cell.voltage": 3300, "cells.voltage": [3300] * 4, "cells.count": 4},
        ),
        asks(0x2A, 1, 0.2),
        told([900], 0.25, 0x2A, 4, soc=90.0),
        Heard(
            a5(1, 0x90, "00900000753001f4"),
            0.5,
            {"soc": 50.0, "contradiction": ["pack_voltage", "soc"], "contradicts": [3, 5]},
        ),
    ],
}
