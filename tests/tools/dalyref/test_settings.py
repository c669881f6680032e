# SPDX-License-Identifier: GPL-2.0-or-later
"""Replies and writes beside those of the paper: values that the field notes (a.2, a.3) and their sources state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.tools.dalyref import real

from dalyref import a5, alarms, payload, writes
from dalyref.decoder import decode
from dalyref.packet import Packet

if TYPE_CHECKING:
    from dalyref.values import Fields


def read(address: int, data_id: int, data: str) -> Fields:
    (decoded,) = decode([Packet(1, 0, a5.build(address, data_id, bytes.fromhex(data).ljust(8, b"\0")))])
    return decoded.fields


def told(fields: Fields) -> dict[str, object]:
    """Return what is beyond the header of a frame."""
    header = "kind transport dialect start address data_id length data checksum checksum.status direction board write"
    return {name: value for name, value in fields.items() if name not in {f"daly.{word}" for word in header.split()}}


def named(**values: object) -> dict[str, object]:
    return {f"daly.setting.{name}": value for name, value in values.items()}


FOUR = ("_high_1", "_high_2", "_low_1", "_low_2")

REPLIES: list[tuple[int, str, dict[str, object]]] = [
    # heezes (field notes a.2): 30000 mAh, 3600 mV
    (0x50, "00007530 00000e10", named(rated_capacity=30000, cell_nominal_voltage=3600)),
    (0x50, "000493e0 00010ce4", named(rated_capacity=300000, cell_nominal_voltage=3300)),
    (
        0x51,
        "02 10 08 07 04 03 02 ff",
        named(board_count=2, cells_1=16, cells_2=8, cells_3=7, sensors_1=4, sensors_2=3, sensors_3=2),
    ),
    (0x52, "00000102 00010000", {"daly.total.charged": 258, "daly.total.discharged": 65536}),
    # heezes: 01 01 16 08 0a ff ff 0a
    (
        0x53,
        "01 01 16 08 0a ff ff 0a",
        {
            **named(battery_type=1, operating_mode=1, sleep=65535, current_drift=1.0),
            "daly.production_date": "2022-08-10",
        },
    ),
    (0x53, "02 02 00 00 00 0e 10 03", named(battery_type=2, operating_mode=2, sleep=3600, current_drift=0.3)),
    (0x53, "00 00 ff ff ff 00 00 00", named(battery_type=0, operating_mode=0, sleep=0, current_drift=0.0)),
    (0x54, "3230323230383130", {"daly.firmware_index": "20220810"}),  # heezes
    (0x54, "41e9 2042 20 00 ff 20", {"daly.firmware_index": "A? B"}),
    (0x54, "00ff2000 00000020", {}),
    (0x59, "0e10 0e74 0af0 09c4", named(cell_high_1=3600, cell_high_2=3700, cell_low_1=2800, cell_low_2=2500)),
    (0x5A, "0240 0241 01c1 0003", named(pack_high_1=57.6, pack_high_2=57.7, pack_low_1=44.9, pack_low_2=0.3)),
    # ai-republic's log: 2400 and -2400 A; 7530 is 30000
    (
        0x5B,
        "1770 d2f0 7531 752f",
        named(charge_current_1=-2400.0, charge_current_2=2400.0, discharge_current_1=0.1, discharge_current_2=-0.1),
    ),
    (
        0x5C,
        "5d 5f 28 1e 6e 70 00 ff",
        named(
            charge_temp_high_1=53,
            charge_temp_high_2=55,
            charge_temp_low_1=0,
            charge_temp_low_2=-10,
            discharge_temp_high_1=70,
            discharge_temp_high_2=72,
            discharge_temp_low_1=-40,
            discharge_temp_low_2=215,
        ),
    ),
    (0x5D, "03e8 03e7 0064 0003", named(soc_high_1=100.0, soc_high_2=99.9, soc_low_1=10.0, soc_low_2=0.3)),
    # a difference of temperatures has no offset (matthewgream subtracts 40, wrong)
    (
        0x5E,
        "01f4 03e8 0a 0f ffff",
        named(cell_difference_1=500, cell_difference_2=1000, temp_difference_1=10, temp_difference_2=15),
    ),
    (0x5F, "0ed8 0032 1234 5678", named(balance_start=3800, balance_difference=50)),  # heezes
    (0x60, "0258 014d", named(short_circuit_current=600, shunt_raw=333)),  # heezes
    (0x61, "18 0b 07 09 34 1c ff ff", {"daly.clock": "2024-11-07 09:52:28"}),
    (0x61, "ff 64 ff 00 80 01", {"daly.clock": "20255-100-255 00:128:01"}),
    (0x61, "00 00 00 00 00 00 05", {}),
    (0x61, "ff ff ff ff ff ff 05", {}),
    (0x61, "00 00 00 00 00 01", {"daly.clock": "2000-00-00 00:00:01"}),
    (0x65, "03 02", named(board_number=3, acquisition_units=2)),
    (0x66, "23 ff 5a ff a5", named(heater_start=-5, fan_start=50, key_logic=0xA5)),
    (0x67, "01", named(balancer=True)),
    (0x67, "00 01", named(balancer=False)),
    (0x68, "10 0102", named(series_count=16, balance_current_raw=258)),
    (0x69, "08 01", named(inverter=8, inverter_bus=1)),
    (
        0x99,
        "01 7530 08",
        {"daly.balance.active": True, "daly.balance.current_raw": 30000, "daly.balance.position": 8},
    ),
    # kr-d8: byte 4 = 1
    (
        0xD8,
        "00 00 00 00 01",
        {
            "daly.wakeup.key": False,
            "daly.wakeup.button": False,
            "daly.wakeup.rs485": False,
            "daly.wakeup.can": False,
            "daly.wakeup.current": True,
        },
    ),
    (
        0xD8,
        "02 00 01 00 00 ff ff ff",
        {
            "daly.wakeup.key": True,
            "daly.wakeup.button": False,
            "daly.wakeup.rs485": True,
            "daly.wakeup.can": False,
            "daly.wakeup.current": False,
        },
    ),
]


@pytest.mark.parametrize(("data_id", "data", "expected"), REPLIES)
def test_replies(data_id: int, data: str, expected: dict[str, object]) -> None:
    found = told(read(1, data_id, data))
    assert found == expected
    assert {name: type(value) for name, value in found.items()} == {
        name: type(value) for name, value in expected.items()
    }


@pytest.mark.parametrize(("data_id", "data", "expected"), [row for row in REPLIES if 0x50 <= row[0] <= 0x6A])
def test_a_write_is_its_read_less_40(data_id: int, data: str, expected: dict[str, object]) -> None:
    write = data_id - 0x40
    if write != 0x21:  # the clock, and the SOC
        assert told(read(0x40, write, data)) == expected
    assert not told(read(0x01, write, data)), "how such a reply looks was never published"
    assert not told(read(0x40, data_id, data)), "a request for it says nothing"


# the grid of docs/protocol.md: ID, level, class, bytes, values
@pytest.mark.parametrize(
    ("data_id", "level", "name", "data", "values"),
    [
        (0x70, 1, "cell_high", "0e10 0064 0d7a 0001", (3600.0, 1.0, 3450.0, 0.01)),
        (0x71, 1, "cell_low", "0af0 00c8 0b54 0003", (2800.0, 2.0, 2900.0, 0.03)),
        (0x79, 2, "cell_high", "0e11 0065 0d7b 0002", (3601.0, 1.01, 3451.0, 0.02)),
        (0x75, 1, "pack_high", "0241 0064 0003 0001", (57.7, 1.0, 0.3, 0.01)),
        (0x88, 3, "pack_low", "01c1 0064 0003 0001", (44.9, 1.0, 0.3, 0.01)),
        (0x89, 3, "cell_difference", "01f4 0064 0190 0001", (500.0, 1.0, 400.0, 0.01)),
        (0x8A, 3, "temp_difference", "000a 0064 0005 0001", (10.0, 1.0, 5.0, 0.01)),
    ],
)
def test_alarm_grid(data_id: int, level: int, name: str, data: str, values: tuple[float, ...]) -> None:
    keys = ("value", "delay", "recovery", "recovery_delay")
    assert told(read(1, data_id, data)) == {
        "daly.alarm.level": level,
        "daly.alarm.class": name,
        **{f"daly.alarm.{key}": value for key, value in zip(keys, values, strict=True)},
    }
    assert type(read(1, data_id, data)["daly.alarm.value"]) is float


def test_alarm_of_current_and_of_temperature() -> None:
    assert told(read(1, 0x7B, "7bda 0064 6d60 0003")) == {  # 31706, 28000
        "daly.alarm.level": 2,
        "daly.alarm.class": "current",
        "daly.alarm.discharge": 170.6,
        "daly.alarm.discharge_delay": 1.0,
        "daly.alarm.charge": -200.0,
        "daly.alarm.charge_delay": 0.03,
    }
    for data_id, level, name in ((0x73, 1, "temp_high"), (0x7D, 2, "temp_low"), (0x86, 3, "temp_low")):
        assert told(read(1, data_id, "01020304")) == {"daly.alarm.level": level, "daly.alarm.class": name}
    assert not told(read(0x40, 0x70, "0e10")), "a request says nothing"


def test_switches() -> None:
    # fact 7: 01 is on; vicgwee's sniff of the vendor's tool, and payloads of replies with stale bytes behind
    for name, on in (("d9-on-req", True), ("d9-on-rsp", True), ("d9-off-req", False), ("d9-off-rsp", False)):
        (decoded,) = decode([Packet(1, 0, real.data(name))])
        assert told(decoded.fields) == {"daly.setting.mos_discharge": on}, name
    for name, on in (("mos-on-payload", True), ("mos-off-payload", False)):
        (decoded,) = decode([Packet(1, 0, real.data(name))])
        assert told(decoded.fields) == {"daly.setting.mos_discharge": on}, name
    assert told(read(0x40, 0xDA, "01")) == {"daly.setting.mos_charge": True}
    assert told(read(1, 0xDA, "00 01")) == {"daly.setting.mos_charge": False}
    assert told(read(1, 0xDA, "02")) == {"daly.setting.mos_charge": True}


def test_clock_and_soc() -> None:
    (decoded,) = decode([Packet(1, 0, real.data("set-soc"))])
    assert told(decoded.fields) == {"daly.clock": "2022-12-13 21:29:39", "daly.setting.soc": 30.0}
    assert decoded.fields["daly.write"] is True
    assert told(read(0x80, 0x21, "000000000000 03e7")) == {"daly.setting.soc": 99.9}


def test_other_writes() -> None:
    assert told(read(0x40, 0x00, "")) == {"daly.command": "restart"}
    (decoded,) = decode([Packet(1, 0, real.data("set-1f-try"))])
    assert told(decoded.fields) == named(balance_start=0x1668, balance_difference=0)
    for data_id in (0x15, 0x16, 0x17, 0x18, 0x22, 0x23, 0x24, 0x2A):  # texts, and what has no layout
        assert not told(read(0x40, data_id, "0102030405060708"))


def test_what_an_echo_and_a_damaged_write_ask_for_is_not_said() -> None:
    frame = a5.build(0x40, 0xD9, b"\x01" + bytes(7))
    damaged = frame[:-1] + bytes((frame[-1] ^ 1,))
    first, echo, bad = decode(
        [Packet(1, 0, frame), Packet(2, 30_000_000, frame), Packet(3, 2_000_000_000, damaged)],
    )
    assert told(first.fields) == {"daly.setting.mos_discharge": True, "daly.unanswered": True}
    assert not told(echo.fields)
    assert not told(bad.fields)


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 255), st.binary(min_size=8, max_size=8))
def test_nothing_is_too_odd(data_id: int, data: bytes) -> None:
    """Any eight bytes under any ID decode, and say no more than their table has."""
    fields = payload.decode(data_id, data)
    assert not (fields and data_id not in {*range(0x50, 0x6B), *alarms.IDS, *range(0x90, 0x9A), 0xD8, 0xD9, 0xDA})
    if writes.is_write(data_id):
        wanted = writes.would_set(data_id, data)
        assert all(name.startswith(("daly.setting.", "daly.total.")) for name in wanted) or data_id in {
            0x00,
            0x13,
            0x14,
            0x21,
        }
