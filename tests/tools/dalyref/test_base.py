# SPDX-License-Identifier: GPL-2.0-or-later
"""What the frames of a burst are counted from when its first is damaged: docs/records.md, section 8."""

from __future__ import annotations

from typing import Literal

import pytest
from tests.tools.dalyref.traffic import EPOCH_NS, Capture, frame

from dalyref.decoder import Decoded, decode
from dalyref.packet import Packet

ASK = frame(0x40, 0x95)
CHARACTER_NS = 1_041_667  # ten bits at 9600 baud
JUNK = b"\x11\x22\x33"
SHORT = b"\xa5\x01\x95\x08\x00"
FOREIGN = bytes.fromhex("010300000002c40b")  # Modbus RTU: read two registers of device 1


def cells(number: int, *voltages: int, board: int = 1) -> bytes:
    return frame(board, 0x95, number, *b"".join(voltage.to_bytes(2) for voltage in voltages))


def damaged(data: bytes) -> bytes:
    return data[:-1] + bytes((data[-1] ^ 0x40,))


def five_cells_from_0(description: str = "") -> Capture:
    """Return a board with five cells that counts its frames from 0: 1, 2, 3 | 4, 5, and a slot that is none."""
    capture = Capture()
    for at, data in enumerate((frame(1, 0x94, 5, 1), cells(0, 1, 2, 3), cells(1, 4, 5, 6))):
        capture.put(20 * at, data, description=description)
    return capture


def last(capture: Capture) -> tuple[object, object, object]:
    """Return the voltages of the last record, what is no cell in it, and which numbers are missing."""
    fields = capture.read()[-1].fields
    return (fields.get("daly.cell.voltage"), fields.get("daly.reserved"), fields.get("daly.burst.missing"))


FROM_0 = [14, 15], "001000", 0
"""Cells 4 and 5 of five; the slot behind them; number 0 is missing."""
FROM_1 = [14, 15, 16], "00", None
"""Cells 1 to 3 of five; number 1 is the first."""
NEXT = cells(1, 14, 15, 16)


def test_number_0_damaged() -> None:
    capture = five_cells_from_0()
    capture.put(1000, ASK)
    capture.put(1050, damaged(cells(0, 11, 12, 13)))
    capture.put(1070, NEXT)
    records = capture.read()
    assert [record.kind.value for record in records[3:]] == ["frame", "bad_checksum", "frame"]
    assert records[2].fields["daly.cells.voltage"] == [1, 2, 3, 4, 5]
    assert last(capture) == FROM_0
    # A list with a hole is none; and the next burst, whole again, is.
    assert "daly.cells.voltage" not in records[5].fields
    assert records[5].fields["daly.request_in"] == 4
    capture.put(2000, cells(0, 21, 22, 23))
    capture.put(2020, cells(1, 24, 25, 26))
    assert capture.read()[-1].fields["daly.cells.voltage"] == [21, 22, 23, 24, 25]


def test_numbers_0_and_1_damaged() -> None:
    capture = Capture()
    for at, data in enumerate((cells(0, 1, 2, 3), damaged(cells(0, 1, 2, 3)), damaged(NEXT), cells(2, 7, 8, 9))):
        capture.put(1000 * at, data)
    assert last(capture) == ([7, 8, 9], "00", [0, 1])


def test_first_burst_of_a_capture_counts_from_1() -> None:
    capture = Capture()
    capture.put(0, frame(1, 0x94, 5, 1))
    capture.put(50, damaged(cells(0, 11, 12, 13)))
    capture.put(70, NEXT)
    assert last(capture) == FROM_1
    # Number 0 that comes later changes nothing of it.
    capture.put(1000, cells(0, 1, 2, 3))
    assert capture.read()[2].fields["daly.cell.voltage"] == [14, 15, 16]


@pytest.mark.parametrize("before", [damaged(cells(0)), damaged(ASK), JUNK, SHORT, JUNK + SHORT, b"\xa5"])
@pytest.mark.parametrize("quiet_ms", [0, 20, 400, 100_000])
def test_damage_of_any_kind_however_long_before(before: bytes, quiet_ms: int) -> None:
    capture = five_cells_from_0()
    capture.put(1000, before)
    capture.put(1000 + len(before) * CHARACTER_NS / 1e6 + quiet_ms, NEXT)
    assert last(capture) == FROM_0


def test_events_do_not_count() -> None:
    capture = five_cells_from_0()
    capture.put(1000, JUNK)
    capture.put(1020, b"")
    capture.put(1040, NEXT)
    assert last(capture) == FROM_0


SKIPPED = cells(0xFF)


@pytest.mark.parametrize("between", [ASK, frame(2, 0x90), SKIPPED, FOREIGN, frame(1, 0x95, 17), b""])
def test_what_stands_between(between: bytes) -> None:
    """Only the record right before counts, and a foreign one is not damaged."""
    capture = five_cells_from_0()
    capture.put(1000, damaged(cells(0, 11, 12, 13)))
    if between:
        capture.put(1300, between)
    capture.put(1600, NEXT)
    assert last(capture) == (FROM_1 if between else FROM_0)


@pytest.mark.parametrize("seen", [cells(0, board=2), frame(1, 0x96, 0), frame(1, 0x57, 0), damaged(cells(0))])
def test_number_0_of_another_board_or_id_or_damaged(seen: bytes) -> None:
    capture = Capture()
    capture.put(0, frame(1, 0x94, 5, 1))
    capture.put(100, seen)
    capture.put(1000, damaged(cells(0, 11, 12, 13)))
    capture.put(1020, NEXT)
    assert last(capture) == FROM_1


def test_number_0_on_the_other_interface_of_the_bus() -> None:
    capture = five_cells_from_0("bus=one")
    capture.put(1000, damaged(cells(0)), 1, "second tap bus=one")
    capture.put(1020, NEXT, 1, "second tap bus=one")
    assert last(capture) == FROM_0
    # Of another bus nothing is known.
    capture.put(2000, damaged(cells(0)), 2, "bus=two")
    capture.put(2020, NEXT, 2, "bus=two")
    assert last(capture) == FROM_1


def test_damage_on_the_other_interface_or_side() -> None:
    capture = five_cells_from_0("bus=one")
    capture.put(1000, JUNK, 1, "second tap bus=one")
    capture.put(1020, NEXT, 0, "bus=one")
    assert last(capture) == FROM_1
    capture.put(2000, JUNK, 0, "bus=one", "outbound")
    capture.put(2020, NEXT, 0, "bus=one", "inbound")
    assert last(capture) == FROM_1
    capture.put(3000, JUNK, 0, "bus=one", "inbound")
    capture.put(3020, ASK, 0, "bus=one", "outbound")
    capture.put(3070, NEXT, 0, "bus=one", "inbound")
    assert last(capture) == FROM_0


def test_a_frame_that_goes_on_keeps_the_base_of_its_burst() -> None:
    """A burst that began at 1 is not counted anew in its middle."""
    capture = five_cells_from_0()
    capture.put(1000, cells(1, 1, 2, 3))
    capture.put(1020, JUNK)
    capture.put(1040, cells(2, 4, 5, 6))
    assert last(capture) == ([4, 5], "000600", None)


@pytest.mark.parametrize(("data_id", "number"), [(0x95, 16), (0x96, 3)])
def test_a_number_that_is_none_from_0_begins_nothing(data_id: int, number: int) -> None:
    capture = Capture()
    capture.put(0, frame(1, data_id, 0))
    capture.put(1000, JUNK)
    capture.put(1020, frame(1, data_id, number, 9, 9, 9, 9, 9, 9, 9))
    fields = capture.read()[-1].fields
    assert fields["daly.reserved"] == "09" * 7
    assert not {"daly.cell.voltage", "daly.temperature", "daly.burst.missing"} & fields.keys()
    # One less is the last that counts.
    capture.put(2000, JUNK)
    capture.put(2020, frame(1, data_id, number - 1))
    assert capture.read()[-1].fields["daly.burst.missing"] == [*range(number - 1)]


def test_the_last_number_from_1_again_after_a_request_and_damage() -> None:
    """It would begin a burst counted from 0, where it is none: skipped, the burst before goes on."""
    capture = Capture()
    for at, data in enumerate((frame(1, 0x96, 0), frame(1, 0x96, 3, 60), frame(0x40, 0x96), JUNK)):
        capture.put(600 * at, data)
    capture.put(1820, frame(1, 0x96, 3, 61))
    assert capture.read()[-1].fields["daly.reserved"] == "3d" + 6 * "00"
    assert "daly.temperature" not in capture.read()[-1].fields


def test_texts() -> None:
    capture = Capture()
    for at, data in enumerate((frame(1, 0x57, 0, *b"A"), JUNK, frame(1, 0x57, 1, *b"B"), frame(1, 0x57, 2, *b"C"))):
        capture.put(400 * at, data)
    assert capture.field("daly.burst.missing") == [None, None, 0, None]
    capture.put(3000, ASK)
    assert capture.field("daly.battery_code") == ["A", None, None, None, None]


@pytest.mark.parametrize("size", [1, 2, 3, 5, 7, 12, 13, 14, 25, 26, 27, 39, 40, 200])
def test_however_the_packets_are_cut(size: int) -> None:
    """Damaged frames 0 and 1, then 2, then the next burst from 0: cells 7 to 9 of nine, numbers 0 and 1 missing."""
    wire = frame(1, 0x94, 9, 1) + cells(0, 1, 2, 3) + cells(1, 4, 5, 6) + cells(2, 7, 8, 9) + ASK
    wire += damaged(cells(0, 11, 12, 13)) + damaged(cells(1, 14, 15, 16))[1:] + cells(2, 17, 18, 19)
    packets = [
        Packet(1 + at // size, EPOCH_NS + at * CHARACTER_NS, wire[at : at + size]) for at in range(0, len(wire), size)
    ]
    frames = [record.fields for record in decode(packets) if record.kind.value == "frame"]
    assert [fields.get("daly.cell.voltage") for fields in frames[1:4]] == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert len(frames) == 6
    assert frames[5]["daly.cell.voltage"] == [17, 18, 19]
    assert frames[5]["daly.burst.missing"] == [0, 1]


def carried(transport: Literal["ble", "tcp"], *pieces: tuple[bytes, bool]) -> list[Decoded]:
    """Decode pieces of one side of a connection: (bytes, whether bytes before them are lost)."""
    return list(
        decode(
            Packet(
                1 + at,
                EPOCH_NS + at * 10**9,
                data,
                transport=transport,
                connection="a",
                direction="inbound",
                after_gap=after_gap,
            )
            for at, (data, after_gap) in enumerate(pieces)
        )
    )


KNOWN = (frame(1, 0x94, 5, 1) + cells(0, 1, 2, 3), False)


def test_tcp() -> None:
    records = carried("tcp", KNOWN, (damaged(cells(0)), False), (NEXT, False))
    assert records[-1].fields["daly.burst.missing"] == 0
    # What is held when bytes behind it are lost does not count, whatever stood before it.
    records = carried("tcp", KNOWN, (SHORT, False), (NEXT, True))
    assert [record.kind.value for record in records] == ["frame", "frame", "short", "frame"]
    assert records[-1].fields["daly.cell.voltage"] == [14, 15, 16]
    # (A gap whose end may still become a frame is held whole.)
    records = carried("tcp", KNOWN, (damaged(cells(0)) + SHORT, False), (NEXT, True))
    assert [record.kind.value for record in records[2:]] == ["bad_checksum", "short", "frame"]
    assert records[-1].fields["daly.cell.voltage"] == [14, 15, 16]
    records = carried("tcp", KNOWN, (damaged(cells(0)), False), (SHORT, False), (NEXT, True))
    assert records[-1].fields["daly.burst.missing"] == 0


def test_bluetooth() -> None:
    records = carried("ble", KNOWN, (damaged(cells(0)), False), (NEXT, False))
    assert records[-1].fields["daly.burst.missing"] == 0
    # Bytes given up before lost ones are shown there, so they count.
    records = carried("ble", KNOWN, (SHORT, False), (NEXT, True))
    assert records[-1].fields["daly.burst.missing"] == 0


@pytest.mark.parametrize("before", [damaged(cells(0)), JUNK, JUNK + damaged(cells(0)) + JUNK])
def test_what_the_bluetooth_module_says_between(before: bytes) -> None:
    """It is foreign, whether or not the bytes before it are a record yet when it comes."""
    said = (b"AT+ROLE\r\n", False)
    for pieces in ([(before, False), said], [(before, False), said, said]):
        records = carried("ble", KNOWN, *pieces, (NEXT, False))
        assert records[-2].kind.value == "foreign"
        assert records[-1].fields["daly.cell.voltage"] == [14, 15, 16]
        records = carried("ble", KNOWN, *pieces, (before, False), (NEXT, False))
        assert records[-1].fields["daly.burst.missing"] == 0
    records = carried("ble", KNOWN, said, (before + NEXT, False))
    assert records[-1].fields["daly.burst.missing"] == 0
