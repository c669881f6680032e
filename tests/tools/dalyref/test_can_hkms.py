# SPDX-License-Identifier: GPL-2.0-or-later
"""HKMS on CAN: when it is read, every register, bursts side by side, the fault block (docs/wires.md, 2).

No capture of this dialect was ever published. Values are worked out by hand from field notes c.2.
"""

from __future__ import annotations

from typing import Any

import pytest
from tests.tools.dalyref.can import CanCapture

from dalyref.decoder import Decoder
from dalyref.packet import CanFrame

KEEP_ALIVE = ("0400FF80", "00" * 8)
PAGE_1, PAGE_2, PAGE_3 = "010ce40ce50ce600", "020ce70ce80ce900", "030cea0ceb0cec00"
"""Cells of 3300, 3301, 3302; 3303 ..; 3306 .. mV."""


def streaming() -> CanCapture:
    """A bus where the host keeps the boards alive: packet 1."""
    capture = CanCapture()
    capture.put(0, *KEEP_ALIVE)
    return capture


def told(identifier: str, data: str) -> dict[str, Any]:
    capture = streaming()
    number = capture.put(1, identifier, data)
    fields = capture.fields()[number]
    head = ("kind", "transport", "dialect", "can.", "data", "direction", "board")
    return {
        name.removeprefix("daly."): value
        for name, value in fields.items()
        if not name.removeprefix("daly.").startswith(head)
    }


@pytest.mark.parametrize(
    ("identifier", "data", "expected"),
    [
        ("04028001", "0214753202bcff00", {"pack.voltage": 53.2, "pack.current_raw": 30002, "pack.current": 0.2,
                                          "soc": 70.0, "life": 255}),
        ("04028001", "0214753202bc", {"pack.voltage": 53.2, "pack.current_raw": 30002, "pack.current": 0.2,
                                      "soc": 70.0}),
        ("04028001", "0214753202", {}),
        ("04038001", "012c00fa40422d03", {"power": 300, "energy": 250, "temperature.mos": 24, "temperature.board": 26,
                                          "temperature.heater": 5, "heater.current": 3}),
        ("04038001", "012c00fa4042", {"power": 300, "energy": 250, "temperature.mos": 24, "temperature.board": 26}),
        ("04048001", "0ce0030cde04000f", {"cell.max_voltage": 3296, "cell.max_number": 3, "cell.min_voltage": 3294,
                                          "cell.min_number": 4, "cell.difference": 15}),
        ("04048001", "0ce0030cde0400", {}),
        ("04058001", "3d023b0102000000", {"temperature.max": 21, "temperature.max_number": 2, "temperature.min": 19,
                                          "temperature.min_number": 1, "temperature.difference": 2}),
        ("04058001", "3d023b01", {"temperature.max": 21, "temperature.max_number": 2, "temperature.min": 19,
                                  "temperature.min_number": 1}),
        ("04068001", "0100020001000000", {"mos.charge": True, "mos.discharge": False, "mos.precharge": True,
                                          "heater": False, "fan": True}),
        ("04068001", "010002", {"mos.charge": True, "mos.discharge": False, "mos.precharge": True}),
        ("04078001", "0200010000000000", {"state": 2, "charger": 0, "load": 1}),
        ("04078001", "02", {"state": 2}),
        ("04088001", "10040002285800b6", {"cell_count": 16, "sensor_count": 4, "remaining_capacity": 141400,
                                          "cycles": 182}),
        ("040A8001", "0100759e05008001", {"balance.state": 1, "balance.current": 110, "balance.mask": 0x01800005,
                                          "balance.cell": [1, 3, 24, 25]}),
        ("040A8001", "0000753000000000", {"balance.state": 0, "balance.current": 0, "balance.mask": 0}),
        ("04098001", "00000000000000", {}),
        ("040B8001", "02d0150000000000", {"time_to_full": 720, "wakeup.key": True, "wakeup.button": False,
                                          "wakeup.rs485": True, "wakeup.can": False, "wakeup.current": True}),
        ("040B8001", "02d0", {"time_to_full": 720}),
        ("040C8001", "0102030405060708", {}),
        ("040D8001", "0074cc00630000", {"limit.active": False, "limit.current": -10.0, "soh": 99, "limit.duty": 0}),
        ("040D8001", "0174cc006300", {}),
        ("182A0180", "0001", {"write": True, "setting.mos_charge": True}),
        ("182A0180", "0000000000000000", {"write": True, "setting.mos_charge": False}),
        ("182C0140", "0001", {"write": True, "setting.mos_discharge": True}),
        ("161E0180", "0320", {"write": True, "setting.soc": 80.0}),
        ("181E1080", "02bc000000000000", {"write": True, "setting.soc": 70.0}),
        ("182A0180", "01", {"write": True}),
        ("04008001", "000ce40ce50ce600", {"frame_number": 0, "reserved": "0ce40ce50ce600"}),
        ("04008001", "ff0ce40ce50ce600", {"frame_number": 255, "reserved": "0ce40ce50ce600"}),
        ("04008001", "110ce40ce50ce600", {"frame_number": 17, "reserved": "0ce40ce50ce600"}),
        ("04018001", "043d3d3d3d3d3d3d", {"frame_number": 4, "reserved": "3d3d3d3d3d3d3d"}),
        ("040E8001", "0300000000000000", {"frame_number": 3}),
    ],
)  # fmt: skip
def test_registers(identifier: str, data: str, expected: dict[str, Any]) -> None:
    assert told(identifier, data) == expected


def test_head_of_a_frame() -> None:
    capture = streaming()
    capture.put(1, "04078003", "0200000000000000")
    capture.put(2, "182C0380", "0001")
    keep_alive, state, write = capture.fields().values()
    assert keep_alive == {
        "daly.kind": "frame", "daly.transport": "can", "daly.dialect": "hkms", "daly.direction": 1,
        "daly.can.priority": 4, "daly.can.destination": 0xFF, "daly.can.source": 0x80, "daly.can.register": 0x400,
        "daly.data": "00" * 8,
    }  # fmt: skip
    assert (state["daly.direction"], state["daly.board"], state["daly.can.register"]) == (2, 3, 0x407)
    assert (write["daly.direction"], write["daly.board"], write["daly.can.register"]) == (1, 3, 0x182C)
    assert write["daly.can.priority"] == 0x18


# Levels are three bits: 0x53 = 01 010 011, level 3, level 2, bit 6 set.
PAGE_ONE = {
    "level.cell_high": 3, "level.cell_low": 2, "fault.smart_charger": False,
    "level.cell_difference": 0, "level.charge_temp_high": 0, "fault.smart_discharger": True,
    "level.charge_temp_low": 3, "level.discharge_temp_high": 2, "fault.chg_mos_temp_high": True,
    "fault.chg_mos_temp_sensor": False, "level.discharge_temp_low": 0, "level.temp_difference": 1,
    "fault.dischg_mos_temp_high": False, "fault.dischg_mos_temp_sensor": True, "level.pack_high": 0,
    "level.pack_low": 0, "fault.short_circuit_protect": True, "level.charge_current": 7,
    "level.discharge_current": 7, "fault.charge_undervoltage": True, "fault.discharge_overvoltage": True,
    "level.soc_low": 1, "level.soh_low": 0, "fault.parallel_communication": False,
}  # fmt: skip
_BITS = (
    *("afe_collect_chip", "afe_communication", "afe_sampling", "voltage_detect", "voltage_collect_dropped"),
    *("sum_voltage_detect", "current_module", "cell_temp_sensor", "cell_temp_disconnected", "eeprom", "flash", "rtc"),
    *("chg_mos", "dischg_mos", "precharge_mos", "precharge", "heating"),
)
PAGE_TWO = {"level.mos_temp_high": 4, "level.thermal_runaway": 0} | {
    f"fault.{name}": name in ("afe_collect_chip", "cell_temp_sensor", "eeprom", "heating") for name in _BITS
}


def test_the_fault_block_has_two_pages() -> None:
    assert told("040E8001", "015380538840ff01") == {"frame_number": 1, **PAGE_ONE}
    assert told("040E8001", "02c4ffffff810280") == {"frame_number": 2, **PAGE_TWO}


def test_the_fault_info() -> None:
    """0409: byte 0 bit 0; byte 3 bits 2, 5, 6; byte 4 bit 7; byte 6 bits 3, 5, 6; byte 7 bit 0."""
    fields = told("04098001", "0100006480006801")
    assert len(fields) == 50 + 8
    assert {name for name, value in fields.items() if value} == {
        f"fault.{name}"
        for name in (
            *("cell_volt_high_level_1", "diff_temp_level_1", "mos_temp_high_level_2", "board_temp_high_level_1"),
            *("dischg_mos_open_circuit", "low_volt_forbidden_chg", "charging_cabinet_offline", "thermal_runaway"),
            "balance_communication",
        )
    }


def test_nothing_is_read_before_the_keep_alive() -> None:
    capture = CanCapture()
    capture.put(0, "04078001", "0200000000000000")
    capture.put(1, "182A0180", "0001")
    capture.put(2, "0400FF80", "00" * 7)  # not eight bytes
    capture.put(3, "0400FF80", "0000000000000001")
    capture.put(4, *KEEP_ALIVE)
    capture.put(5, "04078001", "0200000000000000")
    capture.put(6, "04078001", "0200000000000000", interface=1)
    assert capture.kinds() == {5: "hkms", 6: "hkms"}


def test_both_dialects_share_a_bus() -> None:
    capture = CanCapture()
    capture.put(0, "18904001", "01070000753002bc")
    capture.put(1, "04078001", "0200000000000000")
    capture.put(2, "181E0180", "02bc000000000000")
    capture.put(3, "161E0180", "02bc000000000000")
    capture.put(4, *KEEP_ALIVE)
    capture.put(5, "04078001", "0200000000000000")
    capture.put(6, "181E0180", "02bc000000000000")
    capture.put(7, "18904001", "01070000753002bc")
    capture.put(8, "18F00180", "00")
    assert list(capture.kinds().values()) == ["a5", "HKMS or Deye", "a5", "hkms", "hkms", "hkms", "hkms", "a5", "Deye"]


def test_others_are_named_once_the_keep_alive_was_seen() -> None:
    capture = streaming()
    capture.put(1, "351", "0000")
    capture.put(2, "00004210", "00")
    capture.put(3, "18500140", "00")  # classic, but none of its own was seen
    assert capture.kinds() == {1: "hkms", 2: "Victron/Pylontech", 3: "Pylontech-HV"}


def test_bursts_run_side_by_side() -> None:
    capture = streaming()
    capture.put(1, "04088001", "0801000000000000")  # 8 cells, 1 sensor
    capture.put(2, "04088002", "0401000000000000")  # board 2: 4 cells
    capture.put(10, "04008001", PAGE_1)
    capture.put(11, "04008002", PAGE_1)
    capture.put(12, "04078001", "00" * 8)
    capture.put(13, "04008001", PAGE_2)
    capture.put(14, "04018001", "013d000000000000")
    capture.put(15, "04008002", PAGE_2)
    capture.put(16, "04008001", PAGE_3)
    fields = capture.fields()
    assert fields[10]["daly.cells.voltage"] == [3300, 3301, 3302, 3303, 3304, 3305, 3306, 3307]
    assert fields[10]["daly.reserved"] == "0cec00"
    assert fields[9]["daly.cells.voltage"] == [3300, 3301, 3302, 3303]
    assert fields[8]["daly.sensors.temperature"] == 21
    assert [fields[n].get("daly.reassembled_in") for n in (4, 5, 7, 10)] == [10, 9, 10, None]
    assert not any("daly.burst.missing" in fields[n] or "daly.burst.cut_off" in fields[n] for n in fields)
    assert not any("daly.request_in" in fields[n] or "daly.unasked" in fields[n] for n in fields)


@pytest.mark.parametrize(
    ("counts", "cells"),
    [("0001000000000000", 8), ("3101000000000000", 8), ("3001000000000000", 48), ("0101000000000000", 1)],
)
def test_counts_that_can_not_be_are_ignored(counts: str, cells: int) -> None:
    capture = streaming()
    capture.put(1, "04088001", "0801000000000000")
    capture.put(2, "04088001", counts)
    capture.put(3, "04008001", PAGE_1)
    capture.put(4, "04008001", PAGE_2)
    capture.put(5, "04008001", PAGE_3)
    shown = [value for n in (4, 5, 6) for value in [capture.fields()[n].get("daly.cell.voltage", [])]]
    assert sum(len(value) if isinstance(value, list) else 1 for value in shown) == min(cells, 9)


def test_without_counts_the_last_frame_has_the_table() -> None:
    capture = streaming()
    capture.put(10, "04008001", PAGE_1)
    capture.put(11, "04008001", PAGE_2)
    capture.put(2000, "04008001", PAGE_1)
    fields = capture.fields()
    assert fields[3]["daly.cells.voltage"] == [3300, 3301, 3302, 3303, 3304, 3305]
    assert fields[2]["daly.reassembled_in"] == 3


def test_what_ends_a_burst() -> None:
    for later, page, ends in ((10, PAGE_3, False), (500, PAGE_3, False), (501, PAGE_3, True), (10, PAGE_2, True),
                              (10, PAGE_1, True)):  # fmt: skip
        capture = streaming()
        capture.put(1, "04088001", "0901000000000000")
        capture.put(10, "04008001", PAGE_1)
        capture.put(11, "04008001", PAGE_2)
        capture.put(11 + later, "04008001", page)
        fields = capture.fields()
        assert (fields[4].get("daly.burst.cut_off") is True) is ends
        assert ("daly.cells.voltage" in fields[5]) is not ends
        assert "daly.burst.repeat" not in fields[5]


def test_missing_pages() -> None:
    capture = streaming()
    capture.put(1, "04088001", "0901000000000000")
    capture.put(10, "04008001", PAGE_2)
    capture.put(20, "04008001", PAGE_1)
    capture.put(21, "04008001", PAGE_3)
    fields = capture.fields()
    assert [fields[n].get("daly.burst.missing") for n in (3, 4, 5)] == [1, None, 2]
    assert "daly.cells.voltage" not in fields[5]


def test_nothing_is_remembered_but_counts() -> None:
    capture = streaming()
    capture.put(1, "04078001", "00" * 8)
    capture.put(2, "04078001", "0200000000000000")
    capture.put(3, "04028001", "0214753202bc0000")
    capture.put(4, "040E8001", "0100000000000000")
    capture.put(5, "040E8001", "0140000000000000")
    for fields in capture.fields().values():
        assert not {"daly.changed", "daly.pack.state", "daly.fault_raised", "daly.fault_count"} & fields.keys()


def test_memory_stays_bounded() -> None:
    decoder = Decoder()
    decoder.feed(CanFrame(number=1, time_ns=0, data=bytes(8), identifier=0x0400FF80))
    out = 0
    for number in range(2, 20_000):
        identifier = 0x04000000 | (number % 2) << 16 | number % 256 << 8 | number % 16 + 1
        data = bytes((1,)) + bytes(7)
        out += len(decoder.feed(CanFrame(number=number, time_ns=number * 10**6, data=data, identifier=identifier)))
    assert out > 17_000
