# SPDX-License-Identifier: GPL-2.0-or-later
"""What people read: Info, source and destination, expert notes, the tree."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.dissector.dissection import DESTINATION, SOURCE, Dissect, P, a5, expert, in_a_row, info

if TYPE_CHECKING:
    from dalytools.tshark import Tshark

CASES = {
    # hex: Info
    a5(0x40, 0x90): "Request board 1  0x90 Pack",
    a5(0x41, 0x98): "Request board 2  0x98 Faults",
    a5(0x80, 0x95): "Request any board  0x95 Cell voltages",
    # 53.1 V, 30000 - 124 = 29876 = 74b4, 78.3 %
    a5(1, 0x90, "0213000074b4030f"): "Reply board 1  0x90 Pack: 53.1 V  -12.4 A  SOC 78.3 %",
    "a50191080ec8050e9c0901f4c2": ("Reply board 1  0x91 Cell extremes: max 3784 mV (cell 5)  min 3740 mV (cell 9)"),
    "a50192083d013d019c0901f456": "Reply board 1  0x92 Temp. extremes: max 21 C (sensor 1)  min 21 C (sensor 1)",
    "a50193080001011000004e20c1": (
        "Reply board 1  0x93 MOS status: stationary  charge MOS on  discharge MOS on  remaining 20000 mAh"
    ),
    "a50194080e0100000200002073": (
        "Reply board 1  0x94 Status: 14 cells  1 sensors  charger disconnected  load disconnected  0 cycles"
    ),
    "a5019508010ec00ec20ec720d7": "Reply board 1  0x95 Cell voltages: frame 1  cells 1-3: 3776 3778 3783 mV",
    "a5019608013d00000000000082": "Reply board 1  0x96 Temperatures: frame 1  21 -40 -40 -40 -40 -40 -40 C",
    "a50197089000000000000000d5": "Reply board 1  0x97 Balance: cells 5 8",
    "a5019708000000000000000045": "Reply board 1  0x97 Balance: none",
    "a5019808000000000000000046": "Reply board 1  0x98 Faults: none",
    "a501d808000000000000000086": "Reply board 1  0xD8 Wake-up: none",
    a5(1, 0xD8, "0100000101"): "Reply board 1  0xD8 Wake-up: woken by key, CAN, current",
    a5(1, 0x50, "0000753000000e10"): (
        "Reply board 1  0x50 Ratings: rated capacity 30000 mAh  cell nominal voltage 3600 mV"
    ),
    a5(1, 0x53, "00021a0602 0e10 03".replace(" ", "")): (
        "Reply board 1  0x53 Battery: battery type LFP  operating mode short press  production date 2026-06-02"
        "  sleep 3600 s  current drift 0.3 A"
    ),
    a5(1, 0x5B, "74cc 7490 7594 75d0".replace(" ", "")): (
        "Reply board 1  0x5B Current limits: charge current 1 -10.0 A  charge current 2 -16.0 A"
        "  discharge current 1 10.0 A  discharge current 2 16.0 A"
    ),
    a5(1, 0x54, b"20220810".hex()): 'Reply board 1  0x54 Firmware index: firmware index "20220810"',
    a5(1, 0x58, "1a0602"): "Reply board 1  0x58 Production: 1a 06 02 00 00 00 00 00",
    a5(1, 0x67, "01"): "Reply board 1  0x67 Balancer: balancer on",
    a5(1, 0x79, "0e42 0064 0ddb 00c8".replace(" ", "")): (
        "Reply board 1  0x79 Alarm 2 cell high: value 3650 mV  delay 1.00 s  recovery 3547 mV  recovery delay 2.00 s"
    ),
    a5(1, 0xD9, "01 0d130d210d17c0".replace(" ", "")): "Reply board 1  0xD9 Discharge MOS: discharge MOS on",
    a5(1, 0xAB, "01"): "Reply board 1  0xAB unknown ID  01 00 00 00 00 00 00 00",
    a5(0x11, 0x90): "Reply unknown board  0x90 Pack: 0.0 V  -3000.0 A  SOC 0.0 %",
    "a5019508021c000076560286b0": "Bad checksum  address 0x01  0x95 Cell voltages",
    "a501950802": "Cut-off frame  5 bytes  a5 01 95 08 02",
    "00ff": "Junk  2 bytes  00 ff",
    "010300000002c40b": "Not Daly: Modbus RTU  8 bytes",
    "d2030000003ed7b9": "Read 62 registers from 0000, D2",
    "": "Event",
}
NORMAL = [words for words in CASES.values() if words.startswith(("Re", "Not", "Mod", "Event"))]


@pytest.mark.parametrize("two_pass", [False, True])
def test_info(dissect: Dissect, two_pass: bool) -> None:
    packets = [P(hex_bytes, index * 10.0, index) for index, hex_bytes in enumerate(CASES)]
    rows = dissect(packets, descriptions=["dalyshark"] * len(CASES), two_pass=two_pass)
    for row, words in zip(rows, CASES.values(), strict=True):
        shown = info(row)
        if two_pass and "0x95 Cell voltages: frame 1" in words:
            assert shown == words + "  all 3: min 3776 (cell 1)  max 3783 (cell 3)  average 3779  spread 7 mV"
        elif two_pass and words.startswith(("Request", "Read")):
            assert shown == words + "  [unanswered]"  # the capture goes on for longer than it waits
        else:
            assert shown == words
        assert (expert(row) == "") is (words in NORMAL and "[unanswered]" not in shown), shown


def test_the_state_stands_beside_the_current(dissect: Dissect) -> None:
    """Whichever sign: it differs between boards (field notes a.90)."""
    rows = dissect(in_a_row(a5(1, 0x93, "02"), a5(1, 0x90, "0213000074b4030f"), a5(2, 0x90, "0213000074b4030f")))
    assert "-12.4 A (discharging)  SOC" in info(rows[1])
    assert rows[1]["daly.pack.state"] == ["2"]
    assert "daly.pack.state" not in rows[2]


def test_source_and_destination(dissect: Dissect) -> None:
    rows = dissect(in_a_row(a5(0x40, 0x90), a5(0x41, 0x90), a5(0x80, 0x90), a5(0x20, 0x90), a5(3, 0x90)))
    assert [(row[SOURCE][0], row[DESTINATION][0]) for row in rows] == [
        ("PC 0x40", "Board 1"),
        ("PC 0x41", "Board 2"),
        ("App 0x80", "Board"),
        ("GPRS 0x20", "Board"),
        ("Board 3", "Host"),
    ]


def test_an_event_shows_its_comment(dissect: Dissect) -> None:
    row = dissect([P("", comment="port lost: unplugged")])[0]
    assert info(row) == "Event: port lost: unplugged"


def test_a_comment_is_one_line_without_control_characters(dissect: Dissect) -> None:
    row = dissect([P("", comment="mark:\x1b[31m red\nsecond\tline\x9b1m 50 %d")])[0]
    assert info(row) == "Event: mark: [31m red second line 1m 50 %d"


def test_many_records_in_a_packet_are_counted(dissect: Dissect) -> None:
    row = dissect([P(a5(0x40, 0x91) * 6)])[0]
    assert info(row).endswith(" | and 2 more")


def test_units_stand_in_the_tree(tshark: Tshark) -> None:
    text = tree(tshark, a5(1, 0x90, "0213000074b4030f"))
    for line in ("Pack voltage: 53.1 V", "Current: -12.4 A", "Current, raw: 29876", "SOC: 78.3 %"):
        assert line in text
    text = tree(tshark, a5(1, 0x95, "010ec00ec20ec720"))
    assert "Cell 2: 3778 mV" in text


def tree(tshark: Tshark, frame: str) -> str:
    path = tshark.home / "one.pcap"
    data = bytes.fromhex(frame)
    head = bytes.fromhex("d4c3b2a1020004000000000000000000ffff000093000000")
    path.write_bytes(head + bytes(8) + len(data).to_bytes(4, "little") * 2 + data)
    path.chmod(0o644)
    return tshark.run("-r", str(path), "-O", "daly").stdout.decode()
