# SPDX-License-Identifier: GPL-2.0-or-later
"""Windows of the two Modbus dialects: vendor's article of 2024, field notes d, real frames."""

from __future__ import annotations

import pytest
from tests.tools.dalyref import real

from dalyref import modbus
from dalyref.kinds import Dialect, Kind
from dalyref.records import split

SINGLE = [row for row in real.ROWS if row["transport"] in {"modbus", "ble"} and row["checksum_ok"]]


def with_crc(head: str) -> bytes:
    data = bytes.fromhex(head)
    return data + modbus.crc(data).to_bytes(2, "little")


@pytest.mark.parametrize(
    ("frame", "dialect"),
    [
        ("d203000c000157aa", Dialect.D2),  # the article's read
        ("d203020001fc56", Dialect.D2),  # and its reply
        ("d206000c00019baa", Dialect.D2),
        ("d210000c0002000100027d65", Dialect.D2),  # write many, no byte count
        ("d210000c00029268", Dialect.D2),  # its reply
        ("811001400002743073f02ca9", Dialect.P81),  # the vendor's app
        ("d21000d40003180b0709341cf7d8", Dialect.D2),
    ],
)
def test_papers_and_field(frame: str, dialect: Dialect) -> None:
    data = bytes.fromhex(frame)
    assert [(record.data, record.kind, record.dialect) for record in split(data)] == [(data, Kind.FRAME, dialect)]


def test_the_bluetooth_modules_own_is_no_frame_of_a_board() -> None:
    """Field notes e: 81 10 0F05, which the module answers as 51 10 0F05 AAAA."""
    asked = bytes.fromhex("81100f05000200000000876a")
    answered = bytes.fromhex("51100f05aaaa")
    answered += modbus.crc(answered).to_bytes(2, "little")
    for data in (asked, answered):
        assert [(one.data, one.kind, one.foreign) for one in split(data)] == [(data, Kind.FOREIGN, "Bluetooth module")]


@pytest.mark.parametrize("row", SINGLE, ids=lambda row: row["id"])
def test_real_modbus(row: real.Row) -> None:
    data = bytes.fromhex(row["hex"])
    assert b"".join(record.data for record in split(data)) == data
    assert [record.kind for record in split(data)] == [Kind.FRAME]


@pytest.mark.parametrize(
    "head",
    [
        "d21000d400010200ff",  # write many with byte count, 9 + 2
        "811000d400010200ff",
        "511000d40005",  # reply to a write many
        "5106012100 01",
        "8106012100 01",
        "d28302",  # exceptions
        "51830 2",
        "608602",
        "519003",
        "5103 02 0000",  # the shortest read reply
        "5103 fc" + "11" * 252,  # and the longest
        "d210 0000 007b" + "22" * 246,  # 123 registers
        "d210 0000 007b f6" + "22" * 246,
    ],
)
def test_windows(head: str) -> None:
    data = with_crc(head.replace(" ", ""))
    records = split(b"\x00" + data + b"\x01")
    assert [(record.data, record.kind) for record in records] == [
        (b"\x00", Kind.JUNK),
        (data, Kind.FRAME),
        (b"\x01", Kind.JUNK),
    ]


@pytest.mark.parametrize(
    "head",
    [
        "5103 03 000000",  # odd byte count
        "5103 00",
        "5103 fe" + "11" * 254,
        "510300000001",  # a request with a reply's address
        "8103 02 0000",  # a reply with a request's address
        "5006000c0001",  # 50 and 61 are no addresses
        "6106000c0001",
        "8006000c0001",
        "9106000c0001",
        "d304000c0001",
        "818302",  # an exception never comes from 80+N
        "d28402",
        "d2100000 0000",  # a count of 0 is good only as a reply: see below
        "81100000 007c" + "22" * 248,  # 124 registers
        "81100000 0000",
        "51100000 0001 0002",  # 50+N never asks
    ],
)
def test_no_windows(head: str) -> None:
    data = with_crc(head.replace(" ", ""))
    reply = head.startswith("d210")  # fits the reply of a write, whose count may be any
    assert any(record.kind is Kind.FRAME for record in split(data)) is reply


def test_shorter_of_two_lengths() -> None:
    # After a right CRC the check is 0; 00 behind it gives 0 again. So the standard's form (one byte longer) of a write
    # whose first data byte looks like a byte count would check too when 00 follows.
    short = with_crc("8110000000010234")
    assert len(short) == 10
    assert modbus.crc(short + b"\x00") == 0
    records = split(short + b"\x00")
    assert [record.data for record in records] == [short, b"\x00"]


def test_probe_with_wrong_crc_is_no_frame() -> None:
    # field notes d: `D2030000007E 90AA` circulates, the right CRC is D649. Not cut off, so it is junk.
    assert modbus.crc(bytes.fromhex("d2030000007e")) == 0x49D6
    assert [record.kind for record in split(bytes.fromhex("d2030000007e90aa"))] == [Kind.JUNK]
