# SPDX-License-Identifier: GPL-2.0-or-later
"""The summary's lines, from captures counted by hand."""

from __future__ import annotations

from tests.tools.dalytools.made import ANSWER, ASK, EPOCH_NS, FRAME_S, SAMPLES, a5

from dalycapture.reader import read_capture
from dalyref.decoder import decode
from dalyref.packet import Packet
from dalytools.summary import Summary


def lines(*packets: tuple[float, bytes]) -> list[str]:
    summary = Summary()
    numbered = (Packet(n, EPOCH_NS + round(at * 1e9), data) for n, (at, data) in enumerate(packets, 1))
    for record in decode(numbered):
        summary.add(record)
    return summary.lines()


def test_nothing() -> None:
    assert lines() == ["Records      none"]


def test_an_exchange() -> None:
    """The reply starts 37.0 ms after the request's end, then 40.0 ms: 38.5 ms on average."""
    assert lines((0.0, ASK), (FRAME_S + 0.037, ANSWER), (2.0, ASK), (2 + FRAME_S + 0.040, ANSWER)) == [
        "Records      4: 4 good",
        "Requests     2, 0 unanswered, 0 retries, 0 echoes",
        "Board 1      2 replies; IDs 90",
        "  pack       24.8 V  0.0 A  SOC 38.5 %",
        "  response   37.0 to 40.0 ms, mean 38.5 ms",
    ]


def test_requests_without_answers_retries_and_echoes() -> None:
    """Asked twice and once more, the second an echo (20 ms), the third a retry (within 1 s); 0x41 once."""
    assert lines((0.0, ASK), (0.034, ASK), (0.5, ASK), (3.0, a5(0x41, 0x95))) == [
        "Records      4: 4 good",
        "Requests     3, 3 unanswered, 1 retry, 1 echo",
        "  unanswered 0x90 to 0x40: 2, 0x95 to 0x41: 1",
    ]


def test_damage_and_other_traffic() -> None:
    modbus = bytes.fromhex("810300000001")
    crc = 0xFFFF
    for byte in modbus:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    good = modbus + crc.to_bytes(2, "little")
    shown = lines((0.0, ASK[:12] + b"\0"), (1.0, ASK[:9]), (2.0, b"\x11\x22"), (3.0, b""), (4.0, good))
    assert shown == [
        "Records      5: 1 bad checksum, 1 cut off, 1 junk, 1 event, 1 good",
        "Modbus       1 request, 0 unanswered, 0 replies, 0 exceptions",
    ]


def test_boards_cells_and_faults() -> None:
    """Two boards in turn: the newest values, all faults that were ever set, a board whose address is none."""
    fault, other = a5(1, 0x98, b"\x01"), a5(1, 0x98, b"\x00\x00\x00\x00\x00\x00\x04")
    packets = [
        (0.0, a5(1, 0x94, b"\x04\x01")),
        (1.0, a5(1, 0x93, b"\x02\x01\x01\x07\x00\x00\x27\x10")),
        (2.0, a5(1, 0x90, b"\x02\x10\x00\x00\x75\x94\x03\x20")),  # 52.8 V, (30100 - 30000) / 10 A, 80.0 %
        (3.0, a5(1, 0x95, b"\x01\x0c\xe4\x0c\xe5\x0c\xe6")),  # 3300, 3301, 3302 mV
        (3.0 + FRAME_S, a5(1, 0x95, b"\x02\x0c\xf0\x00\x00\x00\x00")),  # 3312 mV
        (4.0, fault),
        (5.0, other),
        (6.0, a5(2, 0x98)),
        (7.0, a5(0x13, 0x91)),
    ]
    assert lines(*packets) == [
        "Records      9: 9 good",
        "Board 1      7 replies; IDs 90 93 94 95 98",
        "  pack       52.8 V  10.0 A (discharging)  SOC 80.0 %",
        "  cells      4: 3300 to 3312 mV, average 3304 mV, spread 12 mV",
        "  faults     cell_volt_high_level_1, short_circuit_protect",
        "Board 2      1 reply; IDs 98",
        "  faults     none",
        "Board 0x13   1 reply; IDs 91",
    ]


def test_a_real_session() -> None:
    summary = Summary()
    for record in decode(read_capture(SAMPLES / "real-poll-cycle.pcapng")):
        summary.add(record)
    shown = summary.lines()
    assert shown[0] == "Records      25: 25 good"
    assert "  pack       52.8 V  0.0 A  SOC 50.0 %" in shown
    assert "  cells      14: 3740 to 3784 mV, average 3777 mV, spread 44 mV" in shown
