# SPDX-License-Identifier: GPL-2.0-or-later
"""0x98: every bit of the paper's table, typed off the paper once more, and what came and went."""

from __future__ import annotations

import pytest
from tests.dissector.dissection import Dissect, P, Row, a5, expert, in_a_row, info, number

# Paper V1.2, section 3, 0x98: a paragraph a byte, bit 0 first.
PAPER = """
cell_volt_high_level_1 cell_volt_high_level_2 cell_volt_low_level_1 cell_volt_low_level_2
sum_volt_high_level_1 sum_volt_high_level_2 sum_volt_low_level_1 sum_volt_low_level_2

chg_temp_high_level_1 chg_temp_high_level_2 chg_temp_low_level_1 chg_temp_low_level_2
dischg_temp_high_level_1 dischg_temp_high_level_2 dischg_temp_low_level_1 dischg_temp_low_level_2

chg_overcurrent_level_1 chg_overcurrent_level_2 dischg_overcurrent_level_1 dischg_overcurrent_level_2
soc_high_level_1 soc_high_level_2 soc_low_level_1 soc_low_level_2

diff_volt_level_1 diff_volt_level_2 diff_temp_level_1 diff_temp_level_2

chg_mos_temp_high dischg_mos_temp_high chg_mos_temp_sensor dischg_mos_temp_sensor
chg_mos_adhesion dischg_mos_adhesion chg_mos_open_circuit dischg_mos_open_circuit

afe_collect_chip voltage_collect_dropped cell_temp_sensor eeprom
rtc precharge communication internal_communication

current_module sum_voltage_detect short_circuit_protect low_volt_forbidden_chg
""".strip().split("\n\n")
BITS = [(byte, bit, name) for byte, names in enumerate(PAPER) for bit, name in enumerate(names.split())]
STATES = [(6, 4, "mos_off_by_command"), (6, 5, "charging_cabinet_offline")]  # field notes a.98


def faults(*bits: tuple[int, int], code: int = 0, address: int = 1) -> str:
    data = bytearray(8)
    for byte, bit in bits:
        data[byte] |= 1 << bit
    data[7] = code
    return a5(address, 0x98, data.hex())


@pytest.fixture(scope="module")
def each(dissect: Dissect) -> dict[str, Row]:
    """A reply for every bit of the seven bytes, the reserved ones too, each on a bus of its own."""
    places = [(byte, bit) for byte in range(7) for bit in range(8)]
    packets = [P(faults(place), index * 10.0, index) for index, place in enumerate(places)]
    rows = dissect(packets, descriptions=["dalyshark"] * len(places))
    return {f"{byte}.{bit}": row for (byte, bit), row in zip(places, rows, strict=True)}


def test_the_paper_has_48() -> None:
    assert len(BITS) == 48


@pytest.mark.parametrize(("byte", "bit", "name"), [*BITS, *STATES])
def test_a_bit_is_its_name_and_nothing_else(each: dict[str, Row], byte: int, bit: int, name: str) -> None:
    row = each[f"{byte}.{bit}"]
    set_ones = [one for _, _, one in BITS + STATES if number(row, f"fault.{one}") == 1]
    assert set_ones == [name]
    assert sum(f"daly.fault.{one}" in row for _, _, one in BITS + STATES) == 50
    assert number(row, "fault_count") == (0 if (byte, bit, name) in STATES else 1)
    assert info(row).endswith(f"Faults: {name}")
    assert ("Level 2" in expert(row)) is name.endswith("_level_2")


@pytest.mark.parametrize(("byte", "bit"), [(3, 4), (3, 7), (6, 6), (6, 7)])
def test_reserved_bits_are_no_fault(each: dict[str, Row], byte: int, bit: int) -> None:
    row = each[f"{byte}.{bit}"]
    assert number(row, "fault_count") == 0
    assert expert(row) == ""


def test_all_set(dissect: Dissect) -> None:
    row = dissect([P(a5(1, 0x98, "ff" * 8))])[0]
    assert number(row, "fault_count") == 48
    assert number(row, "fault_code") == 255


def test_raised_and_cleared_since_the_last_of_that_board(dissect: Dissect) -> None:
    rows = dissect(
        in_a_row(
            faults((0, 0)),
            faults((0, 0), (5, 3), address=2),  # another board: its first
            faults((0, 1), (6, 4)),
            faults(code=3),
        )
    )
    assert "daly.fault_raised" not in rows[0]
    assert "daly.fault_raised" not in rows[1]
    assert rows[2]["daly.fault_raised"] == ["cell_volt_high_level_2", "mos_off_by_command"]
    assert rows[2]["daly.fault_cleared"] == ["cell_volt_high_level_1"]
    assert "daly.fault_raised" not in rows[3]
    assert rows[3]["daly.fault_cleared"] == ["cell_volt_high_level_2", "mos_off_by_command"]
    assert number(rows[3], "fault_code") == 3
    assert "fault code 3" in info(rows[3])
