# SPDX-License-Identifier: GPL-2.0-or-later
"""Classic CAN: real frames, which frames are Daly's, requests and replies (docs/wires.md, 2)."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.tools.dalyref import real
from tests.tools.dalyref.can import CanCapture
from tests.tools.dalyref.traffic import at

from dalyref.decoder import decode
from dalyref.packet import CanFrame

REAL = [row for row in real.ROWS if row["transport"] == "can"]
OURS = [row for row in REAL if row.get("kind") != "foreign" and not row.get("synthetic")]
FOREIGN = [row for row in REAL if row.get("kind") == "foreign"]
PACK = ("18904001", "01070000753002bc")
"""Real frame can212-90: board 1, 26.3 V, 0 A, 70 %."""

# What can212's source and the layouts of the paper say, worked out by hand.
EXPECTED: dict[str, dict[str, Any]] = {
    "can212-90": {"pack.voltage": 26.3, "pack.current": 0.0, "pack.current_raw": 30000, "soc": 70.0},
    "can212-91": {"cell.max_voltage": 3296, "cell.max_number": 1, "cell.min_voltage": 3294, "cell.min_number": 4,
                  "reserved": "ffff"},
    "can212-92": {"temperature.max": 21, "temperature.max_number": 2, "temperature.min": 19,
                  "temperature.min_number": 1, "reserved": "ffffffff"},
    "can212-93": {"state": 0, "mos.charge": True, "mos.discharge": True, "life": 69, "remaining_capacity": 141400},
    "can212-94": {"cell_count": 8, "sensor_count": 2, "charger": 0, "load": 0, "di2": False, "cycles": 0,
                  "reserved": "40"},
    "can212-95-1": {"frame_number": 1, "cell.voltage": [3296, 3295, 3295], "reserved": "00"},
    "can212-95-2": {"frame_number": 2, "cell.voltage": [3294, 3296, 3295], "reserved": "00"},
    "can212-95-3": {"frame_number": 3, "cell.voltage": [3294, 3296, 3295], "reserved": "00"},
}  # fmt: skip


@pytest.mark.parametrize("row", OURS, ids=[row["id"] for row in OURS])
def test_real_frames(row: real.Row) -> None:
    capture = CanCapture()
    capture.put(0, row["can_id"], row["hex"])
    (record,) = capture.read()
    expected = {f"daly.{name}": value for name, value in EXPECTED[row["id"]].items()}
    assert {name: record.fields.get(name) for name in expected} == expected
    head = {"kind": "frame", "transport": "can", "dialect": "a5", "data_id": int(row["can_id"][2:4], 16),
            "direction": 2, "board": 1, "can.priority": 0x18, "can.destination": 0x40, "can.source": 1,
            "data": row["hex"]}  # fmt: skip
    assert {name: record.fields.get(f"daly.{name}") for name in head} == head
    assert record.data == bytes.fromhex(row["hex"])
    assert (record.transport, record.number, record.time_ns) == ("can", 1, at(0))
    for name in ("start", "address", "length", "checksum", "checksum.status", "unasked", "can.register", "can.remote"):
        assert f"daly.{name}" not in record.fields


def test_the_real_burst_of_8_cells_has_its_table_in_the_third_frame() -> None:
    capture = CanCapture()
    for ms, name in enumerate(("can212-94", "can212-95-1", "can212-95-2", "can212-95-3")):
        row = next(row for row in REAL if row["id"] == name)
        capture.put(ms * 1.4, row["can_id"], row["hex"])
    fields = capture.fields()
    assert fields[4]["daly.cells.voltage"] == [3296, 3295, 3295, 3294, 3296, 3295, 3294, 3296]
    assert fields[4]["daly.cells.count"] == 8
    assert fields[4]["daly.cell.voltage"] == [3294, 3296]  # the third slot is stale
    assert fields[4]["daly.reserved"] == "0cdf00"
    assert [fields[n].get("daly.reassembled_in") for n in (2, 3, 4)] == [4, 4, None]


@pytest.mark.parametrize("row", FOREIGN, ids=[row["id"] for row in FOREIGN])
def test_real_foreign_frames_are_named_once_daly_was_seen(row: real.Row) -> None:
    capture = CanCapture()
    capture.put(0, row["can_id"], row["hex"])  # nobody knows yet
    capture.put(1, *PACK)
    capture.put(2, row["can_id"], row["hex"])
    fields = capture.fields()
    assert list(fields) == [2, 3]
    assert fields[3] == {
        "daly.kind": "foreign",
        "daly.transport": "can",
        "daly.foreign": "Victron/Pylontech",
        "daly.undecoded": row["hex"],
    }


def test_the_papers_example_is_a_write_only_where_daly_speaks() -> None:
    capture = CanCapture()
    capture.put(0, "18100140", "0000000000000000")  # seed-req: 0x10 writes the rated capacity
    capture.put(1, *PACK)
    capture.put(2, "18100140", "0000000000000000")
    fields = capture.fields()
    assert list(fields) == [2, 3]
    assert (fields[3]["daly.data_id"], fields[3]["daly.direction"], fields[3]["daly.board"]) == (0x10, 1, 1)
    assert fields[3]["daly.write"] is True


@pytest.mark.parametrize(
    ("identifier", "ours"),
    [
        ("18900140", True), ("18984010", True), ("18908001", True), ("18900120", True), ("189E0140", False),
        ("18904f10", True), ("18904011", False), ("18900101", False), ("18904040", False), ("18900050", False),
        ("18900030", False), ("18900081", False), ("18904000", False), ("19900140", False), ("08900140", False),
        ("18DA0140", False), ("18DB0140", False), ("188F0140", False), ("18990140", False), ("00900140", False),
        ("18FEF140", False), ("18F00180", False), ("04000180", False), ("00004210", False), ("351", False),
    ],
)  # fmt: skip
def test_which_frames_are_daly_s_from_the_first_on(identifier: str, *, ours: bool) -> None:
    capture = CanCapture()
    capture.put(0, identifier, "0000000000000000")
    assert bool(capture.read()) is ours


@pytest.mark.parametrize(
    ("identifier", "what"),
    [
        ("18DA0140", "a5"), ("18500140", "a5"), ("18F00180", "Deye"), ("18F10180", "Deye"), ("18F00140", None),
        ("18F10140", None), ("00004200", "Pylontech-HV"), ("000042ff", "Pylontech-HV"), ("00004300", None),
        ("000041ff", None), ("350", None), ("351", "Victron/Pylontech"), ("355", "Victron/Pylontech"),
        ("356", "Victron/Pylontech"), ("357", None), ("35A", "Victron/Pylontech"), ("35E", "Victron/Pylontech"),
        ("35F", "Victron/Pylontech"), ("36F", None), ("370", "Victron/Pylontech"), ("377", "Victron/Pylontech"),
        ("378", None), ("379", "Victron/Pylontech"), ("37A", None), ("00000351", None), ("04008001", "HKMS or Deye"),
        ("040E4010", "HKMS or Deye"), ("04008011", None), ("040F8001", None), ("03FF8001", None), ("161E0180", "hkms"),
        ("182A0180", "a5"), ("181E0180", "a5"), ("18DA01F1", None), ("1CEBFF01", None),
    ],
)  # fmt: skip
def test_which_frames_are_told_once_daly_was_seen(identifier: str, what: str | None) -> None:
    capture = CanCapture()
    capture.put(0, *PACK)
    number = capture.put(1, identifier, "0102030405060708")
    assert capture.kinds().get(number) == what


def test_other_interfaces_are_other_buses() -> None:
    capture = CanCapture()
    capture.put(0, *PACK)
    capture.put(1, "351", "00", interface=1)
    capture.put(2, "18904002", PACK[1], interface=1)
    capture.put(3, "18900140", interface=0)
    capture.put(4, "18904001", PACK[1], interface=1)
    fields = capture.fields()
    assert list(fields) == [1, 3, 4, 5]
    assert "daly.request_in" not in fields[5]


def test_neither_fd_nor_standard_remote_frames_are_ours() -> None:
    capture = CanCapture()
    capture.put(0, *PACK)
    capture.put(1, "18904001", "00" * 12)
    capture.put(2, "351", remote=True)
    assert list(capture.fields()) == [1]


def test_remote_frames_are_requests_without_bytes() -> None:
    capture = CanCapture()
    capture.put(0, "18900140", remote=True)
    capture.put(20, *PACK)
    asked, told = capture.fields().values()
    assert asked["daly.can.remote"] is True
    assert "daly.data" not in asked
    assert (asked["daly.direction"], asked["daly.reply_in"], told["daly.request_in"]) == (1, 2, 1)


def test_a_request_of_no_bytes_is_answered_after_20_ms() -> None:
    capture = CanCapture()
    capture.put(0, "18900140")
    capture.put(20, *PACK)
    asked, told = capture.fields().values()
    assert asked["daly.reply_in"] == 2
    assert told["daly.response_time"] == pytest.approx(0.020, abs=1e-9)  # a frame takes no time
    assert "daly.data" not in asked


def test_a_request_takes_the_reply_of_its_destination_alone() -> None:
    capture = CanCapture()
    capture.put(0, "18900140")
    capture.put(10, "18904002", PACK[1])
    capture.put(20, *PACK)
    fields = capture.fields()
    assert (fields[1]["daly.board"], fields[1]["daly.reply_in"]) == (1, 3)
    assert (fields[2]["daly.unasked"], fields[2]["daly.other_board"]) == (True, True)
    assert "daly.other_board" not in fields[3]


def test_a_request_again_is_a_retry_never_an_echo() -> None:
    capture = CanCapture()
    capture.put(0, "18900140")
    capture.put(50, "18900140")
    capture.put(60, "18900140", "00")  # other bytes: another request
    capture.put(70, *PACK)
    fields = capture.fields()
    assert [fields[n]["daly.direction"] for n in (1, 2, 3)] == [1, 1, 1]
    assert [fields[n].get("daly.retry") for n in (1, 2, 3)] == [None, True, None]
    assert fields[4]["daly.request_in"] == 3


def test_hosts_are_told_by_their_source() -> None:
    capture = CanCapture()
    capture.put(0, "18900140")
    capture.put(100, "18910241")  # 40 to 4F are one host
    capture.put(200, "18900180")
    capture.put(300, "18900120")
    fields = capture.fields()
    assert [fields[n].get("daly.second_host") for n in (1, 2, 3, 4)] == [None, None, True, True]


def test_unanswered_is_known_from_records_of_ours_alone() -> None:
    for identifier, known in (("18904002", True), ("351", True), ("123", False)):
        capture = CanCapture()
        capture.put(0, "18910140")
        capture.put(1001.5, identifier, "00")
        assert capture.fields()[1].get("daly.unanswered") == (True if known else None)


def test_a_foreign_frame_lets_no_request_wait_longer_or_shorter() -> None:
    capture = CanCapture()
    capture.put(0, "18900140")
    capture.put(1500, "351", "00")
    capture.put(900, *PACK)  # the clock stepped back: the request had not been given up
    assert capture.fields()[3]["daly.request_in"] == 1


def test_a_short_reply_belongs_to_its_request_and_is_nothing_else() -> None:
    capture = CanCapture()
    capture.put(0, "18950140")
    capture.put(10, "18954001", "010ce00cdf0cdf00")
    capture.put(12, "18950180")
    capture.put(14, "18954001", "020cde")  # three bytes
    capture.put(16, "18954001", "020cde0ce00cdf00")
    capture.put(18, "18930140")
    capture.put(20, "18934001", "0101010000")
    fields = capture.fields()
    assert (fields[4]["daly.request_in"], fields[4]["daly.data"]) == (3, "020cde")
    assert "daly.frame_number" not in fields[4]
    assert "daly.burst.missing" not in fields[5]
    assert fields[5]["daly.request_in"] == 1
    assert fields[7]["daly.request_in"] == 6
    assert "daly.state" not in fields[7]


def test_writes_and_their_results() -> None:
    capture = CanCapture()
    capture.put(0, *PACK)
    capture.put(1, "18D90140", "0100000000000000")
    capture.put(2, "18D94001", "0100000000000000")
    capture.put(3, "18D90140", "0100000000000000")
    capture.put(4, "18D94001", "0000000000000000")
    capture.put(5, "18DA0140", "01")
    capture.put(6, "18DA4001", "0100000000000000")
    capture.put(7, "18DA0140", "0100000000000000")
    capture.put(8, "18DA4001", "01")
    fields = capture.fields()
    assert [fields[n].get("daly.write") for n in (2, 4, 6, 8)] == [True] * 4
    assert [fields[n].get("daly.write_result") for n in (3, 5, 7, 9)] == ["confirmed", "denied", None, None]
    assert [fields[n]["daly.request_in"] for n in (3, 5, 7, 9)] == [2, 4, 6, 8]


_SHAPES = (0x18900140, 0x18904001, 0x18950140, 0x18954001, 0x18964002, 0x18980201, 0x18D90140, 0x18D94001, 0x181E0180,
           0x0400FF80, 0x04008001, 0x04018001, 0x04088001, 0x040E8002, 0x182A0180, 0x161E0180, 0x18F00180, 0x4200,
           0x351)  # fmt: skip
identifiers = st.sampled_from(_SHAPES) | st.integers(0, 0x1FFFFFFF)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.tuples(identifiers, st.binary(max_size=9), st.integers(0, 2000), st.integers(0, 1), st.booleans()),
        max_size=40,
    )
)
def test_any_frames_are_read_without_an_error_each_at_most_once(
    rows: list[tuple[int, bytes, int, int, bool]],
) -> None:
    time, frames = 0, list[CanFrame]()
    for number, (identifier, data, later, interface, extended) in enumerate(rows, 1):
        time += later * 1_000_000
        shown = identifier if extended else identifier & 0x7FF
        frames.append(
            CanFrame(number=number, time_ns=time, data=data, interface=interface, identifier=shown, extended=extended)
        )
    records = list(decode(frames))
    numbers = [record.number for record in records]
    assert numbers == sorted(set(numbers))
    assert all(record.data == frames[record.number - 1].data for record in records)


def test_memory_stays_bounded() -> None:
    """As many different requests as there can be: what is remembered of them is not."""
    from dalyref.decoder import Decoder

    decoder = Decoder()
    decoder.feed(CanFrame(number=1, time_ns=0, data=bytes(8), identifier=0x18904001))
    out = 0
    for number in range(2, 30_000):
        frame = CanFrame(number=number, time_ns=number * 10**6, data=number.to_bytes(8), identifier=0x18900140)
        out += len(decoder.feed(frame))
    assert 26_000 < out < 30_000  # about two seconds are held


CELLS = ("010ce00cdf0cdf00", "020cde0ce00cdf00", "030cde0ce00cdf00")
"""Real burst can212-95: 8 cells, the first 3296 mV."""
STATUS = "0802000000000040"
"""Real frame can212-94: 8 cells, 2 sensors."""


def test_a_reply_belongs_to_the_request_of_the_host_that_it_is_sent_to() -> None:
    """Field notes c.1: destination | source. Both switch the discharge MOS; each is answered as it asked."""
    capture = CanCapture()
    off, on = "00" * 8, "01" + "00" * 7
    capture.put(0, "18900140", off)
    capture.put(1, "18900180", off)
    capture.put(2, "18904001", PACK[1])
    capture.put(3, "18908001", PACK[1])
    capture.put(10, "18D90140", off)
    capture.put(11, "18D90180", on)
    capture.put(12, "18D94001", off)
    capture.put(13, "18D98001", on)
    fields = capture.fields()
    assert {n: fields[n]["daly.request_in"] for n in (3, 4, 7, 8)} == {3: 1, 4: 2, 7: 5, 8: 6}
    assert [fields[n]["daly.response_time"] for n in (3, 4)] == [0.002, 0.002]
    assert [fields[n]["daly.write_result"] for n in (7, 8)] == ["confirmed", "confirmed"]


def test_hosts_40_to_4f_are_one_and_a_reply_to_nobody_who_asked_answers_the_newest() -> None:
    capture = CanCapture()
    capture.put(0, "18900141")
    capture.put(1, "18904001", PACK[1])
    capture.put(2, "18910180")
    capture.put(3, "18914001", "0ce0010cde040000")
    fields = capture.fields()
    assert (fields[2]["daly.request_in"], fields[4]["daly.request_in"]) == (1, 3)


def test_bursts_of_two_boards_run_side_by_side() -> None:
    capture = CanCapture()
    capture.put(0, "18944001", STATUS)
    capture.put(1, "18944002", STATUS)
    capture.put(2, "18950140")
    capture.put(3, "18950240")
    for ms, part in enumerate(CELLS):
        capture.put(10 + 2 * ms, "18954001", part)
        capture.put(11 + 2 * ms, "18954002", part)
        capture.put(11.5 + 2 * ms, "18904002", PACK[1])
    fields = capture.fields()
    for n, request, whole in ((5, 3, 11), (6, 4, None), (8, 3, 11), (9, 4, None), (11, 3, None), (12, 4, None)):
        assert fields[n].get("daly.request_in", 4) == request
        assert fields[n].get("daly.reassembled_in") == whole
    assert fields[11]["daly.cells.voltage"] == [3296, 3295, 3295, 3294, 3296, 3295, 3294, 3296]
    assert "daly.burst.cut_off" not in fields[5].keys() | fields[8].keys() | fields[11].keys()
    # Board 2's own 0x90 ends its bursts each time.
    assert fields[6]["daly.burst.cut_off"] is True


def test_bursts_of_one_board_to_two_hosts_run_side_by_side() -> None:
    capture = CanCapture()
    capture.put(0, "18944001", STATUS)
    capture.put(1, "18950140")
    capture.put(2, "18950180")
    for ms, part in enumerate(CELLS):
        capture.put(10 + 2 * ms, "18954001", part)
        capture.put(11 + 2 * ms, "18958001", part)
    fields = capture.fields()
    assert [fields[n]["daly.request_in"] for n in range(4, 10)] == [2, 3, 2, 3, 2, 3]
    assert [fields[n].get("daly.reassembled_in") for n in range(4, 10)] == [8, 9, 8, 9, None, None]
    for n in (8, 9):
        assert fields[n]["daly.cells.count"] == 8
    assert not any("daly.burst.repeat" in fields[n] for n in range(4, 10))


def test_only_a_request_to_its_board_makes_the_same_number_a_new_burst() -> None:
    capture = CanCapture()
    sensors = "01323200000000ff"
    capture.put(0, "18960140")
    capture.put(1, "18964001", sensors)
    capture.put(2, "18960240")
    capture.put(3, "18964001", sensors)
    capture.put(4, "18960140")
    capture.put(5, "18964001", sensors)
    fields = capture.fields()
    assert fields[4]["daly.burst.repeat"] is True
    assert "daly.burst.repeat" not in fields[6]
    assert fields[6]["daly.request_in"] == 5


def test_what_ends_with_the_capture_is_told_of_every_burst() -> None:
    """Two bursts without a count, both running at the end: each last frame carries its table (records.md 8)."""
    capture = CanCapture()
    for ms, part in enumerate(CELLS[:2]):
        capture.put(2 * ms, "18954001", part)
        capture.put(1 + 2 * ms, "18954002", part)
    fields = capture.fields()
    assert [fields[n].get("daly.cells.count") for n in (1, 2, 3, 4)] == [None, None, 6, 6]
    assert [fields[n].get("daly.reassembled_in") for n in (1, 2)] == [3, 4]
