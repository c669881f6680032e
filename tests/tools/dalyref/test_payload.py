# SPDX-License-Identifier: GPL-2.0-or-later
"""Values of single replies against what the sources say of real frames, and every fault bit."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import pytest
from tests.tools.dalyref import real

from dalyref import a5, faults, payload
from dalyref.decoder import decode
from dalyref.packet import Packet

if TYPE_CHECKING:
    from dalyref.values import Fields

# expect key -> field
SAME = {
    "pack_voltage_V": "daly.pack.voltage",
    "acquisition_voltage_V": "daly.pack.gather_voltage",
    "current_raw": "daly.pack.current_raw",
    "current_A_raw_minus_30000": "daly.pack.current",
    "soc_pct": "daly.soc",
    "max_cell_mV": "daly.cell.max_voltage",
    "max_cell_no": "daly.cell.max_number",
    "min_cell_mV": "daly.cell.min_voltage",
    "min_cell_no": "daly.cell.min_number",
    "max_temp_C": "daly.temperature.max",
    "max_temp_no": "daly.temperature.max_number",
    "min_temp_C": "daly.temperature.min",
    "min_temp_no": "daly.temperature.min_number",
    "state": "daly.state",
    "charge_mos": "daly.mos.charge",
    "discharge_mos": "daly.mos.discharge",
    "bms_life": "daly.life",
    "remaining_mAh": "daly.remaining_capacity",
    "cells": "daly.cell_count",
    "temps": "daly.sensor_count",
    "charger": "daly.charger",
    "load": "daly.load",
    "bytes5_6_u16": "daly.cycles",
    "reserved_hex": "daly.reserved",
    "frame_no": "daly.frame_number",
    "cells_mV": "daly.cell.voltage",
    "temps_C": "daly.temperature",
    "byte1": "daly.balance.active_cell",
    "fault_code": "daly.fault_code",
}
REPLIES = [row for row in real.FRAMES if row["checksum_ok"] and bytes.fromhex(row["hex"])[1] < 0x20]


def read(frame: bytes) -> Fields:
    (decoded,) = decode([Packet(1, 0, frame)])
    return decoded.fields


@pytest.mark.parametrize("row", REPLIES, ids=lambda row: row["id"])
def test_real_replies(row: real.Row) -> None:
    frame = bytes.fromhex(row["hex"])
    expect: dict[str, Any] = row.get("expect") or {}
    if not 0x90 <= frame[2] <= 0x98:
        expect = {}  # see test_settings and test_writes
    fields = read(frame)
    for key, value in expect.items():
        if key in SAME:
            assert fields[SAME[key]] == value, key
        elif key == "reserved" or key == "byte7":
            assert fields["daly.reserved"] == f"{value:02x}"
        elif key == "mask_cells":
            found = fields.get("daly.balance.cell", [])
            assert (found if isinstance(found, list) else [found]) == value
        elif key == "dio":
            pins = ("di1", "di2", "di3", "di4", "do1", "do2", "do3", "do4")
            assert sum(1 << bit for bit, pin in enumerate(pins) if fields[f"daly.{pin}"]) == value
        elif key == "bits":
            for text in value:
                assert (match := re.match(r"b(\d)\.(\d)", text))
                assert fields["daly.fault." + faults.TABLE[int(match[1])][int(match[2])]] is True
        else:
            pytest.fail(f"nothing is known of {key}")


HEADER = (
    "daly.kind",
    "daly.transport",
    "daly.dialect",
    "daly.start",
    "daly.address",
    "daly.data_id",
    "daly.length",
    "daly.data",
    "daly.checksum",
    "daly.checksum.status",
    "daly.direction",
)


def test_header_fields() -> None:
    fields = read(real.data("cpy-90"))
    assert [fields[name] for name in HEADER] == [
        "frame",
        "uart",
        "a5",
        0xA5,
        0x01,
        0x90,
        8,
        "00f8000075300181",
        0x5D,
        1,
        2,
    ]


def test_exact_tenths() -> None:
    # 29997 -> -0.3 A; 3 -> 0.3 %: dividing by ten gives the nearest double, multiplying by 0.1 does not
    fields = payload.decode(0x90, bytes.fromhex("02110003752d0003"))
    assert fields["daly.pack.voltage"] == 52.9
    assert fields["daly.pack.gather_voltage"] == 0.3
    assert fields["daly.pack.current"] == -0.3
    assert fields["daly.soc"] == 0.3


def test_types() -> None:
    status = payload.decode(0x94, bytes.fromhex("1004010181012c3a"))
    assert status == {
        "daly.cell_count": 16,
        "daly.sensor_count": 4,
        "daly.charger": 1,
        "daly.load": 1,
        "daly.di1": True,
        "daly.di2": False,
        "daly.di3": False,
        "daly.di4": False,
        "daly.do1": False,
        "daly.do2": False,
        "daly.do3": False,
        "daly.do4": True,
        "daly.cycles": 300,
        "daly.reserved": "3a",
    }
    assert all(type(status[f"daly.{pin}"]) is bool for pin in ("di1", "do4"))
    switches = payload.decode(0x93, bytes.fromhex("02010010000186a0"))
    assert switches["daly.mos.charge"] is True
    assert switches["daly.mos.discharge"] is False
    assert switches["daly.remaining_capacity"] == 100000


def test_unsigned() -> None:
    assert payload.decode(0x91, b"\xff" * 8)["daly.cell.max_voltage"] == 65535
    assert payload.decode(0x93, b"\xff" * 8)["daly.remaining_capacity"] == 4294967295
    assert payload.decode(0x92, b"\xff" * 8)["daly.temperature.max"] == 215


def test_balance_mask() -> None:
    # cell 1 = byte 0 bit 0, cell 9 = byte 1 bit 0, cell 48 = byte 5 bit 7; bytes 6-7 are reserved
    fields = payload.decode(0x97, bytes.fromhex("01010000008 0ffff".replace(" ", "")))
    assert fields == {
        "daly.balance.mask": 0x800000000101,
        "daly.balance.cell": [1, 9, 48],
        "daly.balance.active_cell": 1,
        "daly.reserved": "ffff",
    }
    assert payload.decode(0x97, bytes.fromhex("0008000000000000"))["daly.balance.cell"] == 12
    assert "daly.balance.cell" not in payload.decode(0x97, bytes(8))


# The paper's table, section 3, 0x98: (byte, bit) -> words, written out once more
PAPER = """
0 cell volt high level 1 | cell volt high level 2 | cell volt low level 1 | cell volt low level 2
0 sum volt high level 1 | sum volt high level 2 | sum volt low level 1 | sum volt low level 2
1 chg temp high level 1 | chg temp high level 2 | chg temp low level 1 | chg temp low level 2
1 dischg temp high level 1 | dischg temp high level 2 | dischg temp low level 1 | dischg temp low level 2
2 chg overcurrent level 1 | chg overcurrent level 2 | dischg overcurrent level 1 | dischg overcurrent level 2
2 soc high level 1 | soc high level 2 | soc low level 1 | soc low level 2
3 diff volt level 1 | diff volt level 2 | diff temp level 1 | diff temp level 2
4 chg mos temp high | dischg mos temp high | chg mos temp sensor | dischg mos temp sensor
4 chg mos adhesion | dischg mos adhesion | chg mos open circuit | dischg mos open circuit
5 afe collect chip | voltage collect dropped | cell temp sensor | eeprom
5 rtc | precharge | communication | internal communication
6 current module | sum voltage detect | short circuit protect | low volt forbidden chg
6 mos off by command | charging cabinet offline
"""


def paper_bits() -> list[tuple[int, int, str]]:
    bits: list[tuple[int, int, str]] = []
    used: dict[int, int] = {}
    for line in PAPER.strip().splitlines():
        byte, words = line.split(" ", 1)
        for word in words.split(" | "):
            bit = used.get(int(byte), 0)
            used[int(byte)] = bit + 1
            bits.append((int(byte), bit, "daly.fault." + word.replace(" ", "_")))
    return bits


@pytest.mark.parametrize(("byte", "bit", "name"), paper_bits())
def test_every_fault_bit(byte: int, bit: int, name: str) -> None:
    data = bytearray(8)
    data[byte] = 1 << bit
    data[7] = 3
    fields = payload.decode(0x98, bytes(data))
    flags = {key: value for key, value in fields.items() if key.startswith("daly.fault.")}
    assert len(flags) == 50
    assert [key for key, value in flags.items() if value] == [name]
    assert fields["daly.fault_code"] == 3
    state = name.endswith(("mos_off_by_command", "charging_cabinet_offline"))
    assert fields["daly.fault_count"] == (0 if state else 1)


def test_reserved_fault_bits_are_nothing() -> None:
    fields = payload.decode(0x98, bytes.fromhex("000000f00000c000"))
    assert fields["daly.fault_count"] == 0
    assert not any(value for key, value in fields.items() if key.startswith("daly.fault."))
    every = payload.decode(0x98, b"\xff" * 8)
    assert every["daly.fault_count"] == 48
    assert every["daly.fault_code"] == 255


def test_article_s_example() -> None:
    # article of 2024: total low voltage level 2 -> byte 0 is 80
    fields = payload.decode(0x98, bytes.fromhex("8000000000000000"))
    assert fields["daly.fault.sum_volt_low_level_2"] is True


# docs/protocol.md: no layout, or one that sources disagree about; 10, 21, 2A only write, so their replies tell nothing
@pytest.mark.parametrize("data_id", [0x00, 0x02, 0x10, 0x21, 0x2A, 0x58, 0x64, 0x9A])
def test_ids_without_a_layout_have_no_values(data_id: int) -> None:
    assert set(read(a5.build(1, data_id, b"\x01" * 8))) == set(HEADER) | {"daly.board"}


# records.md 5: "it is not 00, 02, 10..2A, 50..6A, 70..8A, 90..9A, D8, D9 or DA"
@pytest.mark.parametrize(
    ("first", "last", "unknown"),
    [
        (0x00, 0x00, False),
        (0x01, 0x01, True),
        (0x02, 0x02, False),
        (0x03, 0x0F, True),
        (0x10, 0x2A, False),
        (0x2B, 0x4F, True),
        (0x50, 0x6A, False),
        (0x6B, 0x6F, True),
        (0x70, 0x8A, False),
        (0x8B, 0x8F, True),
        (0x90, 0x9A, False),
        (0x9B, 0xD7, True),
        (0xD8, 0xDA, False),
        (0xDB, 0xFF, True),
    ],
)
def test_unknown_ids(first: int, last: int, unknown: bool) -> None:
    for data_id in range(first, last + 1):
        for address in (0x01, 0x40):
            assert read(a5.build(address, data_id)).get("daly.unknown_id", False) is unknown
        if unknown:
            assert set(read(a5.build(1, data_id, b"\x01" * 8))) == {*HEADER, "daly.board", "daly.unknown_id"}


def test_requests_have_no_values() -> None:
    fields = read(a5.build(0x40, 0x90, b"\xaa" * 8))
    assert set(fields) == set(HEADER) | {"daly.board"}


def test_bad_checksum_has_its_header_only() -> None:
    frame = real.data("cpy-90")[:-1] + b"\x5c"
    assert read(frame) == {
        "daly.kind": "bad_checksum",
        "daly.transport": "uart",
        "daly.dialect": "a5",
        "daly.start": 0xA5,
        "daly.address": 1,
        "daly.data_id": 0x90,
        "daly.length": 8,
        "daly.data": "00f8000075300181",
        "daly.checksum": 0x5C,
        "daly.checksum.status": 0,
    }


def test_the_other_kinds() -> None:
    assert read(bytes.fromhex("a5019008")) == {
        "daly.kind": "short",
        "daly.transport": "uart",
        "daly.undecoded": "a5019008",
    }
    assert read(b"\x00\xff") == {"daly.kind": "junk", "daly.transport": "uart", "daly.undecoded": "00ff"}
    assert read(real.data("sino-0-req") + real.data("sino-0-rsp")) == {
        "daly.kind": "foreign",
        "daly.transport": "uart",
        "daly.foreign": "Sinowealth",
        "daly.undecoded": "0a01020d03fd",
    }
    assert read(b"") == {"daly.kind": "event", "daly.transport": "uart"}
    assert read(bytes.fromhex("d203000c000157aa")) == {
        "daly.kind": "frame",
        "daly.transport": "uart",
        "daly.dialect": "d2",
        "daly.modbus.address": 0xD2,
        "daly.modbus.function": 3,
        "daly.modbus.crc": 0xAA57,
        "daly.modbus.crc.status": 1,
        "daly.modbus.register": 12,
        "daly.modbus.count": 1,
        "daly.direction": 1,
    }
    assert read(bytes.fromhex("811001400002743073f02ca9"))["daly.dialect"] == "81"
