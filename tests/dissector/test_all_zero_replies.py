# SPDX-License-Identifier: GPL-2.0-or-later
"""A 0x93 or 0x90 of eight zero bytes tells no load (docs/records.md 11): two voltages are compared as without it."""

from __future__ import annotations

import pytest
from tests.dissector.dissection import Dissect, P, Row, a5, number
from tests.dissector.test_bursts import cells, status

COUNT = status(3, 1)
THREE = cells(1, 3300, 3310, 3320)
NEAR = a5(1, 0x91, "0d0c030ce401")  # 3340 mV (cell 3), 3300 mV (cell 1)
FAR = a5(1, 0x91, "0d20030ce401")  # 3360 mV (cell 3): 40 mV from the highest of the table
ZERO_90, ZERO_93 = a5(1, 0x90), a5(1, 0x93)

NO_CURRENT = a5(1, 0x90, "0063000075300200")  # 9.9 V as the cells have it, 0 A, 51.2 %
TEN_AMPERES = a5(1, 0x90, "0063000075940200")  # 10 A: raw 30100
STATIONARY = a5(1, 0x93, "00010150")
CHARGING, DISCHARGING = a5(1, 0x93, "01010150"), a5(1, 0x93, "02010150")


CASES: dict[str, tuple[list[str], list[str]]] = {
    # name: (frames behind the 0x94, contradictions of the last)
    "within 20 mV": ([THREE, NEAR], []),
    "beyond 20 mV": ([THREE, FAR], ["cell_max"]),
    # Zeros at one of the two moments hide no contradiction.
    "state, zeros between": ([DISCHARGING, THREE, ZERO_93, FAR], ["cell_max"]),
    "zeros, state between": ([ZERO_93, THREE, DISCHARGING, FAR], ["cell_max"]),
    "state, zeros, the state between": ([DISCHARGING, ZERO_93, THREE, DISCHARGING, FAR], ["cell_max"]),
    "current, zeros between": ([TEN_AMPERES, THREE, ZERO_90, FAR], ["cell_max"]),
    "zeros, current between": ([ZERO_90, THREE, TEN_AMPERES, FAR], ["cell_max"]),
    "current, zeros, the current between": ([TEN_AMPERES, ZERO_90, THREE, TEN_AMPERES, FAR], ["cell_max"]),
    "both, zeros of both between": ([CHARGING, TEN_AMPERES, THREE, ZERO_93, ZERO_90, FAR], ["cell_max"]),
    "zeros of another board": ([DISCHARGING, THREE, a5(2, 0x93), a5(2, 0x90), FAR], ["cell_max"]),
    # What was known before them stays: the load changed.
    "another state": ([DISCHARGING, THREE, CHARGING, FAR], []),
    "stationary is a state": ([DISCHARGING, THREE, STATIONARY, FAR], []),
    "state and zeros, another state": ([DISCHARGING, ZERO_93, THREE, STATIONARY, FAR], []),
    "state, another and zeros": ([DISCHARGING, THREE, CHARGING, ZERO_93, FAR], []),
    "another current": ([TEN_AMPERES, THREE, NO_CURRENT, FAR], []),
    "current and zeros, another current": ([TEN_AMPERES, ZERO_90, THREE, NO_CURRENT, FAR], []),
    "current, another and zeros": ([TEN_AMPERES, THREE, NO_CURRENT, ZERO_90, FAR], []),
    "not all zero: state": ([DISCHARGING, THREE, a5(1, 0x93, "0000000000000001"), FAR], []),
    "not all zero: current": ([TEN_AMPERES, THREE, a5(1, 0x90, "0000000000000001"), FAR], []),
}


@pytest.fixture(scope="module")
def lasts(dissect: Dissect) -> dict[str, Row]:
    """The last record of every case, all cases in one capture, each on an interface of its own."""
    packets: list[P] = []
    ends: list[int] = []
    for interface, (frames, _) in enumerate(CASES.values()):
        packets += [P(frame, 10 * interface + 0.05 * place, interface) for place, frame in enumerate((COUNT, *frames))]
        ends.append(len(packets) - 1)
    rows = dissect(packets, descriptions=["dalyshark"] * len(CASES))
    return {name: rows[end] for name, end in zip(CASES, ends, strict=True)}


@pytest.mark.parametrize("name", CASES)
def test_contradictions(lasts: dict[str, Row], name: str) -> None:
    assert lasts[name].get("daly.contradiction", []) == CASES[name][1]


def test_the_state_itself_is_shown_as_it_came(dissect: Dissect) -> None:
    """What changed, and the state beside a current, are of the newest 0x93, zeros or not."""
    rows = dissect([P(frame, 0.05 * at) for at, frame in enumerate([DISCHARGING, ZERO_93, NO_CURRENT, DISCHARGING])])
    assert rows[1]["daly.changed"] == ["state", "charge_mos", "discharge_mos"]
    assert number(rows[2], "pack.state") == 0
    assert rows[3]["daly.changed"] == ["state", "charge_mos", "discharge_mos"]
