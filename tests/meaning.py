# SPDX-License-Identifier: GPL-2.0-or-later
"""What frames mean to each other: one table of small sessions, worked out by hand from docs/records.md 7 to 11.

Both readings run it (tests/dissector/test_meaning.py, tests/tools/dalyref/test_meaning.py). A field of WATCHED that a
case does not name must not be there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Mapping

FRAME_S = 13 * 10 / 9600
"""How long a frame takes on the wire."""

_WATCHED = """
retry unanswered unasked late_to other_board second_host write write_result burst.cut_off reassembled_in changed
changed_from contradiction contradicts fault_raised fault_cleared manufacturer battery_name battery_code
software_version hardware_version serial_number sensors.count sensors.min sensors.max sensors.average
sensors.spread sensors.min_number sensors.max_number cells.count cells.min_number cells.max_number
"""
WATCHED = tuple(f"daly.{name}" for name in _WATCHED.split())


@dataclass(frozen=True)
class Heard:
    """A frame: bytes as hex, when it begins (s), and what is expected of it, by field name without ``daly.``.

    side: inbound or outbound, where the tap tells.
    """

    frame: str
    at: float
    expect: Mapping[str, object] = field(default_factory=dict[str, object])
    side: Literal["", "inbound", "outbound"] = ""


def a5(address: int, data_id: int, data: str = "") -> str:
    """Build an A5 frame, as hex; data is hex, filled up with zeros."""
    head = bytes((0xA5, address, data_id, 8)) + bytes.fromhex(data).ljust(8, b"\0")
    return (head + bytes((sum(head) & 0xFF,))).hex()


def cells(number: int, *mv: int, board: int = 1) -> str:
    return a5(board, 0x95, f"{number:02x}" + "".join(f"{v:04x}" for v in mv))


def status(cell_count: int, sensors: int = 1, charger: int = 0, load: int = 0, board: int = 1) -> str:
    return a5(board, 0x94, f"{cell_count:02x}{sensors:02x}{charger:02x}{load:02x}")


def extremes(high: int, high_number: int, low: int, low_number: int) -> str:
    return a5(1, 0x91, f"{high:04x}{high_number:02x}{low:04x}{low_number:02x}")


def heat(number: int, *raw: int) -> str:
    return a5(1, 0x96, f"{number:02x}" + "".join(f"{r:02x}" for r in raw))


def heat_extremes(high: int, high_number: int, low: int, low_number: int) -> str:
    return a5(1, 0x92, f"{high:02x}{high_number:02x}{low:02x}{low_number:02x}")


def pack(decivolts: int) -> str:
    return a5(1, 0x90, f"{decivolts:04x}000075300200")


def text(data_id: int, number: int, characters: bytes) -> str:
    return a5(1, data_id, f"{number:02x}" + characters.hex())


ASK, ANSWER = a5(0x40, 0x90), pack(533)
THREE = cells(1, 3300, 3310, 3320)
TABLE = {"cells.count": 3, "cells.min_number": 1, "cells.max_number": 3}

CASES: dict[str, list[Heard]] = {
    # Section 7
    "answered": [Heard(ASK, 0), Heard(ANSWER, 0.05), Heard(ASK, 5), Heard(ANSWER, 5.05)],
    "unanswered, found out by the next request": [
        Heard(ASK, 0, {"unanswered": True}),
        Heard(a5(0x40, 0x93), FRAME_S + 1.0001),
    ],
    "the capture ends while it waits": [Heard(ASK, 0), Heard(a5(0x40, 0x93), FRAME_S + 0.9999)],
    "a retry answered: the first stays unanswered": [
        Heard(ASK, 0, {"unanswered": True}),
        Heard(ASK, 0.5, {"retry": True}),
        Heard(ANSWER, 0.55),
        Heard(a5(1, 0x97), 1.2, {"unasked": True}),
    ],
    "the echo of a request that nobody answers": [
        Heard(ASK, 0, {"unanswered": True}),
        Heard(ASK, FRAME_S + 0.01),
        Heard(a5(0x40, 0x93), 2),
    ],
    "replies alone complain of nothing": [Heard(ANSWER, 0), Heard(a5(1, 0x93), 1), Heard(THREE, 2, TABLE)],
    "a reply that nobody asked for": [Heard(ASK, 0), Heard(ANSWER, 0.05), Heard(a5(1, 0x97), 0.1, {"unasked": True})],
    "a fault log, in frames that nothing numbers": [
        Heard(a5(0x40, 0x64), 0),
        Heard(a5(1, 0x64, "01"), 0.05),
        Heard(a5(1, 0x64, "02"), 0.45),
        Heard(a5(2, 0x64, "02"), 0.5, {"unasked": True}),
        Heard(a5(1, 0x90, "01"), 0.55, {"unasked": True}),
        Heard(a5(1, 0x64, "ff"), 0.95),
        Heard(a5(1, 0x64, "ff"), 1.451, {"unasked": True}),
        Heard(a5(1, 0x64, "ff"), 1.5, {"unasked": True}),
    ],
    "a fault log that is asked for again": [
        Heard(a5(0x40, 0x64), 0),
        Heard(a5(1, 0x64, "01"), 0.05),
        Heard(a5(0x40, 0x64), 0.1),
        Heard(a5(1, 0x64, "01"), 0.15),
    ],
    "a written clock, answered twice": [
        Heard(a5(0x40, 0x21, "180c1f173b3b01f4"), 0, {"write": True}),
        Heard(a5(1, 0x21, "01"), 0.05, {"write_result": "confirmed"}),
        Heard(a5(1, 0x21, "01"), 0.07),
    ],
    "the same answer twice": [Heard(ASK, 0), Heard(ANSWER, 0.05), Heard(ANSWER, 0.1, {"unasked": True})],
    "just in time": [Heard(ASK, 0), Heard(ANSWER, FRAME_S + 1)],
    "late": [Heard(ASK, 0, {"unanswered": True}), Heard(ANSWER, FRAME_S + 1.001, {"unasked": True, "late_to": 1})],
    "late, as late as can be": [
        Heard(ASK, 0, {"unanswered": True}),
        Heard(ANSWER, FRAME_S + 10, {"unasked": True, "late_to": 1}),
    ],
    "too late to be late": [Heard(ASK, 0, {"unanswered": True}), Heard(ANSWER, FRAME_S + 10.001, {"unasked": True})],
    "one late reply a request": [
        Heard(ASK, 0, {"unanswered": True}),
        Heard(ANSWER, 2, {"unasked": True, "late_to": 1}),
        Heard(ANSWER, 3, {"unasked": True}),
    ],
    "two late replies to two requests, newest first": [
        Heard(ASK, 0, {"unanswered": True}),
        Heard(ASK, 2, {"unanswered": True}),
        Heard(ANSWER, 4, {"unasked": True, "late_to": 2}),
        Heard(ANSWER, 4.1, {"unasked": True, "late_to": 1}),
    ],
    "a late reply of another board is nobody's": [
        Heard(a5(0x42, 0x90), 0, {"unanswered": True}),
        Heard(ANSWER, 2, {"unasked": True}),
    ],
    "board 2 answers what 40 asked": [Heard(ASK, 0), Heard(a5(2, 0x90), 0.05, {"other_board": True})],
    "board 1 answers what board 3 was asked": [
        Heard(a5(0x42, 0x90), 0),
        Heard(ANSWER, 0.05, {"unasked": True, "other_board": True}),
        Heard(a5(3, 0x90), 0.1),
    ],
    "the app names no board": [Heard(a5(0x80, 0x90), 0), Heard(a5(2, 0x90), 0.05)],
    "an address that is no board's": [Heard(ASK, 0), Heard(a5(0x11, 0x90), 0.05)],
    "two hosts": [
        Heard(ASK, 0),
        Heard(ANSWER, 0.05),
        Heard(a5(0x80, 0x93), 0.5, {"second_host": True}),
        Heard(a5(1, 0x93), 0.55),
        Heard(a5(0x20, 0x93), 1.0, {"second_host": True}),
        Heard(a5(1, 0x93), 1.05),
    ],
    "another host, a second and more later": [
        Heard(ASK, 0),
        Heard(ANSWER, 0.05),
        Heard(a5(0x80, 0x93), FRAME_S + 1.001),
        Heard(a5(1, 0x93), 1.1),
    ],
    "one host asks two boards": [
        Heard(ASK, 0),
        Heard(ANSWER, 0.05),
        Heard(a5(0x41, 0x90), 0.1),
        Heard(a5(2, 0x90), 0.15),
    ],
    "the echo of another host's request is no host": [
        Heard(ASK, 0),
        Heard(ASK, 0.02),
        Heard(ANSWER, 0.05),
        Heard(a5(0x40, 0x93), 0.1),
        Heard(a5(1, 0x93), 0.15),
    ],
    # Section 8
    "all cells, linked both ways": [
        Heard(status(5), 0),
        Heard(cells(1, 3305, 3301, 3302), 0.1, {"reassembled_in": 3}),
        Heard(cells(2, 3305, 3301, 3333), 0.12, {"cells.count": 5, "cells.min_number": 2, "cells.max_number": 1}),
        Heard(cells(3, 0, 0, 0), 0.14, {"reassembled_in": 3}),
    ],
    "without a count the last one has the table": [
        Heard(cells(1, 3300, 3310, 3320), 0, {"reassembled_in": 2}),
        Heard(cells(2, 3290, 3320, 3320), 0.02, {"cells.count": 6, "cells.min_number": 4, "cells.max_number": 3}),
        Heard(pack(330), 1),
    ],
    "a hole: no table, no links, not cut off": [
        Heard(status(9), 0),
        Heard(cells(1, 3300, 3300, 3300), 0.1),
        Heard(cells(3, 3300, 3300, 3300), 0.12),
        Heard(pack(297), 0.2),
    ],
    "cut off by another ID": [
        Heard(status(5), 0),
        Heard(cells(1, 3300, 3300, 3300), 0.1, {"burst.cut_off": True}),
        Heard(pack(165), 0.2),
    ],
    "cut off by time": [
        Heard(status(5), 0),
        Heard(cells(1, 3300, 3300, 3300), 0.1, {"burst.cut_off": True}),
        Heard(a5(0x40, 0x93), 0.1 + FRAME_S + 0.501),
    ],
    "the capture stops inside a burst": [
        Heard(status(5), 0),
        Heard(cells(1, 3300, 3300, 3300), 0.1),
        Heard(a5(0x40, 0x93), 0.1 + FRAME_S + 0.499),
    ],
    "sensors": [
        Heard(status(3, 9), 0),
        Heard(heat(1, 60, 0, 65, 62, 255, 62, 61), 0.1, {"reassembled_in": 3}),
        Heard(
            heat(2, 55, 66, 99),
            0.12,
            {
                "sensors.count": 9,
                "sensors.min": 15,
                "sensors.min_number": 8,
                "sensors.max": 26,
                "sensors.max_number": 9,
                "sensors.average": (60 + 65 + 62 + 62 + 61 + 55 + 66) / 7 - 40,
                "sensors.spread": 11,
            },
        ),
    ],
    "no sensor is there": [Heard(status(3, 2), 0), Heard(heat(1, 0, 255), 0.1, {"sensors.count": 2})],
    "a text": [
        Heard(text(0x63, 1, b"DL-BMS-"), 0, {"reassembled_in": 2}),
        Heard(text(0x63, 2, b"R32-01E"), 0.02, {"hardware_version": "DL-BMS-R32-01E"}),
        Heard(ASK, 2),
    ],
    "a text from 0, with padding and what can't be shown": [
        Heard(text(0x55, 0, b"A\x07b c\x00\x00"), 0, {"reassembled_in": 2}),
        Heard(text(0x55, 1, b"\xe9z \x00\xff  "), 0.02, {"manufacturer": "A?b c???z"}),
        Heard(ASK, 2),
    ],
    "a text of padding is none": [
        Heard(text(0x6A, 1, b"\0\0\0\0\0\0\0"), 0),
        Heard(text(0x6A, 2, b"\xff\xff\x20\x20\0\0\0"), 0.02),
        Heard(ASK, 2),
    ],
    "a text is as long as its ID has it, and what stands behind that is stale": [
        Heard(text(0x55, 1, b"DALY BM"), 0, {"reassembled_in": 3}),
        Heard(text(0x55, 2, b"S Co Lt"), 0.02, {"reassembled_in": 3}),
        Heard(text(0x55, 3, b"d.stale"), 0.04, {"manufacturer": "DALY BMS Co Ltd."}),
        Heard(text(0x6A, 1, b"S234567"), 1, {"reassembled_in": 8}),
        Heard(text(0x6A, 2, b"8901234"), 1.02, {"reassembled_in": 8}),
        Heard(text(0x6A, 3, b"5678901"), 1.04, {"reassembled_in": 8}),
        Heard(text(0x6A, 4, b"2345678"), 1.06, {"reassembled_in": 8}),
        Heard(text(0x6A, 5, b"9012\xaaUZ"), 1.08, {"serial_number": "S2345678901234567890123456789012"}),
        Heard(text(0x56, 0, b"N234567"), 2, {"reassembled_in": 13}),  # from 0
        Heard(text(0x56, 1, b"8901234"), 2.02, {"reassembled_in": 13}),
        Heard(text(0x56, 2, b"5678901"), 2.04, {"reassembled_in": 13}),
        Heard(text(0x56, 3, b"2345678"), 2.06, {"reassembled_in": 13}),
        Heard(text(0x56, 4, b"90  xyz"), 2.08, {"battery_name": "N23456789012345678901234567890"}),
        Heard(ASK, 4),
    ],
    "a code of 35 letters, in a sixth frame nothing of it": [
        *(Heard(text(0x57, n, b"ABCDEFG"), 0.02 * n, {"reassembled_in": 6}) for n in range(1, 6)),
        Heard(text(0x57, 6, b"HIJKLMN"), 0.12, {"battery_code": 5 * "ABCDEFG"}),
        Heard(ASK, 2),
    ],
    "a name of padding, stale letters behind it, is none": [
        *(Heard(text(0x56, n, b" " * 7), 0.02 * n) for n in range(1, 5)),
        Heard(text(0x56, 5, b"\0\0\0\0abc"), 0.1),
        Heard(ASK, 2),
    ],
    "versions have no length": [
        Heard(text(0x62, 1, b"V234567"), 0, {"reassembled_in": 3}),
        Heard(text(0x62, 2, b"8901234"), 0.02, {"reassembled_in": 3}),
        Heard(text(0x62, 3, b"5678901"), 0.04, {"software_version": "V23456789012345678901"}),
        Heard(ASK, 2),
    ],
    "a text with a hole is none": [
        Heard(text(0x57, 1, b"1234567"), 0),
        Heard(text(0x57, 3, b"8"), 0.02),
        Heard(ASK, 2),
    ],
    "all six texts": [
        Heard(text(0x55, 1, b"a"), 0, {"manufacturer": "a"}),
        Heard(text(0x56, 1, b"b"), 0.1, {"battery_name": "b"}),
        Heard(text(0x57, 1, b"c"), 0.2, {"battery_code": "c"}),
        Heard(text(0x62, 1, b"d"), 0.3, {"software_version": "d"}),
        Heard(text(0x63, 1, b"e"), 0.4, {"hardware_version": "e"}),
        Heard(text(0x6A, 1, b"f"), 0.5, {"serial_number": "f"}),
        Heard(ASK, 2),
    ],
    # Section 9
    "state and switches": [
        Heard(a5(1, 0x93, "000101"), 0),
        Heard(a5(1, 0x93, "000102"), 1),
        Heard(a5(1, 0x93, "020100"), 2, {"changed": ["state", "discharge_mos"], "changed_from": 2}),
        Heard(a5(1, 0x93, "020000"), 3, {"changed": ["charge_mos"], "changed_from": 3}),
        Heard(a5(2, 0x93, "010101"), 4),
    ],
    "counts, charger, load": [
        Heard(status(0, 0), 0),
        Heard(status(16, 2), 1),
        Heard(status(0, 0), 2),
        Heard(status(16, 2, charger=1, load=1), 3, {"changed": ["charger", "load"], "changed_from": 3}),
        Heard(status(15, 1, charger=2), 4, {"changed": ["cell_count", "sensor_count", "load"], "changed_from": 4}),
    ],
    "faults": [
        Heard(a5(1, 0x98, "01"), 0),
        Heard(a5(1, 0x98, "01"), 1),
        Heard(
            a5(1, 0x98, "0a"),
            2,
            {
                "fault_raised": ["cell_volt_high_level_2", "cell_volt_low_level_2"],
                "fault_cleared": ["cell_volt_high_level_1"],
                "changed_from": 2,
            },
        ),
        Heard(a5(1, 0x98, "0a00000000008007"), 3),
        Heard(
            a5(1, 0x98, "00"),
            4,
            {
                "fault_cleared": ["cell_volt_high_level_2", "cell_volt_low_level_2"],
                "changed_from": 4,
            },
        ),
    ],
    # Section 10
    "MOS switches": [
        Heard(a5(0x40, 0xDA, "01"), 0, {"write": True}),
        Heard(a5(1, 0xDA, "0155"), 0.05, {"write_result": "confirmed"}),
        Heard(a5(0x40, 0xD9, "00"), 1, {"write": True}),
        Heard(a5(1, 0xD9, "01"), 1.05, {"write_result": "denied"}),
    ],
    "any byte but 00 switches on": [  # the board tells a state, on or off, and not the byte that it was sent
        Heard(a5(0x40, 0xDA, "02"), 0, {"write": True}),
        Heard(a5(1, 0xDA, "01"), 0.05, {"write_result": "confirmed"}),
        Heard(a5(0x40, 0xD9, "ff"), 1, {"write": True}),
        Heard(a5(1, 0xD9, "01"), 1.05, {"write_result": "confirmed"}),
        Heard(a5(0x40, 0xD9, "ff"), 2, {"write": True}),
        Heard(a5(1, 0xD9, "00"), 2.05, {"write_result": "denied"}),
        Heard(a5(0x40, 0xDA, "00"), 3, {"write": True}),
        Heard(a5(1, 0xDA, "00"), 3.05, {"write_result": "confirmed"}),
        Heard(a5(0x40, 0xDA, "00"), 4, {"write": True}),
        Heard(a5(1, 0xDA, "80"), 4.05, {"write_result": "denied"}),
    ],
    "clock and SOC": [
        Heard(a5(0x40, 0x21, "170817120000 01f4".replace(" ", "")), 0, {"write": True}),
        Heard(a5(1, 0x21, "01"), 0.05, {"write_result": "confirmed"}),
        Heard(a5(0x40, 0x21, "17081712000001f4"), 1, {"write": True}),
        Heard(a5(1, 0x21, "00"), 1.05, {"write_result": "denied"}),
    ],
    "what a reply to a clock and a SOC does not tell": [  # a repeat, of the year 01 and 00 too; and any other byte
        Heard(a5(0x40, 0x21, "17081712000001f4"), 0, {"write": True}),
        Heard(a5(1, 0x21, "17081712000001f4"), 0.05, {"write_result": "answered"}),
        Heard(a5(0x40, 0x21, "01081712000001f4"), 1, {"write": True}),
        Heard(a5(1, 0x21, "01081712000001f4"), 1.05, {"write_result": "answered"}),
        Heard(a5(0x40, 0x21, "01081712000001f4"), 2, {"write": True}),
        Heard(a5(1, 0x21, "01081712000001f5"), 2.05, {"write_result": "confirmed"}),  # stale bytes behind byte 0
        Heard(a5(0x40, 0x21, "00000000000001f4"), 3, {"write": True}),
        Heard(a5(1, 0x21, "00000000000001f4"), 3.05, {"write_result": "answered"}),
        Heard(a5(0x40, 0x21, "00000000000001f4"), 4, {"write": True}),
        Heard(a5(1, 0x21, "00081712000001f4"), 4.05, {"write_result": "denied"}),
        Heard(a5(0x40, 0x21, "17081712000001f4"), 5, {"write": True}),
        Heard(a5(1, 0x21, "02"), 5.05, {"write_result": "answered"}),
    ],
    "settings and restart": [
        Heard(a5(0x40, 0x10, "000493e000000ce4"), 0, {"write": True}),
        Heard(a5(1, 0x10, "000493e000000ce4"), 0.05, {"write_result": "confirmed"}),
        Heard(a5(0x40, 0x2A, "01"), 1, {"write": True}),
        Heard(a5(1, 0x2A, "02"), 1.05, {"write_result": "answered"}),
        Heard(a5(0x40, 0x00), 2, {"write": True}),
        Heard(a5(1, 0x00), 2.05, {"write_result": "answered"}),
    ],
    "what is no write": [
        Heard(a5(0x40, 0x0F, "01"), 0),
        Heard(a5(1, 0x0F, "01"), 0.05),
        Heard(a5(0x40, 0x2B, "01"), 1),
        Heard(a5(1, 0x2B, "01"), 1.05),
        Heard(a5(0x40, 0xD8), 2),
        Heard(a5(1, 0xD8), 2.05),
    ],
    "a write sent again and its echo": [
        Heard(a5(0x40, 0xD9, "01"), 0, {"write": True, "unanswered": True}),
        Heard(a5(0x40, 0xD9, "01"), 0.05),
        Heard(a5(0x40, 0xD9, "01"), 0.5, {"write": True, "retry": True}),
        Heard(a5(1, 0xD9, "01"), 0.6, {"write_result": "confirmed"}),
        Heard(a5(0x40, 0x90), 1.2),
    ],
    # Section 11
    "91 within 20 mV of the cells": [
        Heard(status(3), 0),
        Heard(THREE, 0.1, TABLE),
        Heard(extremes(3340, 3, 3280, 1), 0.2),
    ],
    "91 beyond 20 mV of the cells": [
        Heard(status(3), 0),
        Heard(THREE, 0.1, TABLE),
        Heard(extremes(3341, 3, 3321, 1), 0.2, {"contradiction": ["cell_max", "cell_min"], "contradicts": [2, 2]}),
    ],
    "the cells against the 91 before": [
        Heard(status(3), 0),
        Heard(extremes(3320, 3, 3279, 1), 0.1),
        Heard(THREE, 0.2, {**TABLE, "contradiction": ["cell_min"], "contradicts": [2]}),
    ],
    "an old table says nothing": [
        Heard(status(3), 0),
        Heard(THREE, 0, TABLE),
        Heard(extremes(3400, 3, 3300, 1), FRAME_S + 10, {"contradiction": ["cell_max"], "contradicts": [2]}),
        Heard(extremes(3400, 3, 3300, 1), FRAME_S + 10.001),
    ],
    "a table without a count says nothing": [
        Heard(THREE, 0.1, TABLE),
        Heard(extremes(3400, 3, 3300, 1), 1),
        Heard(pack(533), 1.1),
    ],
    "after wake-up all is zero": [
        Heard(status(3), 0),
        Heard(THREE, 0.1, TABLE),
        Heard(extremes(0, 0, 0, 0), 0.2),
        Heard(pack(0), 0.3),
        Heard(cells(1, 0, 0, 0), 1, {"cells.count": 3, "cells.min_number": 1, "cells.max_number": 1}),
        Heard(extremes(3320, 3, 3300, 1), 1.1),
        Heard(pack(99), 1.2),
    ],
    "another board's cells": [
        Heard(status(3), 0),
        Heard(THREE, 0.1, TABLE),
        Heard(a5(2, 0x91, "0fa0010fa001"), 0.2),
        Heard(a5(2, 0x90, "0400"), 0.3),
    ],
    "cells that the board does not have": [
        Heard(status(3), 0),
        Heard(status(3), 0.1),
        Heard(extremes(3320, 4, 3300, 1), 0.2, {"contradiction": ["cell_number"], "contradicts": [2]}),
        Heard(extremes(3320, 3, 3300, 9), 0.3, {"contradiction": ["cell_number"], "contradicts": [2]}),
        Heard(status(0, 0), 0.4),
        Heard(extremes(3320, 3, 3300, 9), 0.5, {"contradiction": ["cell_number"], "contradicts": [2]}),
    ],
    "sensors that the board does not have": [
        Heard(status(3, 2), 0),
        Heard(heat_extremes(60, 2, 60, 3), 0.2, {"contradiction": ["sensor_number"], "contradicts": [1]}),
    ],
    "pack voltage within 1 % of the cells": [
        Heard(status(3), 0),
        Heard(cells(1, 3300, 3300, 3400), 0.1, {"cells.count": 3, "cells.min_number": 1, "cells.max_number": 3}),
        Heard(pack(101), 0.2),
        Heard(pack(99), 0.3),
        Heard(pack(102), 0.4, {"contradiction": ["pack_voltage"], "contradicts": [2]}),
        Heard(pack(98), 0.5, {"contradiction": ["pack_voltage"], "contradicts": [2]}),
        Heard(
            cells(1, 3300, 3300, 3400),
            0.6,
            {
                "cells.count": 3,
                "cells.min_number": 1,
                "cells.max_number": 3,
                "contradiction": ["pack_voltage"],
                "contradicts": [6],
            },
        ),
    ],
    "the load changed between: state": [
        Heard(status(3), 0),
        Heard(a5(1, 0x93, "000101"), 0.1),
        Heard(THREE, 0.2, TABLE),
        Heard(a5(1, 0x93, "020101"), 0.3, {"changed": ["state"], "changed_from": 2}),
        Heard(extremes(3200, 3, 3100, 1), 0.4),
        Heard(pack(94), 0.5),
        Heard(cells(1, 3100, 3150, 3200), 0.6, TABLE),
        Heard(extremes(3300, 3, 3100, 1), 0.7, {"contradiction": ["cell_max"], "contradicts": [7]}),
    ],
    "the load changed between: current": [
        Heard(status(3), 0),
        Heard(a5(1, 0x90, "00630000 7530 0200".replace(" ", "")), 0.1),
        Heard(THREE, 0.2, TABLE),
        Heard(
            a5(1, 0x90, "00600000 753a 0200".replace(" ", "")),
            0.3,
            {
                "contradiction": ["pack_voltage"],
                "contradicts": [3],
            },
        ),
        Heard(extremes(3200, 3, 3300, 1), 0.4, {"contradiction": ["cell_max"], "contradicts": [3]}),
        Heard(a5(1, 0x90, "00600000 753b 0200".replace(" ", "")), 0.5),
        Heard(extremes(3200, 3, 3300, 1), 0.6),
    ],
    "zeros after wake-up tell no state and no current": [
        Heard(status(3), 0),
        Heard(a5(1, 0x93, "020101"), 0.1),
        Heard(pack(99), 0.2),
        Heard(THREE, 0.3, TABLE),
        Heard(a5(1, 0x93), 0.4, {"changed": ["state", "charge_mos", "discharge_mos"], "changed_from": 2}),
        Heard(extremes(3400, 3, 3300, 1), 0.5, {"contradiction": ["cell_max"], "contradicts": [4]}),
        Heard(a5(1, 0x90), 0.6),
        Heard(extremes(3400, 3, 3300, 1), 0.7, {"contradiction": ["cell_max"], "contradicts": [4]}),
        Heard(pack(102), 0.8, {"contradiction": ["pack_voltage"], "contradicts": [4]}),
    ],
    "zeros before anything is known": [
        Heard(status(3), 0),
        Heard(a5(1, 0x93), 0.1),
        Heard(a5(1, 0x90), 0.2),
        Heard(THREE, 0.3, TABLE),
        Heard(a5(1, 0x93, "020101"), 0.4, {"changed": ["state", "charge_mos", "discharge_mos"], "changed_from": 2}),
        Heard(pack(102), 0.5, {"contradiction": ["pack_voltage"], "contradicts": [4]}),
        Heard(extremes(3400, 3, 3300, 1), 0.6, {"contradiction": ["cell_max"], "contradicts": [4]}),
    ],
    "a state of 0 is one where not all is zero": [
        Heard(status(3), 0),
        Heard(a5(1, 0x93, "0201010000000001"), 0.1),
        Heard(THREE, 0.2, TABLE),
        Heard(
            a5(1, 0x93, "0000000000000001"),
            0.3,
            {"changed": ["state", "charge_mos", "discharge_mos"], "changed_from": 2},
        ),
        Heard(extremes(3400, 3, 3300, 1), 0.4),
    ],
    "temperatures": [
        Heard(status(3, 2), 0),
        Heard(
            heat(1, 60, 66),
            0.1,
            {
                "sensors.count": 2,
                "sensors.min": 20,
                "sensors.min_number": 1,
                "sensors.max": 26,
                "sensors.max_number": 2,
                "sensors.average": 23.0,
                "sensors.spread": 6,
            },
        ),
        Heard(heat_extremes(68, 2, 58, 1), 0.2),
        Heard(
            heat_extremes(69, 2, 57, 1),
            0.3,
            {"contradiction": ["temperature_max", "temperature_min"], "contradicts": [2, 2]},
        ),
        Heard(heat_extremes(66, 1, 66, 1), 0.4),
        Heard(heat_extremes(255, 1, 0, 1), 0.5),
    ],
}
