# SPDX-License-Identifier: GPL-2.0-or-later
"""From the wire to a decoded line and a verdict: a real client talks to the simulated bus, the real sniffer listens on
its tap, and what tshark shows with our dissector are the numbers that the client printed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from importlib.metadata import files
from typing import TYPE_CHECKING, Any

import pytest

from dalytools.comparison import compare
from dalytools.simulator.live import SimulatedBus
from dalytools.simulator.scenario import Board, Host, Pack, Scenario
from dalytools.tshark import Tshark

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

CLIENT = next(path.locate() for path in files("dalybms") or () if path.name == "daly-bms-cli")
SNIFFER = [sys.executable, "-c", "from dalytools.cli import entry; entry()", "capture"]


@pytest.fixture(scope="module")
def tshark() -> Iterator[Tshark]:
    with Tshark() as started:
        yield started


def shown(tshark: Tshark, capture: Path, which: str, *names: str) -> list[list[list[str]]]:
    """Values of some fields, a list each, in every packet that the filter takes."""
    words = ["-2", "-Y", which, "-r", str(tshark.readable(capture)), "-T", "fields", "-E", "aggregator=;"]
    words += [word for name in names for word in ("-e", f"daly.{name}")]
    lines = tshark.run(*words).stdout.decode().splitlines()
    return [[value.split(";") if value else [] for value in line.split("\t")] for line in lines]


@pytest.mark.parametrize(("cells", "sensors"), [(14, 2), (48, 8)])
def test_the_client_and_the_dissector_say_the_same(tshark: Tshark, tmp_path: Path, cells: int, sensors: int) -> None:
    pack = Pack(cells=cells, sensors=sensors, speed=0.0)  # stands still: the client asks for some things twice
    bus = SimulatedBus(Scenario(boards=(Board(1, pack=pack, faults=("soc_low_level_1",)),), host=Host(polls=False)))
    capture = tmp_path / "session.pcapng"
    sniffer = subprocess.Popen([*SNIFFER, bus.tap, "-w", str(capture)], stderr=subprocess.PIPE, text=True)
    assert sniffer.stderr is not None
    wait_until_it_listens(capture)
    with bus:
        client = subprocess.run(
            [sys.executable, str(CLIENT), "-d", bus.client, "--all"],
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
        )
        bus.linger(0.5)
        sniffer.send_signal(signal.SIGINT)
        messages = sniffer.communicate(timeout=10)[1]
    assert "good" in messages
    printed: dict[str, Any] = json.loads(client.stdout)

    [[voltage, current, soc], *_] = shown(tshark, capture, "daly.pack.voltage", "pack.voltage", "pack.current", "soc")
    assert [float(one[0]) for one in (voltage, current, soc)] == [
        printed["soc"][name] for name in ("total_voltage", "current", "soc_percent")
    ]
    [[table], *_] = shown(tshark, capture, "daly.cells.voltage", "cells.voltage")
    assert [int(value) / 1000 for value in table] == list(printed["cell_voltages"].values())
    [[high, high_at, low, low_at], *_] = shown(
        tshark,
        capture,
        "daly.cell.max_voltage",
        "cell.max_voltage",
        "cell.max_number",
        "cell.min_voltage",
        "cell.min_number",
    )
    extremes = printed["cell_voltage_range"]
    assert (int(high[0]) / 1000, int(high_at[0])) == (extremes["highest_voltage"], extremes["highest_cell"])
    assert (int(low[0]) / 1000, int(low_at[0])) == (extremes["lowest_voltage"], extremes["lowest_cell"])
    temperatures = [value for [row] in shown(tshark, capture, "daly.temperature", "temperature") for value in row]
    assert [int(value) for value in temperatures[:sensors]] == list(printed["temperatures"].values())
    [[state, charge, discharge, remaining], *_] = shown(
        tshark, capture, "daly.state", "state", "mos.charge", "mos.discharge", "remaining_capacity"
    )
    mosfet = printed["mosfet_status"]
    assert ["stationary", "charging", "discharging"][int(state[0])] == mosfet["mode"]
    assert [one[0] in ("1", "True") for one in (charge, discharge)] == [
        mosfet["charging_mosfet"],
        mosfet["discharging_mosfet"],
    ]
    assert int(remaining[0]) / 1000 == mosfet["capacity_ah"]
    [[count, sensor_count, cycles], *_] = shown(
        tshark, capture, "daly.cell_count", "cell_count", "sensor_count", "cycles"
    )
    status = printed["status"]
    assert [int(one[0]) for one in (count, sensor_count, cycles)] == [
        status[name] for name in ("cells", "temperature_sensors", "cycles")
    ]
    [[faults], *_] = shown(tshark, capture, "daly.fault_count", "fault_count")
    assert int(faults[0]) == len(printed["errors"]) == 1

    result = compare(tshark, capture)
    assert (result.found, set(result.kinds)) == (0, {"frame"})
    unanswered = shown(tshark, capture, "daly.direction == 1 && !daly.reply_in", "data_id")
    assert unanswered == []


def wait_until_it_listens(capture: Path) -> None:
    """The capture file gets its header when the port is open."""
    ready = threading.Event()
    for _ in range(500):
        if capture.exists() and capture.stat().st_size > 28:
            return
        ready.wait(0.02)
    pytest.fail("the sniffer did not start")
