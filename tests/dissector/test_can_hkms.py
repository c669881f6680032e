# SPDX-License-Identifier: GPL-2.0-or-later
"""CAN, HKMS dialect: docs/wires.md 2 and protocol.md c.2. No capture of it is public: made frames, values by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from tests.dissector.can_frames import SOCKETCAN, can, hkms, keep_alive, reply, request
from tests.dissector.dissection import DESTINATION, SOURCE, Dissect, P, Row, expert, info, kinds, number, numbers

if TYPE_CHECKING:
    from collections.abc import Sequence


@pytest.fixture
def see(dissect: Dissect) -> Dissect:
    def run(frames: Sequence[P], **more: Any) -> list[Row]:
        return dissect(frames, link_type=SOCKETCAN, descriptions=("can0",), **more)

    return run


CELLS = ("010cd00cd10cd200", "020cd30cd40cd500")
STATUS = "0402000228580003"  # 4 cells, 2 sensors, 0x00022858 = 141400 mAh, 3 cycles

#    register, bytes, field: value (by hand)
VALUES: list[tuple[int, str, dict[str, float]]] = [
    (
        0x0402,
        "020d759e03522a00",
        {"pack.voltage": 52.5, "pack.current": 11.0, "pack.current_raw": 30110, "soc": 85.0, "life": 42},
    ),
    (
        0x0403,
        "02410bb8413c5a07",
        {
            "power": 577,
            "energy": 3000,
            "temperature.mos": 25,
            "temperature.board": 20,
            "temperature.heater": 50,
            "heater.current": 7,
        },
    ),
    (
        0x0404,
        "0ce0010cd004 0010",
        {
            "cell.max_voltage": 3296,
            "cell.max_number": 1,
            "cell.min_voltage": 3280,
            "cell.min_number": 4,
            "cell.difference": 16,
        },
    ),
    (
        0x0405,
        "3e0221011d000000",
        {
            "temperature.max": 22,
            "temperature.max_number": 2,
            "temperature.min": -7,
            "temperature.min_number": 1,
            "temperature.difference": 29,
        },
    ),
    (0x0406, "0100010100000000", {"mos.charge": 1, "mos.discharge": 0, "mos.precharge": 1, "heater": 1, "fan": 0}),
    (0x0407, "0201010000000000", {"state": 2, "charger": 1, "load": 1}),
    (0x0408, STATUS, {"cell_count": 4, "sensor_count": 2, "remaining_capacity": 141400, "cycles": 3}),
    (0x040A, "010074cc05000080", {"balance.state": 1, "balance.current": -100, "balance.mask": 0x80000005}),
    (
        0x040B,
        "003c0a0000000000",
        {
            "time_to_full": 60,
            "wakeup.key": 0,
            "wakeup.button": 1,
            "wakeup.rs485": 0,
            "wakeup.can": 1,
            "wakeup.current": 0,
        },
    ),
    (0x040D, "017594006201f400", {"limit.active": 1, "limit.current": 10.0, "soh": 98, "limit.duty": 50.0}),
]


@pytest.mark.parametrize(("register", "data", "expected"), VALUES, ids=[f"{row[0]:04x}" for row in VALUES])
def test_values(see: Dissect, register: int, data: str, expected: dict[str, float]) -> None:
    row = see([keep_alive(), hkms(register, data.replace(" ", ""), board=3, at=0.1)])[1]
    assert kinds([row]) == ["frame"]
    assert row["daly.transport"] == ["can"]
    assert row["daly.dialect"] == ["hkms"]
    assert number(row, "can.register") == register
    assert (number(row, "can.priority"), number(row, "can.destination"), number(row, "can.source")) == (4, 0x80, 3)
    assert (number(row, "direction"), number(row, "board")) == (2, 3)
    assert row["daly.data"] == [data.replace(" ", "")]
    for name, value in expected.items():
        assert number(row, name) == pytest.approx(value, abs=1e-9), name
    if register == 0x040A:
        assert numbers(row, "balance.cell") == [1, 3, 32]


USUAL = {"kind", "transport", "dialect", "direction", "board", "data"}
HEAD = {"can.register", "can.priority", "can.destination", "can.source"}


def values(row: Row) -> set[str]:
    return {name[5:] for name in row if name.startswith("daly.")} - USUAL - HEAD


def test_the_clock_without_a_layout_is_bytes(see: Dissect) -> None:
    assert values(see([keep_alive(), hkms(0x040C, "0102030405060708", at=1)])[1]) == set()


@pytest.mark.parametrize(
    ("register", "data", "wanted"),
    [
        (0x0402, "020d759e03", set[str]()),
        (0x0402, "020d759e0352", {"pack.voltage", "pack.current", "pack.current_raw", "soc"}),
        (0x0403, "02410bb8413c5a", {"power", "energy", "temperature.mos", "temperature.board", "temperature.heater"}),
        (0x0404, "0ce0010cd00400", set[str]()),
        (0x0406, "010001", {"mos.charge", "mos.discharge", "mos.precharge"}),
        (0x0406, "01000101", {"mos.charge", "mos.discharge", "mos.precharge", "heater"}),
        (0x0407, "02", {"state"}),
        (0x0407, "0201", {"state", "charger"}),
        (0x0409, "00000000000000", set[str]()),
        (0x040B, "003c", {"time_to_full"}),
        (0x040D, "0175940062", set[str]()),
        (0x0400, CELLS[0][:14], set[str]()),
        (0x0408, "040200022858", set[str]()),
    ],
)
def test_short_frames_have_the_values_that_are_there(see: Dissect, register: int, data: str, wanted: set[str]) -> None:
    row = see([keep_alive(), hkms(register, data, at=0.1)])[1]
    assert kinds([row]) == ["frame"]
    assert values(row) == wanted


def test_a_frame_of_no_bytes(see: Dissect) -> None:
    row = see([keep_alive(), hkms(0x0408, "", at=0.3)])[1]
    assert kinds([row]) == ["frame"]
    assert "daly.data" not in row
    assert values(row) == set()


def test_the_fault_info(see: Dissect) -> None:
    """0409: byte 2 bit 7; byte 3 bits 4 and 7; byte 6 bits 0, 6, 7; byte 7 bit 1. Nothing is counted."""
    rows = see([keep_alive(), hkms(0x0409, "000080900000c102", at=0.1), hkms(0x0409, "00" * 8, at=0.2)])
    shown = {name[6:]: number(rows[1], name) for name in values(rows[1])}
    assert len(shown) == 50 + 8
    assert {name for name, value in shown.items() if value} == {
        *("soc_low_level_2", "mos_temp_high_level_1", "board_temp_high_level_2", "current_module"),
        *("thermal_runaway", "heating", "balance_condition"),
    }
    assert info(rows[1]) == (
        "Board 1  0x0409 Fault info: soc_low_level_2, current_module, mos_temp_high_level_1, board_temp_high_level_2, "
        "thermal_runaway, heating, balance_condition"
    )
    assert info(rows[2]) == "Board 1  0x0409 Fault info: none"
    assert not any(number(rows[2], name) for name in values(rows[2]))


def test_only_behind_a_keep_alive(see: Dissect) -> None:
    """Deye's frames have the same shape: before a keep-alive nobody knows, and nothing shows on a bus without Daly."""
    cells = hkms(0x0400, CELLS[0])
    rows = see([cells, can(0x0400FF80, "01" + "00" * 7), cells, reply(0x90, "00" * 8), cells, keep_alive(), cells])
    assert kinds(rows) == ["", "", "", "frame", "foreign", "frame", "frame"]
    assert rows[4]["daly.foreign"] == ["HKMS or Deye"]
    assert rows[4]["daly.undecoded"] == [CELLS[0]]
    assert number(rows[4], "can.source") == 1
    assert numbers(rows[6], "cell.voltage") == [3280, 3281, 3282]
    assert info(rows[5]) == "Keep-alive"
    assert (number(rows[5], "direction"), number(rows[5], "board")) == (1, None)
    assert (rows[5][SOURCE], rows[5][DESTINATION]) == (["Host 0x80"], ["All boards"])


def test_cells_are_put_together_between_frames_of_others(see: Dissect) -> None:
    rows = see(
        [
            keep_alive(),
            hkms(0x0408, STATUS, at=0.1),
            hkms(0x0400, CELLS[0], at=0.2),
            hkms(0x0400, CELLS[0], board=2, at=0.21),
            hkms(0x0402, "00" * 8, at=0.22),
            reply(0x95, CELLS[0], at=0.23),
            hkms(0x0401, "013d3b0000000000", at=0.24),
            hkms(0x0400, CELLS[1], at=0.25),
        ]
    )
    assert numbers(rows[2], "reassembled_in") == [8]
    assert numbers(rows[7], "cells.voltage") == [3280, 3281, 3282, 3283]
    assert numbers(rows[7], "cell.voltage") == [3283]
    assert rows[7]["daly.reserved"] == ["0cd40cd500"]
    assert numbers(rows[6], "sensors.temperature") == [21, 19]
    assert numbers(rows[3], "cell.voltage") == [3280, 3281, 3282]
    assert not any("daly.unasked" in row or "daly.data_id" in row for row in (*rows[:5], *rows[6:]))
    assert info(rows[7]).startswith("Board 1  0x0400 Cell voltages: frame 2  cell 4: 3283 mV  all 4")


def test_what_ends_a_burst(see: Dissect) -> None:
    """The same number again begins a new one; 0 and FF are skipped; a hole, and an end that does not come, are told."""
    page = ("%02x0cd00cd10cd200".__mod__(n) for n in (1, 1, 0, 255, 3, 1))
    frames = [hkms(0x0400, data, at=0.2 + i / 100) for i, data in enumerate(page)]
    rows = see([keep_alive(), hkms(0x0408, "0902" + "00" * 6, at=0.1), *frames, keep_alive(at=2)])
    assert [number(row, "burst.cut_off") for row in rows[2:8]] == [1, None, None, None, None, 1]
    assert [numbers(row, "burst.missing") for row in rows[2:8]] == [[], [], [], [], [2], []]
    assert not any("daly.burst.repeat" in row or "daly.cells.voltage" in row for row in rows)
    assert [len(numbers(row, "cell.voltage")) for row in rows[2:8]] == [3, 3, 0, 0, 3, 3]


def test_the_fault_block(see: Dissect) -> None:
    """Page 1 is its bytes 0 to 6, page 2 its bytes 7 to 13: one bit or level of each kind."""
    first = "01" + "a9" + "80" + "4b" + "00" + "40" + "88" + "bf"
    second = "02" + "0a" + "ff" * 3 + "81" + "48" + "80"
    rows = see(
        [keep_alive(), hkms(0x040E, first, at=0.1), hkms(0x040E, second, at=0.2), hkms(0x040E, "03" + "ff" * 7, at=0.3)]
    )
    one, two, three = rows[1:]
    levels = {name[11:]: int(one[name][0]) for name in one if name.startswith("daly.level.") and one[name] != ["0"]}
    # a9: 10 101 001; 80; 4b: 01 001 011; 40; 88: 10 001 000; bf: 10 111 111
    assert levels == {
        "cell_high": 1,
        "cell_low": 5,
        "charge_temp_low": 3,
        "discharge_temp_high": 1,
        "discharge_current": 1,
        "soc_low": 7,
        "soh_low": 7,
    }
    faults = {name[11:] for name in one if name.startswith("daly.fault.") and number(one, name[5:])}
    assert faults == {
        "smart_charger",
        "smart_discharger",
        "chg_mos_temp_high",
        "short_circuit_protect",
        "discharge_overvoltage",
        "parallel_communication",
    }
    assert (number(two, "level.mos_temp_high"), number(two, "level.thermal_runaway")) == (2, 1)
    faults = {name[11:] for name in two if name.startswith("daly.fault.") and number(two, name[5:])}
    assert faults == {"afe_collect_chip", "cell_temp_sensor", "rtc", "precharge_mos", "heating"}
    assert number(three, "frame_number") == 3
    assert not any(name.startswith(("daly.level.", "daly.fault")) for name in three)
    assert not any(name in row for row in rows for name in ("daly.fault_count", "daly.fault_raised"))
    assert info(two) == (
        "Board 1  0x040E Faults: page 2  mos_temp_high level 2, thermal_runaway level 1, "
        "afe_collect_chip, cell_temp_sensor, rtc, precharge_mos, heating"
    )


def test_writes(see: Dissect) -> None:
    """182A is also data ID 2A of the classic dialect: behind a keep-alive it is HKMS's."""
    charge = can(0x182A0280, "0001")
    rows = see(
        [
            request(0x90),
            charge,
            can(0x161E0180, "03e8" + "00" * 6, at=0.1),
            keep_alive(at=0.2),
            P(charge.hex, 0.3),
            can(0x182C0180, "0000", at=0.4),
            can(0x181E0180, "0001", at=0.5),
            can(0x182A0280, "00", at=0.6),
        ]
    )
    assert [row["daly.dialect"][0] for row in rows] == ["a5", "a5", "hkms", "hkms", "hkms", "hkms", "hkms", "hkms"]
    assert number(rows[2], "setting.soc") == 100.0
    assert (number(rows[4], "setting.mos_charge"), number(rows[4], "board"), number(rows[4], "direction")) == (1, 2, 1)
    assert number(rows[5], "setting.mos_discharge") == 0
    assert number(rows[6], "setting.soc") == 0.1
    assert "daly.setting.mos_charge" not in rows[7]
    assert [number(row, "write") for row in rows[2:]] == [1, None, 1, 1, 1, 1]
    assert not any("daly.write_result" in row or "daly.unanswered" in row for row in rows[2:])
    assert info(rows[4]) == "WRITE board 2  0x182A Charge MOS: switches the charge MOS on"
    assert "WRITE: switches the charge MOS on" in expert(rows[4])
    assert (rows[4][SOURCE], rows[4][DESTINATION]) == (["App 0x80"], ["Board 2"])
