# SPDX-License-Identifier: GPL-2.0-or-later
"""Times of records. Expected values are worked out by hand from c = 10 / baud."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.capture.bus import numbered, real_uart_frames

from dalycapture.framing import Framer, TimedRecord
from dalyref.kinds import Kind

if TYPE_CHECKING:
    from collections.abc import Iterable

FRAME = bytes.fromhex("a501900800f80000753001815d")  # cpy-90 of the real frames
MS = 1_000_000
T = 1_700_000_000_000_000_000
BAUD = 10_000  # a byte is 1 ms: sums that can be done in one's head


def starts(timed: Iterable[TimedRecord]) -> list[float]:
    """Start times in ms after T."""
    return [(one.time_ns - T) / MS for one in timed]


def test_a_frame_in_one_read_began_thirteen_bytes_before() -> None:
    (one,) = Framer(BAUD).feed(FRAME, T + 20 * MS)
    assert (one.record.data, one.record.kind) == (FRAME, Kind.FRAME)
    assert starts([one]) == [7.0]  # 20 - 13


def test_at_9600_a_byte_takes_ten_bits() -> None:
    (one,) = Framer(9600).feed(FRAME, T + 20 * MS)
    assert one.time_ns == T + 20 * MS - 13_541_667  # 13 * 10 / 9600 s, to the nanosecond


def test_bytes_behind_it_in_the_same_read_count() -> None:
    assert starts(Framer(BAUD).feed(FRAME * 3, T + 50 * MS)) == [11.0, 24.0, 37.0]


def test_a_frame_in_pieces_is_timed_by_the_tightest_read() -> None:
    framer = Framer(BAUD)
    assert framer.feed(FRAME[:5], T + 5 * MS) == []  # began at 0, or before
    assert starts(framer.feed(FRAME[5:], T + 16 * MS)) == [0.0]  # this read alone says 3


def test_never_later_than_the_read_of_its_first_byte() -> None:
    framer = Framer(BAUD)
    framer.feed(FRAME[:1], T)
    (one,) = framer.feed(FRAME[1:], T + 100 * MS)  # the sender paused
    assert one.time_ns <= T


def test_never_before_the_end_of_the_record_before() -> None:
    framer = Framer(BAUD)
    assert starts(framer.feed(FRAME, T + 13 * MS)) == [0.0]
    # The next comes faster than the wire could: a wrong baud rate, or a pty. It did not begin before 13.
    assert starts(framer.feed(FRAME, T + 14 * MS)) == [13.0]
    assert starts(framer.feed(FRAME, T + 15 * MS)) == [14.0]


@pytest.mark.parametrize(
    ("rest", "kind"), [(FRAME[:7], Kind.SHORT), (FRAME[:12] + b"\x00", Kind.BAD_CHECKSUM), (b"\xff\xff", Kind.JUNK)]
)
def test_flush_gives_up_what_is_incomplete(rest: bytes, kind: Kind) -> None:
    framer = Framer(BAUD)
    early = framer.feed(rest, T + 20 * MS)
    assert framer.pending == (not early)
    (one,) = early + framer.flush()
    assert (one.record.kind, one.record.data) == (kind, rest)
    assert starts([one]) == [20.0 - len(rest)]
    assert not framer.pending
    assert framer.flush() == []


def test_bytes_after_a_pause_see_it_too() -> None:
    """Quiet of more than 250 ms from the last byte's end to the next one's beginning (docs/records.md, 1)."""
    framer = Framer(BAUD)
    framer.feed(FRAME[:6], T)
    assert framer.feed(FRAME[6:7], T + 251 * MS) == []  # began at exactly 250: no silence yet
    (one,) = framer.feed(FRAME[7:], T + 260 * MS)
    assert one.record.kind is Kind.FRAME
    framer.feed(FRAME[:6], T + 1000 * MS)
    (short,) = framer.feed(FRAME[6:7], T + 1252 * MS)
    assert (short.record.kind, short.record.data) == (Kind.SHORT, FRAME[:6])


def test_no_bytes_are_no_news() -> None:
    framer = Framer()
    assert framer.feed(b"", T) == []
    assert not framer.pending


pieces = st.lists(
    st.one_of(
        st.sampled_from(real_uart_frames()),
        st.integers(0, 10**6).map(numbered),
        st.sampled_from(real_uart_frames()).map(lambda frame: frame[:7]),
        st.binary(min_size=1, max_size=20),
    ),
    max_size=8,
).map(b"".join)


@given(pieces, st.data())
def test_bytes_are_conserved_and_times_run_forward(stream: bytes, data: st.DataObject) -> None:
    framer = Framer(BAUD)
    at, now, got = 0, T, list[TimedRecord]()
    first_read: list[int] = []  # of each byte
    while at < len(stream):
        size = data.draw(st.integers(1, 30))
        piece = stream[at : at + size]
        now += data.draw(st.integers(0, 40 * MS))
        first_read += [now] * len(piece)
        got += framer.feed(piece, now)
        at += size
        if data.draw(st.integers(0, 9)) == 0:
            got += framer.flush()
    got += framer.flush()
    assert b"".join(one.record.data for one in got) == stream
    times = [one.time_ns for one in got]
    assert times == sorted(times)
    offset = 0
    for one in got:
        assert one.record.start == offset
        assert one.time_ns <= first_read[offset]
        offset += len(one.record.data)


@given(pieces, st.data())
def test_reading_byte_by_byte_changes_no_frame(stream: bytes, data: st.DataObject) -> None:
    """However the same bytes come in, with no quiet between: the same records."""
    whole, cut = Framer(BAUD), Framer(BAUD)
    expected = [one.record for one in whole.feed(stream, T) + whole.flush()]
    got: list[TimedRecord] = []
    at = 0
    while at < len(stream):
        size = data.draw(st.integers(1, 5))
        got += cut.feed(stream[at : at + size], T + at * MS)
        at += size
    got += cut.flush()
    assert [one.record for one in got] == expected


def test_a_perfect_wire_gives_perfect_times() -> None:
    """Byte by byte, each read as it ends: the estimate is the truth."""
    framer = Framer(BAUD)
    got: list[TimedRecord] = []
    truth: list[float] = []
    clock = 0
    for number in range(50):
        clock += number % 7  # idle
        truth.append(float(clock))
        for byte in numbered(number):
            clock += 1
            got += framer.feed(bytes([byte]), T + clock * MS)
    assert starts(got) == truth
