# SPDX-License-Identifier: GPL-2.0-or-later
"""One simulated board: its frames, and the habits of real boards, held against real frames."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest

from dalytools.simulator.battery import Battery
from dalytools.simulator.board import SimulatedBoard, frame, is_request
from dalytools.simulator.scenario import Board, Habits, Pack, Phase

REAL = {
    entry["id"]: bytes.fromhex(entry["hex"])
    for entry in map(
        json.loads,
        (Path(__file__).parents[4] / "pcap_samples/real-frames.jsonl").read_text(encoding="utf-8").splitlines(),
    )
}


def request(data_id: int, address: int = 0x40, first: int = 0) -> bytes:
    return frame(address, data_id, bytes((first,)) + bytes(7))


def board(
    number: int = 1, habits: Habits | None = None, *, amperes: float = -10.0, asleep: str = "", **pack: object
) -> SimulatedBoard:
    settings = Pack(profile=(Phase(amperes, 3600),), ripple=0.0, speed=0.0, **pack)  # pyright: ignore[reportArgumentType]
    config = Board(number, settings, habits or Habits(), asleep)  # pyright: ignore[reportArgumentType]
    return SimulatedBoard(config, Battery(settings, "test"))


def payloads(simulated: SimulatedBoard, data_id: int, address: int = 0x40, first: int = 0) -> list[bytes]:
    answer = simulated.answer(request(data_id, address, first))
    assert answer is not None
    for data in answer.frames:
        assert len(data) == 13
        assert data[0] == 0xA5
        assert data[1] == simulated.board.number
        assert data[2] == data_id
        assert data[3] == 8
        assert sum(data[:12]) & 0xFF == data[12]
    return [data[4:12] for data in answer.frames]


def test_frames_are_built_as_real_hosts_build_them() -> None:
    for data_id in (*range(0x90, 0x99), 0xD8):
        assert request(data_id) == REAL[f"tano-req-{data_id:02x}"]
    assert request(0xD9, first=1) == REAL["d9-on-req"]
    assert all(is_request(data) for name, data in REAL.items() if name.startswith("tano-req"))
    assert not is_request(REAL["tano-90-1"])  # a reply
    assert not is_request(REAL["tano-req-90"][:-1] + b"\0")


def test_values_are_those_of_the_battery() -> None:
    simulated = board(cells=5, sensors=8)
    reading = simulated.battery.reading
    cells, sensors = reading.cells_mv, reading.sensors_c
    volts, gather, current, soc = struct.unpack(">4H", payloads(simulated, 0x90)[0])
    assert (volts, gather, soc) == (round(sum(cells) / 100), 0, 625)
    assert current == 30100  # 10.0 A out of the pack: above 30000 by default (field notes a.90)
    high, high_no, low, low_no = struct.unpack(">HBHB2x", payloads(simulated, 0x91)[0])
    assert (high, cells[high_no - 1]) == (max(cells), max(cells))
    assert (low, cells[low_no - 1]) == (min(cells), min(cells))
    hot, hot_no, cold, cold_no = payloads(simulated, 0x92)[0][:4]
    assert (hot - 40, sensors[hot_no - 1]) == (max(sensors), max(sensors))
    assert (cold - 40, sensors[cold_no - 1]) == (min(sensors), min(sensors))
    assert struct.unpack(">BBBxI", payloads(simulated, 0x93)[0]) == (2, 1, 1, 62500)
    assert payloads(simulated, 0x94)[0][:7] == bytes((5, 8, 0, 1, 2)) + (37).to_bytes(2)
    first, second = payloads(simulated, 0x95)
    assert struct.unpack(">B3Hx", first) == (1, *cells[:3])
    assert struct.unpack(">B2H3x", second) == (2, *cells[3:])
    first, second = payloads(simulated, 0x96)
    assert first == bytes((1, *(degrees + 40 for degrees in sensors[:7])))
    assert second[:2] == bytes((2, sensors[7] + 40))
    assert payloads(simulated, 0x97) == [bytes(8)]
    assert payloads(simulated, 0x98) == [bytes(8)]
    assert payloads(simulated, 0xD8) == [bytes(8)]


def test_sign_of_the_current_is_a_habit() -> None:
    for amperes, discharge_high, raw in (
        (-10, True, 30100),
        (10, True, 29900),
        (-10, False, 29900),
        (10, False, 30100),
    ):
        simulated = board(habits=Habits(discharge_high=discharge_high), amperes=amperes)
        assert struct.unpack(">4xH2x", payloads(simulated, 0x90)[0]) == (raw,)
        assert payloads(simulated, 0x93)[0][0] == (2 if amperes < 0 else 1)


def test_stale_bytes_follow_the_pattern_of_a_real_poll() -> None:
    """Field notes, fact 2. The same relations hold in the real session ``tano``, checked first."""

    def relations(seen: dict[int, list[bytes]]) -> None:
        assert seen[0x91][0][6:8] == seen[0x90][0][6:8]
        assert seen[0x92][0][4:8] == seen[0x91][0][4:8]
        assert seen[0x94][0][7] == seen[0x93][0][7]
        assert {payload[7] for payload in seen[0x95]} == {seen[0x93][0][7]}
        assert seen[0x95][-1][5:7] == seen[0x95][-2][5:7]  # 14 cells: the 15th slot

    real = {i: [REAL[f"tano-{i:02x}-1"][4:12]] for i in (0x90, 0x91, 0x92, 0x93, 0x94)}
    real[0x95] = [REAL[f"tano-95-{n}"][4:12] for n in range(1, 6)]
    relations(real)
    simulated = board(cells=14, sensors=1)
    relations({data_id: payloads(simulated, data_id) for data_id in range(0x90, 0x96)})
    last = payloads(simulated, 0x96)[0]
    assert last[1] == simulated.battery.reading.sensors_c[0] + 40
    assert last[2:] == bytes(5) + bytes((62500 & 0xFF,))  # cpy-96: zeros, then the low byte of the capacity


@pytest.mark.parametrize(("reserved", "fill"), [("zero", 0), ("ff", 0xFF)])
def test_reserved_bytes_filled(reserved: str, fill: int) -> None:
    simulated = board(habits=Habits(reserved=reserved), cells=4, sensors=1)  # pyright: ignore[reportArgumentType]
    seen = {data_id: payloads(simulated, data_id) for data_id in range(0x90, 0x98)}
    for data_id, start in ((0x91, 6), (0x92, 4), (0x94, 7), (0x97, 6)):
        assert set(seen[data_id][0][start:]) == {fill}
    assert set(seen[0x95][1][3:]) == {fill}
    assert set(seen[0x96][0][2:]) == {fill}


@pytest.mark.parametrize(("cells", "frames"), [(1, 1), (3, 1), (4, 2), (14, 5), (16, 6), (48, 16)])
def test_number_of_cell_frames(cells: int, frames: int) -> None:
    """Field notes, fact 6: ceil(cells / 3) to 0x40, all 16 to 0x80 with the empty ones zero."""
    simulated = board(cells=cells)
    bursts = payloads(simulated, 0x95)
    assert [payload[0] for payload in bursts] == list(range(1, frames + 1))
    bursts = payloads(simulated, 0x95, address=0x80)
    assert [payload[0] for payload in bursts] == list(range(1, 17))
    values = b"".join(payload[1:7] for payload in bursts)
    assert struct.unpack(f">{cells}H", values[: 2 * cells]) == simulated.battery.reading.cells_mv
    assert not any(values[2 * cells :])


def test_frame_numbers_from_zero_and_needless_sensor_frame() -> None:
    simulated = board(habits=Habits(frame_base=0, sensor_frames=2), cells=6, sensors=1)
    assert [payload[0] for payload in payloads(simulated, 0x95)] == [0, 1]
    assert [payload[0] for payload in payloads(simulated, 0x96)] == [0, 1]
    assert payloads(board(habits=Habits(sensor_frames=2), sensors=1), 0x96)[1] == REAL["tano-96-2"][4:12]
    assert [payload[0] for payload in payloads(board(sensors=21), 0x96)] == [1, 2, 3]


@pytest.mark.parametrize(
    ("number", "answered"),
    [(1, {0x40, 0x80, 0x20}), (2, {0x41}), (16, {0x4F})],
)
def test_addresses(number: int, answered: set[int]) -> None:
    """Field notes b, parallel boards: 0x3F+N; the app and GPRS hang on board 1."""
    simulated = board(number)
    assert {address for address in range(256) if simulated.answer(request(0x90, address))} == answered


def test_unknown_ids_are_not_answered() -> None:
    """There is no negative reply (field notes a.2). 58 and 64 were never seen answered; the alarm grid is a habit."""
    simulated = board()
    reads = {*range(0x50, 0x6B), *range(0x90, 0x9B), 0xD8} - {0x58, 0x64}
    writes = {0x10, 0x11, 0x13, *range(0x19, 0x22), *range(0x25, 0x2A), 0xD9, 0xDA}  # of one frame, less 40
    assert {data_id for data_id in range(1, 256) if simulated.answer(request(data_id))} == reads | writes
    assert simulated.answer(request(0x00)) is None  # a restart: silent for 3 s
    assert simulated.answer(request(0x90)) is None
    simulated.now_s = 3.0
    assert simulated.answer(request(0x90))


@pytest.mark.parametrize(("data_id", "place"), [(0xD9, 2), (0xDA, 1)])
def test_switches(data_id: int, place: int) -> None:
    """D9 is discharge, DA charge; 01 is on (fact 7); behind the state the bytes of the last 0x94, as in d9-*, mos-*."""
    simulated = board()
    status = payloads(simulated, 0x94)[0]
    assert payloads(simulated, data_id, first=0) == [b"\0" + status[1:]]
    mos = payloads(simulated, 0x93)[0]
    assert mos[place] == 0
    assert mos[3 - place] == 1
    assert payloads(simulated, 0x98)[0][6] == 0x10
    cells = payloads(simulated, 0x95)[-1]
    assert payloads(simulated, data_id, first=1) == [b"\1" + cells[1:]]
    assert payloads(simulated, 0x93)[0][place] == 1


def test_asleep() -> None:
    """Facts 4 and b, sleep: an echo or silence; then all zero, -3000.0 A; then values."""
    simulated = board(habits=Habits(zero_replies=3), asleep="echo", cells=4)
    answer = simulated.answer(request(0x90))
    assert answer is not None
    assert answer.frames == [request(0x90)]
    assert board(asleep="silence").answer(request(0x90)) is None
    simulated.wake()
    assert payloads(simulated, 0x90) == [bytes(8)]
    assert payloads(simulated, 0x94) == [bytes(8)]
    assert payloads(simulated, 0x95) == [b"\1" + bytes(7), b"\2" + bytes(7)]
    assert struct.unpack(">4xHH", payloads(simulated, 0x90)[0]) == (30100, 625)


def test_life_runs_on() -> None:
    simulated = board()
    seen = [payloads(simulated, 0x93)[0][3] for _ in range(257)]
    assert seen[:3] == [1, 2, 3]
    assert seen[255] == 0
