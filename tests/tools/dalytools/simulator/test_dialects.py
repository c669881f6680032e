# SPDX-License-Identifier: GPL-2.0-or-later
"""Modbus and settings of the simulated board: the papers' examples, and one battery behind all dialects."""

from __future__ import annotations

import struct

import pytest

from dalytools.simulator import modbus
from dalytools.simulator.battery import Battery
from dalytools.simulator.board import SimulatedBoard, frame
from dalytools.simulator.scenario import Board, Habits, Pack, Phase


def board(number: int = 1, **habits: object) -> SimulatedBoard:
    pack = Pack(cells=16, sensors=3, profile=(Phase(-10.0, 3600),), ripple=0.0, speed=0.0)
    config = Board(number, pack, Habits(**habits), dialects=("a5", "d2", "81"))  # pyright: ignore[reportArgumentType]
    return SimulatedBoard(config, Battery(pack, "test"))


def asked(simulated: SimulatedBoard, request: bytes) -> bytes:
    answer = simulated.answer(request)
    assert answer is not None
    (reply,) = answer.frames
    return reply


def words(simulated: SimulatedBoard, address: int, register: int, count: int) -> list[int]:
    reply = asked(simulated, modbus.read_request(address, register, count))
    assert reply == modbus.sealed(reply[:-2])
    assert reply[:3] == bytes((0xD2 if address == 0xD2 else address - 0x30, 3, 2 * count))
    return list(struct.unpack(f">{count}H", reply[3:-2]))


def a5(simulated: SimulatedBoard, data_id: int, payload: bytes = bytes(8)) -> list[bytes]:
    answer = simulated.answer(frame(0x3F + simulated.board.number, data_id, payload))
    assert answer is not None
    return [data[4:12] for data in answer.frames]


def test_the_examples_of_the_papers() -> None:
    """Article of 2024, section 3; all CRCs as printed there."""
    assert modbus.read_request(0xD2, 0x0C, 1) == bytes.fromhex("D203000C000157AA")
    assert modbus.write_request(0xD2, 0x0C, [1]) == bytes.fromhex("D206000C00019BAA")
    many = bytes.fromhex("D210000C0002000100027D65")  # without a byte count
    assert modbus.write_request(0xD2, 0x0C, [1, 2]) == many
    simulated = board()
    assert asked(simulated, many) == bytes.fromhex("D210000C00029268")
    assert asked(simulated, bytes.fromhex("D206000C00019BAA")) == bytes.fromhex("D206000C00019BAA")
    assert words(simulated, 0xD2, 0x0C, 1) == [
        simulated.battery.reading.cells_mv[12]
    ]  # it is cell 13: nothing switched


def test_a_standard_byte_count_is_taken_too() -> None:
    body = bytes.fromhex("D21000A50002") + b"\x04" + bytes.fromhex("00000001")
    simulated = board()
    assert asked(simulated, modbus.sealed(body)) == modbus.sealed(bytes.fromhex("D21000A50002"))
    assert words(simulated, 0xD2, 0x35, 2) == [0, 1]


def test_dialects_agree_on_one_battery() -> None:
    simulated = board()
    reading = simulated.battery.reading
    d2 = words(simulated, 0xD2, 0x00, 0x3E)
    p81 = words(simulated, 0x81, 0x00, 0x5C)
    volts, _, current, soc = struct.unpack(">4H", a5(simulated, 0x90)[0])
    assert d2[0x28:0x2B] == p81[0x38:0x3B] == [volts, current, soc]
    assert tuple(d2[:16]) == tuple(p81[:16]) == reading.cells_mv
    assert d2[16:32] == [0] * 16
    assert d2[0x20:0x23] == p81[0x30:0x33] == [degrees + 40 for degrees in reading.sensors_c]
    assert d2[0x30] == p81[0x4B] == reading.remaining_mah // 100 == 625  # 62.5 % of 100 Ah, in 0.1 Ah
    assert d2[0x31:0x34] == [16, 3, 37]
    assert p81[0x3C:0x3E] == [16, 3]
    assert d2[0x2F] == p81[0x48] == 2
    assert d2[0x39] == p81[0x58] == round(reading.pack_dv / 10 * 10.0)  # 10 A
    assert p81[0x3E:0x42] == [
        max(reading.cells_mv),
        reading.cells_mv.index(max(reading.cells_mv)) + 1,
        min(reading.cells_mv),
        reading.cells_mv.index(min(reading.cells_mv)) + 1,
    ]


def test_fault_words_have_byte_0_low() -> None:
    """Field notes d.1, 3A-3D: SOC low level 2 is byte 2 bit 7, so 3B = 0080 (rab-status)."""
    simulated = board()
    simulated.battery.forced = {"soc_low_level_2", "chg_temp_high_level_1"}
    simulated.battery.refresh()
    assert words(simulated, 0xD2, 0x3A, 4) == [0x0100, 0x0080, 0, 0]


def test_what_is_not_there_reads_ffff_and_other_addresses_are_silent() -> None:
    simulated = board(2)
    assert words(simulated, 0xD2, 0x63, 3) == [0xFFFF] * 3
    assert words(simulated, 0x82, 0xA5, 1) == [0xFFFF]  # of the other map
    for address in (0x81, 0x83, 0x51, 0x01):
        assert simulated.answer(modbus.read_request(address, 0, 1)) is None
    assert simulated.answer(modbus.read_request(0xD2, 0, 1)[:-1] + b"\0") is None


def test_texts_stand_backwards_in_d2_and_forwards_in_81() -> None:
    simulated = board()
    d2 = struct.pack(">8H", *words(simulated, 0xD2, 0xA9, 8))
    assert d2.rstrip(b"\0") == b"T00K_321042_11"  # field notes d.1: of 11_240123_K00T
    assert struct.pack(">7H", *words(simulated, 0x81, 0x178, 7)) == b"11_240123_K00T"
    assert struct.pack(">16H", *words(simulated, 0xD2, 0xB9, 16)).rstrip(b"\0") == b"DL-SIM-0001-20240315"
    frames = a5(simulated, 0x57)
    assert [payload[0] for payload in frames] == [1, 2, 3, 4, 5]
    assert b"".join(payload[1:] for payload in frames).rstrip(b"\0") == b"DL-SIM-0001-20240315"
    assert [payload[1:] for payload in a5(simulated, 0x63)] == [b"DL-BMS-", b"R32-01E"]  # jb113-63


def test_settings_agree_and_take_writes() -> None:
    """Field notes a.2, d.1; write ID = read ID - 40."""
    simulated = board()
    assert a5(simulated, 0x50) == [struct.pack(">II", 100_000, 3200)]
    assert words(simulated, 0xD2, 0x80, 2) == [1000, 3200]
    assert words(simulated, 0x81, 0x109, 2) == [100_000 >> 16, 100_000 & 0xFFFF]
    assert a5(simulated, 0x59) == [struct.pack(">4H", 3600, 3650, 2900, 2700)]
    assert words(simulated, 0xD2, 0x8B, 4) == [3600, 3650, 2900, 2700]
    assert a5(simulated, 0x5C) == [bytes((90, 95, 42, 40, 100, 105, 25, 20))]
    assert words(simulated, 0xD2, 0x97, 8) == [90, 95, 42, 40, 100, 105, 25, 20]
    charge = struct.unpack(">4H", a5(simulated, 0x5B)[0])
    assert charge == (29000, 28800, 31500, 32000)  # 100, 120 A below 30000, 150, 200 A above
    written = struct.pack(">4H", 3500, 3550, 3000, 2800)
    assert a5(simulated, 0x19, written) == [written]
    assert words(simulated, 0xD2, 0x8B, 4) == [3500, 3550, 3000, 2800]
    asked(simulated, modbus.write_request(0xD2, 0xA4, [25]))
    assert a5(simulated, 0x5F) == [struct.pack(">HH4x", 3400, 25)]


def test_switches_soc_and_clock_over_every_dialect() -> None:
    simulated = board()
    assert asked(simulated, modbus.write_request(0x81, 0x122, [0])) == modbus.sealed(bytes.fromhex("510601220000"))
    assert a5(simulated, 0x93)[0][1:3] == b"\1\0"
    assert words(simulated, 0xD2, 0x36, 1) == [0]
    a5(simulated, 0xD9, b"\1" + bytes(7))
    assert words(simulated, 0xD2, 0x36, 1) == [1]
    assert a5(simulated, 0x21, bytes(6) + (800).to_bytes(2))[0][0] == 1
    assert words(simulated, 0xD2, 0x2A, 1) == [800]
    simulated.now_s = 100.0
    asked(simulated, modbus.write_request(0xD2, 0xD4, [0x180B, 0x0709, 0x341C]))  # the app's: 24-11-07 09:52:28
    simulated.now_s = 101.0
    assert a5(simulated, 0x61) == [bytes((24, 11, 7, 9, 52, 29, 0, 0))]
    assert words(simulated, 0x81, 0x61, 3) == [0x180B, 0x0709, 0x341D]


@pytest.mark.parametrize(("writes", "answered"), [("ignore", True), ("silent", False)])
def test_boards_that_do_not_take_writes(writes: str, answered: bool) -> None:
    simulated = board(writes=writes)
    for request in (frame(0x40, 0xDA, bytes(8)), modbus.write_request(0xD2, 0xA5, [0]), frame(0x40, 0x21, bytes(8))):
        answer = simulated.answer(request)
        assert (answer is not None) == answered
        if answer is not None and request[2] == 0xDA:
            assert answer.frames[0][4] == 1  # the old state
        if answer is not None and request[2] == 0x21:
            assert answer.frames[0][4] == 0
    assert a5(simulated, 0x93)[0][1] == 1


def test_a_board_that_pretends_answers_as_if_it_took_the_write() -> None:
    simulated = board(writes="pretend")
    off = modbus.write_request(0xD2, 0xA5, [0])
    limit = bytes.fromhex("0e100e740af00a8c")
    assert a5(simulated, 0xDA, bytes(8))[0][0] == 0
    assert asked(simulated, off) == off
    assert a5(simulated, 0x21, bytes(6) + (800).to_bytes(2))[0][0] == 1
    assert a5(simulated, 0x19, limit) == [limit]
    assert a5(simulated, 0x93)[0][1] == 1  # charge MOS on, as before
    assert words(simulated, 0xD2, 0x2A, 1) != [800]
    assert a5(simulated, 0x59) != [limit]


def test_alarm_grid_is_a_habit() -> None:
    """ID = 70 + 9 x (level - 1) + class; class 2 is currents, discharge first (field notes a.2)."""
    assert board().answer(frame(0x40, 0x70, bytes(8))) is None
    simulated = board(alarm_grid=True)
    assert struct.unpack(">4H", a5(simulated, 0x70)[0])[:2] == (3600, 500)
    assert struct.unpack(">4H", a5(simulated, 0x7A)[0])[0] == 2700
    assert struct.unpack(">4H", a5(simulated, 0x72)[0]) == (31500, 500, 29000, 500)


def test_made_up_ids_are_a_habit() -> None:
    """9C: counter, current two replies ago, 5A with the balancer in bit 0, seconds; the balancer is written with 27."""
    assert board().answer(frame(0x40, 0x9C, bytes(8))) is None
    simulated = board(undocumented=True)
    simulated.now_s = 70000.9
    first = a5(simulated, 0x9C)[0]
    assert (first[0], first[3], int.from_bytes(first[4:])) == (0, 0x5B, 70000)
    a5(simulated, 0x27, bytes(1))
    assert a5(simulated, 0x9C)[0][3] == 0x5A
    assert a5(simulated, 0x9D) == [b"77B-1A.4"]


def test_requests_are_found_in_what_a_client_writes() -> None:
    request = modbus.write_request(0xD2, 0xD4, [1, 2, 3])
    assert [modbus.may_become_request(request[:size]) for size in range(1, 15)] == [True] * 14
    assert modbus.request_length(request) == 14
    assert modbus.request_length(request + b"\xa5") == 14
    assert modbus.parse(request + b"\0") is None
    assert not modbus.may_become_request(b"\xd2\x77")
    assert modbus.request_length(modbus.read_request(0x91, 0, 1)) == 0  # no board 17
