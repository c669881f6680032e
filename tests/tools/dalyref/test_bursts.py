# SPDX-License-Identifier: GPL-2.0-or-later
"""Answers in several frames, counts, tables, and what is remembered: docs/records.md, sections 8 and 9."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.tools.dalyref import real
from tests.tools.dalyref.traffic import EPOCH_NS, FRAME_MS, Capture, frame

from dalyref.decoder import decode
from dalyref.packet import Packet

if TYPE_CHECKING:
    from dalyref.packet import Direction

ASK = frame(0x40, 0x95)


def cells(number: int, *voltages: int, board: int = 1, last: int = 0) -> bytes:
    """Return a 95 reply."""
    content = b"".join(voltage.to_bytes(2) for voltage in voltages)
    return frame(board, 0x95, number, *content, *bytes(6 - len(content)), last)


def counts(cell_count: int, sensor_count: int = 1, board: int = 1) -> bytes:
    return frame(board, 0x94, cell_count, sensor_count)


def burst(*frames: bytes, gap: float = 0, start: float = 0) -> Capture:
    capture = Capture()
    for at, data in enumerate(frames):
        capture.put(start + at * (FRAME_MS + gap), data)
    return capture


def test_real_burst_with_its_count() -> None:
    capture = burst(
        real.data("tano-94-1"), real.data("tano-req-95"), *(real.data(f"tano-95-{n}") for n in (1, 2, 3, 4, 5))
    )
    expected = real.ROWS[[row["id"] for row in real.ROWS].index("tano-95-seq")]["expect"]["cells_mV"]
    records = capture.read()
    assert [record.fields.get("daly.request_in") for record in records[2:]] == [2] * 5
    assert [record.fields.get("daly.response_time") is not None for record in records[2:]] == [True] + [False] * 4
    assert [record.fields.get("daly.cells.voltage") for record in records[2:]] == [None] * 4 + [expected]
    last = records[-1].fields
    assert last["daly.cell.voltage"] == [3779, 3776]
    assert last["daly.reserved"] == "0ec420"  # the third slot is stale: 14 cells
    assert last["daly.cells.count"] == 14
    assert last["daly.cells.min"] == 3740
    assert last["daly.cells.max"] == 3784
    assert last["daly.cells.spread"] == 44
    assert last["daly.cells.average"] == sum(expected) / 14
    assert all("daly.burst.missing" not in record.fields for record in records)


def test_without_a_count_the_last_record_has_the_table_of_all_slots() -> None:
    capture = burst(ASK, cells(1, 3301, 3302, 3303), cells(2, 3304, 3305, 3306))
    capture.put(200, frame(1, 0x96, 1))
    table = capture.field("daly.cells.voltage")
    assert table == [None, None, [3301, 3302, 3303, 3304, 3305, 3306], None]
    assert capture.field("daly.reserved")[1] == "00"
    assert capture.field("daly.cells.average")[2] == 3303.5


@pytest.mark.parametrize("ending", ["nothing", "quiet", "other board", "lower", "next request's"])
def test_ends_of_a_burst_without_a_count(ending: str) -> None:
    capture = burst(ASK, cells(1, 1, 2, 3), cells(2, 4, 5, 6))  # ends at 3 frames = 40.6 ms
    match ending:
        case "quiet":
            capture.put(3 * FRAME_MS + 501, cells(3, 7, 8, 9))
        case "other board":
            capture.put(60, cells(3, 7, 8, 9, board=2))
        case "lower":
            capture.put(60, cells(1, 7, 8, 9))
        case "next request's":
            capture.put(60, ASK)
            capture.put(120, cells(2, 7, 8, 9))
        case _:
            pass
    assert capture.field("daly.cells.voltage")[2] == [1, 2, 3, 4, 5, 6]


def test_limit_of_quiet_is_inside() -> None:
    capture = burst(ASK, cells(1, 1, 2, 3))
    capture.put(2 * FRAME_MS + 500, cells(2, 4, 5, 6))
    assert capture.field("daly.cells.voltage") == [None, None, [1, 2, 3, 4, 5, 6]]


def test_requests_and_echoes_do_not_end_a_burst() -> None:
    capture = burst(ASK, cells(1, 1, 2, 3), frame(0x40, 0x90), frame(0x40, 0x90), cells(2, 4, 5, 6))
    assert capture.field("daly.direction") == [1, 2, 1, 3, 2]
    assert capture.field("daly.cells.voltage")[-1] == [1, 2, 3, 4, 5, 6]
    assert capture.field("daly.request_in")[-1] == 1


def test_reply_of_another_id_ends_it() -> None:
    capture = burst(ASK, cells(1, 1, 2, 3), frame(1, 0xD8), cells(2, 4, 5, 6))
    assert capture.field("daly.cells.voltage") == [None, [1, 2, 3], None, None]
    assert capture.field("daly.burst.missing") == [None, None, None, 1]


def test_base_0() -> None:
    capture = burst(counts(5), ASK, cells(0, 1, 2, 3), cells(1, 4, 5, 6))
    records = [record.fields for record in capture.read()]
    assert records[2]["daly.cell.voltage"] == [1, 2, 3]
    assert records[3]["daly.cell.voltage"] == [4, 5]
    assert records[3]["daly.cells.voltage"] == [1, 2, 3, 4, 5]
    assert all("daly.burst.missing" not in fields for fields in records)
    # 16 frames are 0 to 15: number 16 is none of them
    capture = burst(ASK, cells(0, 1, 2, 3), cells(15, 4, 5, 6), cells(16, 7, 8, 9))
    assert capture.field("daly.cell.voltage") == [None, [1, 2, 3], [4, 5, 6], None]
    assert capture.field("daly.reserved")[3] == "00070008000900"


def test_frame_16_is_the_last_from_1() -> None:
    capture = burst(counts(48), ASK, *(cells(n, n, n, n) for n in range(1, 17)))
    assert capture.field("daly.cells.count")[-1] == 48
    assert capture.field("daly.cells.voltage")[-1] == [n for n in range(1, 17) for _ in range(3)]


@pytest.mark.parametrize(("data_id", "number"), [(0x95, 0xFF), (0x95, 17), (0x96, 4), (0x96, 0xFF)])
def test_skipped_frames(data_id: int, number: int) -> None:
    odd = frame(1, data_id, number, 1, 2, 3, 4, 5, 6, 7)
    capture = burst(frame(1, data_id, 1), odd, frame(1, data_id, 2))
    names = ("daly.cell.voltage", "daly.temperature")
    records = [record.fields for record in capture.read()]
    assert records[1]["daly.frame_number"] == number
    assert records[1]["daly.reserved"] == "01020304050607"
    assert not any(name in records[1] for name in names)
    assert not any(name.startswith("daly.burst") for fields in records for name in fields)


def test_skipped_frame_neither_ends_nor_continues() -> None:
    capture = burst(ASK, cells(1, 1, 2, 3), frame(1, 0x96, 0xFF), cells(2, 4, 5, 6))
    assert capture.field("daly.cells.voltage")[-1] == [1, 2, 3, 4, 5, 6]
    capture = burst(cells(1, 1, 2, 3))
    capture.put(FRAME_MS + 300, frame(1, 0x95, 0xFF))
    capture.put(FRAME_MS + 600, cells(2, 4, 5, 6))  # 600 ms after the last that counts
    assert capture.field("daly.burst.missing") == [None, None, 1]


def test_missing_numbers_and_no_table() -> None:
    capture = burst(counts(12), ASK, cells(1, 1, 2, 3), cells(4, 10, 11, 12))
    assert capture.field("daly.burst.missing") == [None, None, None, [2, 3]]
    assert capture.field("daly.cells.voltage") == [None] * 4
    assert capture.field("daly.cell.voltage")[-1] == [10, 11, 12]
    capture = burst(ASK, cells(3, 7, 8, 9), cells(4, 10, 11, 12))  # joined in the middle
    assert capture.field("daly.burst.missing") == [None, [1, 2], None]
    assert capture.field("daly.cells.voltage") == [None] * 3


def test_repeat_replaces_and_shows_the_table_again() -> None:
    capture = burst(counts(4), ASK, cells(1, 1, 2, 3), cells(2, 4), cells(2, 9))
    assert capture.field("daly.burst.repeat") == [None, None, None, None, True]
    assert capture.field("daly.cells.voltage") == [None, None, None, [1, 2, 3, 4], [1, 2, 3, 9]]


def test_the_same_number_after_a_request_is_a_new_burst() -> None:
    capture = Capture()
    for ms in (0, 300):  # polled faster than a burst's quiet
        capture.put(ms, frame(0x40, 0x96))
        capture.put(ms + 50, frame(1, 0x96, 1, 60))
    assert capture.field("daly.burst.repeat") == [None] * 4
    assert capture.field("daly.request_in") == [None, 1, None, 3]
    capture = Capture()
    capture.put(0, frame(0x40, 0x96))
    capture.put(20, frame(0x40, 0x96))  # an echo is no request
    capture.put(50, frame(1, 0x96, 1, 60))
    capture.put(70, frame(1, 0x96, 1, 61))
    assert capture.field("daly.burst.repeat") == [None, None, None, True]
    capture = Capture()
    capture.put(0, frame(0x40, 0x96))
    capture.put(15, frame(0x80, 0x96))
    capture.put(30, frame(1, 0x96, 1, 60))  # answers the newest
    capture.put(60, frame(0x40, 0x96))  # an echo of the first, between two frames
    capture.put(80, frame(1, 0x96, 1, 61))
    assert capture.field("daly.direction") == [1, 1, 2, 3, 2]
    assert capture.field("daly.burst.repeat") == [None, None, None, None, True]


def test_stale_slots_and_frames_beyond_the_count() -> None:
    # a host with 80 gets all 16 frames: beyond the count all is reserved
    capture = burst(counts(4), frame(0x80, 0x95), cells(1, 1, 2, 3), cells(2, 4, 5, 6), cells(3, 7, 8, 9, last=0x32))
    assert capture.field("daly.cell.voltage") == [None, None, [1, 2, 3], 4, None]
    assert capture.field("daly.reserved")[2:] == ["00", "0005000600", "00070008000932"]
    assert capture.field("daly.cells.voltage") == [None, None, None, [1, 2, 3, 4], None]


@pytest.mark.parametrize("useless", [0, 49, 255])
def test_useless_counts_leave_the_one_before(useless: int) -> None:
    capture = burst(counts(4), counts(useless, 22), ASK, cells(1, 1, 2, 3), cells(2, 4, 5, 6))
    assert capture.field("daly.cell.voltage")[-1] == 4
    capture = burst(counts(useless), ASK, cells(1, 1, 2, 3))
    assert capture.field("daly.cell.voltage")[-1] == [1, 2, 3]


def test_the_two_counts_are_judged_apart() -> None:
    capture = burst(counts(0, 2), cells(1, 1, 2, 3), frame(1, 0x96, 1, 60, 61, 62))
    assert capture.field("daly.cell.voltage")[1] == [1, 2, 3]
    assert capture.field("daly.temperature")[2] == [20, 21]


def test_counts_are_kept_by_board_and_bus() -> None:
    capture = burst(counts(4), cells(1, 1, 2, 3, board=2), cells(2, 4, 5, 6, board=2))
    assert capture.field("daly.cell.voltage")[-1] == [4, 5, 6]
    capture = Capture()
    capture.put(0, counts(4), 0)
    capture.put(20, cells(2, 4, 5, 6), 1)
    assert capture.field("daly.cell.voltage")[-1] == [4, 5, 6]


def test_a_burst_keeps_the_count_of_its_first_frame() -> None:
    # 94 in the middle ends the burst, so the count can only change from another board's reply: which ends it too
    capture = burst(counts(4), cells(1, 1, 2, 3), counts(6), cells(1, 1, 2, 3), cells(2, 4, 5, 6))
    assert capture.field("daly.cell.voltage") == [None, [1, 2, 3], None, [1, 2, 3], [4, 5, 6]]


def test_temperatures() -> None:
    capture = burst(real.data("tano-94-1"), real.data("cpy-96"), frame(1, 0x96, 2))
    assert capture.field("daly.temperature") == [None, 21, None]
    assert capture.field("daly.reserved")[1:] == ["000000000032", "00000000000000"]
    capture = burst(counts(4, 8), frame(1, 0x96, 1, 41, 42, 43, 44, 45, 46, 47), frame(1, 0x96, 2, 48, 9))
    assert capture.field("daly.temperature") == [None, [1, 2, 3, 4, 5, 6, 7], 8]
    assert capture.field("daly.reserved")[1:] == [None, "090000000000"]
    capture = burst(frame(1, 0x96, 0, 41), frame(1, 0x96, 1, 42), frame(1, 0x96, 3))  # base 0: up to 2
    assert capture.field("daly.temperature") == [[1, *[-40] * 6], [2, *[-40] * 6], None]


@pytest.mark.parametrize("data_id", [0x55, 0x56, 0x57, 0x62, 0x63, 0x6A])
def test_texts(data_id: int) -> None:
    text = b"DL-BMS-"
    capture = burst(frame(0x40, data_id), frame(1, data_id, 1, *text), frame(1, data_id, 3), frame(1, data_id, 3))
    assert capture.field("daly.frame_number") == [None, 1, 3, 3]
    assert capture.field("daly.burst.missing") == [None, None, 2, None]
    assert capture.field("daly.burst.repeat") == [None, None, None, True]
    assert capture.field("daly.request_in") == [None, 1, 1, 1]
    assert capture.field("daly.reserved") == [None] * 4


def test_frames_of_a_burst_come_later_than_the_wait() -> None:
    capture = Capture()
    capture.put(0, ASK)
    for number in range(1, 5):
        capture.put(500 * number, cells(number, 1, 2, 3))
    assert capture.field("daly.request_in") == [None, 1, 1, 1, 1]


# -- what else is remembered ------------------------------------------------------------------------------------------


def test_state_beside_the_current() -> None:
    capture = burst(
        frame(1, 0x90), frame(1, 0x93, 2), frame(1, 0x90), frame(2, 0x90), frame(1, 0x93, 1), frame(1, 0x90)
    )
    assert capture.field("daly.pack.state") == [None, None, 2, None, None, 1]


def test_faults_raised_and_cleared() -> None:
    capture = burst(
        frame(1, 0x98, 0x01),  # the first: nothing to compare with
        frame(1, 0x98, 0x82, 0x00, 0x00, 0x00, 0x00, 0x00, 0x10),
        frame(2, 0x98),  # another board
        frame(1, 0x98, 0x82, 0x00, 0x00, 0xF0, 0x00, 0x00, 0x10, 0x09),  # reserved bits and the code do not count
        frame(1, 0x98),
    )
    assert capture.field("daly.fault_raised") == [
        None,
        ["cell_volt_high_level_2", "sum_volt_low_level_2", "mos_off_by_command"],
        None,
        None,
        None,
    ]
    assert capture.field("daly.fault_cleared") == [
        None,
        "cell_volt_high_level_1",
        None,
        None,
        ["cell_volt_high_level_2", "sum_volt_low_level_2", "mos_off_by_command"],
    ]


def test_requests_echoes_and_damage_leave_memory_alone() -> None:
    damaged = counts(9)[:-1] + b"\x00"
    capture = burst(counts(4), frame(0x40, 0x94, 9, 9), frame(0x40, 0x94, 9, 9), damaged, cells(2, 4, 5, 6))
    assert capture.field("daly.kind")[3] == "bad_checksum"
    assert capture.field("daly.cell.voltage")[-1] == 4


def test_a_frame_of_tcp_that_was_begun_in_time_goes_on_with_its_burst() -> None:
    """The quiet is up to the reply's beginning (records.md 8), whatever the other side says before its last byte."""
    first, second = cells(1, 1, 2, 3), cells(2, 4, 5, 6)
    asks = bytes.fromhex("d20300200001") + b"\x96\x63"

    def piece(number: int, seconds: int, data: bytes, direction: Direction = "inbound") -> Packet:
        time_ns = EPOCH_NS + seconds * 10**9
        return Packet(number, time_ns, data, transport="tcp", connection="a", direction=direction)

    packets = [
        piece(1, 0, frame(0x40, 0x95), "outbound"),
        piece(2, 0, first + second[:5]),
        piece(3, 20, asks, "outbound"),
        piece(4, 21, second[5:]),
        piece(5, 22, frame(0x40, 0x90), "outbound"),
    ]
    records = [record for record in decode(packets) if record.number in {2, 4}]
    assert [record.fields["daly.frame_number"] for record in records] == [1, 2]
    assert records[1].fields["daly.request_in"] == 1
    assert not {"daly.unasked", "daly.burst.missing", "daly.burst.repeat"} & records[1].fields.keys()
    assert records[1].fields["daly.cell.voltage"] == [4, 5, 6]
