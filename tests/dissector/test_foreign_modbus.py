# SPDX-License-Identifier: GPL-2.0-or-later
"""Another maker's Modbus on the line is named by us, and shown by Wireshark's own dissector (docs/wires.md 5)."""

from __future__ import annotations

import random
from typing import TYPE_CHECKING

import pytest
from tests.dissector.dissection import Dissect, P, Row, a5, kinds
from tests.dissector.test_doors import ask
from tests.traffic import with_crc

from dalycapture.create import open_writer
from dalycapture.interface import Interface

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from dalytools.tshark import Tshark

REQUEST = "010300000002c40b"  # read two registers of slave 1 from 0; CRC as any Modbus manual has it
REPLY = with_crc(bytes.fromhex("01030400070009")).hex()  # 7 and 9
OURS = a5(0x40, 0x90)
THEIRS = ["mbrtu.unit_id", "modbus.func_code", "modbus.regnum16", "modbus.regval_uint16", "user_dlt.not_handled"]


def look(dissect: Dissect, packets: Sequence[P], **how: bool) -> list[Row]:
    return dissect(packets, fields=["daly.kind", "daly.foreign", "daly.undecoded", "daly.modbus.value", *THEIRS], **how)


@pytest.mark.parametrize("passes", [{"two_pass": False}, {"tree": False}, {"tree": True}], ids=["one", "two", "tree"])
def test_request_and_reply_are_shown_twice(dissect: Dissect, passes: dict[str, bool]) -> None:
    """A second apart: the reply's registers are numbered from the request, by Wireshark's dissector."""
    rows = look(dissect, [P(REQUEST), P(REPLY, 1.0), P(OURS, 2.0)], **passes)
    assert kinds(rows) == ["foreign", "foreign", "frame"]
    assert rows[0]["daly.foreign"] == ["Modbus RTU"]
    assert rows[0]["modbus.func_code"] == rows[1]["modbus.func_code"] == ["3"]
    assert rows[1]["modbus.regnum16"] == ["0", "1"]
    assert rows[1]["modbus.regval_uint16"] == ["7", "9"]
    assert "daly.modbus.value" not in rows[1]
    assert rows[1]["_ws.col.Info"] == ["Not Daly: Modbus RTU  9 bytes"]
    assert "mbrtu.unit_id" not in rows[2]
    assert not any("user_dlt.not_handled" in row for row in rows)


def test_each_frame_of_a_record(dissect: Dissect) -> None:
    """Between our frames, several in one record, and one that began in the packet before."""
    packets = [P(OURS + REQUEST + REPLY + OURS), P(REQUEST[:6], 1.0), P(REQUEST[6:] + OURS, 1.01)]
    rows = look(dissect, packets)
    assert kinds(rows) == ["frame+foreign+frame", "", "foreign+frame"]
    assert rows[0]["modbus.func_code"] == ["3", "3"]
    assert rows[0]["modbus.regval_uint16"] == ["7", "9"]
    assert rows[2]["mbrtu.unit_id"] == ["1"]


def test_our_own_modbus_is_not_handed_on(dissect: Dissect) -> None:
    rows = look(dissect, [P("d203000c000157aa"), P("d203020001fc56", 0.1), P("0a0102", 2.0)])
    assert kinds(rows) == ["frame", "frame", "foreign"]
    assert not any(name in row for row in rows for name in THEIRS)


def test_nothing_in_there_stops_us(dissect: Dissect) -> None:
    """Right CRCs around nonsense: lengths and counts that lie, every function."""
    chance = random.Random(5)
    packets: list[P] = []
    for at in range(300):
        function = chance.choice((1, 2, 3, 4, 5, 6, 15, 16, 0x81, 0x83, 0x8F, 0x90))
        size = {5: 4, 6: 4}.get(function, 1 if function > 0x80 else 4)
        body = bytes((chance.choice((0, 1, 17, 0xF7)), function)) + chance.randbytes(size)
        if function in (1, 2, 3, 4) and chance.random() < 0.7:
            count = chance.choice((1, 2, 3, 125, 249, 250))
            body = body[:2] + bytes((count,)) + chance.randbytes(count)
        elif function in (15, 16) and chance.random() < 0.7:
            count = chance.choice((1, 2, 7, 249, 250))
            body += bytes((count,)) + chance.randbytes(count)
        packets.append(P(with_crc(body).hex() + OURS, at * 2.0))
    rows = look(dissect, packets)
    ends = ["+".join(kind.split("+")[-2:]) for kind in kinds(rows)]
    assert ends.count("foreign+frame") > 290  # a few random bytes begin a frame of ours
    assert all(end.endswith("frame") for end in ends)
    assert sum("modbus.func_code" in row for row in rows) > 200  # of the others it makes nothing


def test_where_modbus_is_switched_off(tshark: Tshark, open_folder: Path) -> None:
    path = open_folder / "foreign.pcapng"
    with open_writer(path) as writer:
        writer.add_interface(Interface("made", "dalyshark bus=main"))
        writer.write_packet(1_700_000_000_000_000_000, bytes.fromhex(REQUEST))
    rows = ask(tshark, path, "--disable-protocol", "mbrtu", names=["daly.foreign", "modbus.func_code"])
    assert rows == [["Modbus RTU", ""]]
