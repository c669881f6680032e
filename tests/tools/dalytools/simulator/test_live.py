# SPDX-License-Identifier: GPL-2.0-or-later
"""The simulated bus on pseudo-terminals, with real programs on it: the PyPI client dalybms, and a reader of the tap."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import threading
import time
from importlib.metadata import files
from pathlib import Path
from typing import TYPE_CHECKING, Self

import pytest

from dalycapture.reader import read_capture
from dalytools.simulator.live import SimulatedBus
from dalytools.simulator.scenario import Board, Habits, Host, Pack, Phase, Scenario

if TYPE_CHECKING:
    from types import TracebackType

CLIENT = next(path.locate() for path in files("dalybms") or () if path.name == "daly-bms-cli")
SAMPLE = Path(__file__).parents[4] / "pcap_samples/real-poll-cycle.pcapng"
REQUEST_98 = bytes.fromhex("a5409808000000000000000085")  # tano-req-98
QUICK = Habits(reply_ms=1.0, jitter_ms=0.0)


class Listener:
    """Reads a port in a thread, and notes how many bytes had come when."""

    def __init__(self, path: str) -> None:
        self.fd = os.open(path, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        self.data = b""
        self.arrivals: list[tuple[float, int]] = []
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._read)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end.set()
        self._thread.join()
        os.close(self.fd)

    def _read(self) -> None:
        while not self._end.is_set():
            if select.select([self.fd], [], [], 0.02)[0]:
                try:
                    data = os.read(self.fd, 4096)
                except OSError:  # hung up
                    return
                self.data += data
                self.arrivals.append((time.monotonic(), len(self.data)))

    def wait_for(self, what: bytes, seconds: float = 10.0) -> bool:
        end = time.monotonic() + seconds
        while what not in self.data and time.monotonic() < end:
            time.sleep(0.01)
        return what in self.data


def frozen(cells: int = 16, sensors: int = 2, **board: object) -> Scenario:
    """A pack under load that stands still, so that what is read is what was simulated, whenever it is read."""
    pack = Pack(cells=cells, sensors=sensors, speed=0.0, profile=(Phase(-12.5, 60),))
    return Scenario(boards=(Board(1, pack, **board),))  # pyright: ignore[reportArgumentType]


def dalybms(port: str, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(CLIENT), "-d", port, *words], capture_output=True, text=True, timeout=30, check=False
    )


def frames(data: bytes) -> list[bytes]:
    """A clean wire: whole frames end to end."""
    assert len(data) % 13 == 0
    out = [data[at : at + 13] for at in range(0, len(data), 13)]
    for one in out:
        assert one[0] == 0xA5
        assert sum(one[:12]) & 0xFF == one[12]
    return out


@pytest.mark.parametrize(
    ("cells", "sensors", "faults"),
    [(4, 1, ()), (14, 8, ("cell_temp_sensor", "soc_high_level_2")), (16, 1, ()), (48, 8, ())],
)
def test_dalybms_reads_what_was_simulated(cells: int, sensors: int, faults: tuple[str, ...]) -> None:
    bus = SimulatedBus(frozen(cells, sensors, faults=faults))
    reading = bus.bus.boards[1].battery.reading
    with Listener(bus.tap) as tap, bus:
        done = dalybms(bus.client, "--all")
        assert done.returncode == 0, done.stderr
        heard = tap.data
    out = json.loads(done.stdout)
    volts = [millivolts / 1000 for millivolts in reading.cells_mv]
    assert out["soc"] == {"total_voltage": round(sum(volts), 1), "current": 12.5, "soc_percent": 62.5}
    extremes = out["cell_voltage_range"]
    assert (extremes["highest_voltage"], extremes["lowest_voltage"]) == (max(volts), min(volts))
    assert volts[extremes["highest_cell"] - 1] == max(volts)
    assert volts[extremes["lowest_cell"] - 1] == min(volts)
    assert out["temperature_range"]["highest_temperature"] == max(reading.sensors_c)
    assert out["temperature_range"]["lowest_temperature"] == min(reading.sensors_c)
    assert out["mosfet_status"] == {
        "mode": "discharging",
        "charging_mosfet": True,
        "discharging_mosfet": True,
        "capacity_ah": 62.5,
    }
    assert out["status"] == {
        "cells": cells,
        "temperature_sensors": sensors,
        "charger_running": False,
        "load_running": True,
        "states": {"DI1": False, "DI2": True},
        "cycles": 37,
    }
    assert out["cell_voltages"] == {str(i + 1): value for i, value in enumerate(volts)}
    assert out["temperatures"] == {str(i + 1): value for i, value in enumerate(reading.sensors_c)}
    # paper: byte 2 bit 5 and byte 5 bit 2; the words are dalybms's own
    assert out["errors"] == (["SOC is too high. Alarm Two", "Single Temperature Sensor Fault"] if faults else [])
    asked = [one for one in frames(heard[: len(heard) // 13 * 13]) if one[1] == 0x40]
    for data_id in (*range(0x90, 0x99),):
        assert any(one[2] == data_id for one in asked)
    replies = [one for one in frames(heard[: len(heard) // 13 * 13]) if one[:3] == b"\xa5\x01\x95"]
    assert len(replies) >= -(-cells // 3)


def test_dalybms_switches_a_mos_and_the_tap_hears_it() -> None:
    bus = SimulatedBus(frozen())
    battery = bus.bus.boards[1].battery
    with Listener(bus.tap) as tap, bus:
        dalybms(bus.client, "--set-charge-mosfet", "off")  # its exit status is 1 whatever happens
        assert not battery.charge_mos
        assert battery.discharge_mos
        assert tap.wait_for(bytes.fromhex("a540da08000000000000000008"[:24]))
        assert tap.wait_for(bytes.fromhex("a501da0800"))
        dalybms(bus.client, "--set-charge-mosfet", "on")
        assert battery.charge_mos


def test_client_gets_its_replies_only_and_the_tap_gets_all() -> None:
    bus = SimulatedBus(frozen(habits=QUICK))
    with Listener(bus.tap) as tap, bus:
        fd = os.open(bus.client, os.O_RDWR | os.O_NOCTTY)
        try:
            with Listener(bus.client) as client:
                assert tap.wait_for(bytes.fromhex("a50194"))  # the host is at it
                os.write(fd, b"\xff" + REQUEST_98[:5])
                os.write(fd, REQUEST_98[5:])
                assert client.wait_for(bytes.fromhex("a501980800"))
                time.sleep(0.3)
                assert frames(client.data) == [client.data]
                assert client.data[:3] == b"\xa5\x01\x98"
        finally:
            os.close(fd)
        assert tap.wait_for(b"\xff" + REQUEST_98 + client.data)


def test_without_a_host_the_bus_is_silent_until_a_client_asks() -> None:
    config = frozen(habits=QUICK)
    bus = SimulatedBus(Scenario(boards=config.boards, host=Host(polls=False)))
    with Listener(bus.tap) as tap, bus:
        time.sleep(0.2)
        assert tap.data == b""
        fd = os.open(bus.client, os.O_RDWR | os.O_NOCTTY)
        os.write(fd, b"AT\r\n")  # no frame: on the wire, unanswered
        assert tap.wait_for(b"AT\r\n")
        os.write(fd, REQUEST_98)
        assert tap.wait_for(bytes.fromhex("a50198"))
        os.close(fd)
        assert tap.data.startswith(b"AT\r\n" + REQUEST_98 + bytes.fromhex("a50198"))


def test_nothing_is_heard_before_it_can_have_been_sent() -> None:
    """At 9600 baud no more than 960 bytes a second; a machine that is slow delivers later, never earlier."""
    bus = SimulatedBus(frozen(cells=48, habits=QUICK))
    began = time.monotonic()
    with Listener(bus.tap) as tap, bus:
        time.sleep(1.0)
    assert len(frames(tap.data[: len(tap.data) // 13 * 13])) > 5
    for when, count in tap.arrivals:
        assert count <= (when - began) * 960 + 1


def test_a_stalled_listener_does_not_disturb() -> None:
    """It never reads: clients are served all the same, and the bus stops in order."""
    bus = SimulatedBus(frozen(habits=QUICK))
    stalled = os.open(bus.tap, os.O_RDONLY | os.O_NOCTTY)
    with bus:
        assert json.loads(dalybms(bus.client, "--status").stdout)["cells"] == 16
    os.close(stalled)


def test_a_replay_is_heard_byte_for_byte() -> None:
    bus = SimulatedBus(replay=SAMPLE, then_simulate=False, speed=20.0)
    with Listener(bus.tap) as tap, bus:
        assert bus.wait(20)
        whole = b"".join(packet.data for packet in read_capture(SAMPLE))
        assert tap.wait_for(whole[-13:])
    assert tap.data == whole
    assert len(whole) == 25 * 13


def test_after_a_replay_the_boards_take_over() -> None:
    bus = SimulatedBus(frozen(habits=QUICK), replay=SAMPLE, speed=20.0)
    whole = b"".join(packet.data for packet in read_capture(SAMPLE))
    with Listener(bus.tap) as tap, bus:
        assert tap.wait_for(whole + bytes.fromhex("a540900800000000000000007d") + bytes.fromhex("a50190"))


def test_a_broken_capture_is_reported_after_what_it_holds(tmp_path: Path) -> None:
    (tmp_path / "cut.pcapng").write_bytes(SAMPLE.read_bytes()[:-3])
    bus = SimulatedBus(replay=tmp_path / "cut.pcapng", then_simulate=False, speed=50.0)
    with bus:
        assert bus.wait(20)
    assert "cut.pcapng" in bus.problem
    assert "\n" not in bus.problem


def test_stop_ends_a_silent_bus_and_links_go(tmp_path: Path) -> None:
    config = frozen()
    bus = SimulatedBus(Scenario(boards=config.boards, host=Host(polls=False)), link=tmp_path)
    assert (bus.tap, bus.client) == (str(tmp_path / "tap"), str(tmp_path / "client"))
    thread = threading.Thread(target=bus.run)
    thread.start()
    bus.stop()
    thread.join(10)
    assert not thread.is_alive()
    bus.stop()
    bus.close()
    assert list(tmp_path.iterdir()) == []
