# SPDX-License-Identifier: GPL-2.0-or-later
"""The simulated battery: plausible, consistent, and the same each time."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dalytools.simulator.battery import Battery
from dalytools.simulator.faults import FAULT_BITS, fault_payload
from dalytools.simulator.scenario import Board, Event, Pack, Phase, Scenario


def still(**values: object) -> Pack:
    """A pack without chance: no ripple, all cells alike."""
    return Pack(ripple=0.0, spread=0.0, **values)  # pyright: ignore[reportArgumentType]


@given(cells=st.integers(1, 48), sensors=st.integers(1, 21), soc=st.floats(0, 100), seed=st.text(max_size=5))
@settings(max_examples=40, deadline=None)
def test_readings_are_consistent_and_plausible(cells: int, sensors: int, soc: float, seed: str) -> None:
    battery = Battery(Pack(cells=cells, sensors=sensors, start_soc=soc), seed)
    for _ in range(20):
        battery.advance(60.0)
        reading = battery.reading
        assert len(reading.cells_mv) == cells
        assert len(reading.sensors_c) == sensors
        assert all(2300 <= millivolts <= 3800 for millivolts in reading.cells_mv)
        assert abs(reading.pack_dv * 100 - sum(reading.cells_mv)) <= 50
        assert 0 <= reading.soc_permille <= 1000
        assert abs(reading.remaining_mah / 100 - reading.soc_permille) <= 1  # 100 Ah pack
        assert reading.state == (1 if reading.current_da > 0 else 2 if reading.current_da < 0 else 0)
        assert reading.balance_mask < 1 << cells
        assert all(10 <= degrees <= 40 for degrees in reading.sensors_c)


def test_charge_is_counted() -> None:
    """Half an hour at -20 A takes 10 Ah of 100 Ah: 60 % becomes 50 %, 60000 mAh become 50000."""
    battery = Battery(still(start_soc=60.0, profile=(Phase(-20.0, 7200),)), "")
    before = battery.reading
    for _ in range(1800):
        battery.advance(1.0)
    after = battery.reading
    assert (before.soc_permille, before.remaining_mah) == (600, 60000)
    assert (after.soc_permille, after.remaining_mah) == (500, 50000)
    assert after.current_da == -200


def test_cell_voltage_is_open_circuit_plus_current_times_resistance() -> None:
    """At 60 % an LFP cell rests at 3.304 V; 0.6 milliohm (100 Ah) at -50 A takes 30 mV off, at +50 A adds it."""
    volts = [
        Battery(still(cells=1, start_soc=60.0, profile=(Phase(amperes, 60),)), "").reading.cells_mv[0]
        for amperes in (-50.0, 0.0, 50.0)
    ]
    assert volts == [3274, 3304, 3334]


def test_voltage_rises_with_charge() -> None:
    volts = [Battery(still(cells=1, start_soc=soc, profile=()), "").reading.cells_mv[0] for soc in range(101)]
    assert volts == sorted(volts)
    assert volts[0] == 2500
    assert volts[100] == 3560


def test_profile_turns_and_limits_end_a_phase() -> None:
    pack = still(profile=(Phase(-30.0, 10), Phase(0.0, 10), Phase(30.0, 10)))
    battery = Battery(pack, "")
    seen: list[int] = []
    for _ in range(30):
        seen.append(battery.reading.state)
        battery.advance(1.0)
    assert [state for i, state in enumerate(seen) if i == 0 or seen[i - 1] != state] == [2, 0, 1]
    full = Battery(still(start_soc=100.0, profile=(Phase(100.0, 3600), Phase(-10.0, 3600))), "")
    full.advance(10.0)
    assert full.reading.state == 2  # a full cell ends the charge at once


def test_high_cells_are_balanced_while_charging_only() -> None:
    battery = Battery(Pack(cells=8, start_soc=98.5, spread=0.01, profile=(Phase(5.0, 3600),)), "high")
    cells, mask = battery.reading.cells_mv, battery.reading.balance_mask
    assert max(cells) >= 3400
    assert mask
    for cell, millivolts in enumerate(cells):
        assert bool(mask >> cell & 1) == (millivolts >= 3400 and millivolts > min(cells) + 5)
    discharging = Battery(Pack(cells=8, start_soc=98.5, spread=0.01, profile=(Phase(-0.5, 3600),)), "high")
    assert discharging.reading.balance_mask == 0


def test_cell_too_low_is_a_fault_and_stops_the_discharge() -> None:
    battery = Battery(still(start_soc=0.0, profile=(Phase(0.0, 3600),)), "")
    reading = battery.reading
    assert {"cell_volt_low_level_1", "cell_volt_low_level_2", "soc_low_level_2"} <= reading.faults
    assert not reading.discharge_mos
    assert reading.charge_mos


def test_fault_clears_some_way_back_from_its_limit() -> None:
    """soc_low level 1: raised at 10 %, cleared above 12 %."""
    battery = Battery(still(start_soc=10.5, profile=(Phase(-36.0, 60), Phase(36.0, 3600))), "")
    raised: list[tuple[float, bool]] = []
    for _ in range(400):
        battery.advance(1.0)
        raised.append((battery.reading.remaining_mah / 1000, "soc_low_level_1" in battery.reading.faults))
    assert not raised[0][1]
    assert [now for _, now in raised].count(True) > 100
    last = max(i for i, (_, now) in enumerate(raised) if now)
    assert raised[last][0] < 12.02
    assert raised[last + 1][0] >= 12.0


def test_mos_off_by_command_stops_the_current_and_shows() -> None:
    battery = Battery(still(profile=(Phase(-10.0, 3600),)), "")
    battery.discharge_mos = False
    battery.refresh()
    battery.refresh()
    assert battery.reading.current_da == 0
    assert not battery.reading.discharge_mos
    assert "mos_off_by_command" in battery.reading.faults
    assert battery.reading.fault_bytes[6] == 0x10  # field notes a.1: byte 6 bit 4, capture cpy-98


@pytest.mark.parametrize(
    ("name", "byte", "bit"),
    [  # read off the paper, section 3, 0x98
        ("cell_volt_high_level_1", 0, 0),
        ("cell_volt_low_level_2", 0, 3),
        ("sum_volt_low_level_2", 0, 7),
        ("chg_temp_low_level_1", 1, 2),
        ("dischg_temp_high_level_1", 1, 4),
        ("chg_overcurrent_level_2", 2, 1),
        ("soc_high_level_1", 2, 4),
        ("diff_volt_level_1", 3, 0),
        ("diff_temp_level_2", 3, 3),
        ("chg_mos_temp_high", 4, 0),
        ("dischg_mos_open_circuit", 4, 7),
        ("eeprom", 5, 3),
        ("internal_communication", 5, 7),
        ("current_module", 6, 0),
        ("low_volt_forbidden_chg", 6, 3),
    ],
)
def test_fault_bits(name: str, byte: int, bit: int) -> None:
    payload = fault_payload({name}, code=3)
    assert payload[7] == 3
    assert payload[byte] == 1 << bit
    assert sum(map(bool, payload)) == 2


def test_there_are_48_faults_and_two_states() -> None:
    """8 + 8 + 8 + 4 + 8 + 8 + 4 = 48, and field notes' two more in byte 6."""
    assert len(FAULT_BITS) == 50
    assert len(set(FAULT_BITS.values())) == 50


@pytest.mark.parametrize(
    "make",
    [
        lambda: Pack(cells=0),
        lambda: Pack(cells=49),
        lambda: Pack(sensors=22),
        lambda: Pack(start_soc=101),
        lambda: Board(0),
        lambda: Board(17),
        lambda: Board(faults=("broken",)),
        lambda: Scenario(boards=(Board(1), Board(1))),
        lambda: Scenario(events=(Event(1.0, "wake", board=2),)),
    ],
)
def test_impossible_scenarios_are_refused(make: object) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        make()  # pyright: ignore[reportCallIssue, reportUnknownVariableType]
