# SPDX-License-Identifier: GPL-2.0-or-later
"""When a record began, and how sure that is. At 10,000 baud a byte takes 1 ms: sums that can be done in one's head."""

from __future__ import annotations

import pytest
from bench.adapter_model import reads, traffic

from dalycapture.framing import Framer, TimedRecord
from dalycapture.port import ASSUMED, PROMPT, Latency
from dalycapture.timing import Timing

MS = 1_000_000
FRAME = bytes.fromhex("a501900800f80000753001815d")  # cpy-90 of the real frames


def timing(hold_ms: float = 16, way_ms: float = 0) -> Timing:
    return Timing(MS, Latency(hold_ms, way_ms, "given"))


def test_a_frame_that_fits_between_two_readings() -> None:
    """13 bytes at 100 ms, held back up to 16 ms: it began at 87 or before, and its first byte ended at 84 or later."""
    one = timing()
    one.add(13, 100 * MS, 0)
    start, bound, consistent = one.estimate(0, 13)
    assert start == 85 * MS  # the middle of 83 and 87
    # half of the overlap, 1 % of thirteen bytes (0.13 ms) and half a bit (0.05 ms) on the later side
    assert bound == pytest.approx(2.18 * MS)
    assert consistent


def test_a_split_pins_it_to_one_byte() -> None:
    """5 bytes had come at 100: it began at 95 or before. The sixth had not ended then: at 94 or later."""
    one = timing()
    one.add(5, 100 * MS, 0)
    one.add(8, 116 * MS, 0)
    start, bound, _ = one.estimate(0, 13)
    assert start == 94.5 * MS
    assert bound == pytest.approx((0.5 + 0.05 + 0.05) * MS, rel=0.05)


def test_bytes_of_the_next_record_speak_of_this_one_too() -> None:
    """20 bytes at 100, all held up to 16 ms, so the first of them ended at 84 or later; but 20 take 20: by 81."""
    one = timing(hold_ms=20)
    one.add(20, 100 * MS, 0)
    first, second = one.estimate(0, 13), one.estimate(13, 7)
    assert first.start_ns == 79.5 * MS  # the middle of 79 and 80
    assert second.start_ns == 92.5 * MS  # thirteen later


def test_an_adapter_that_holds_nothing_back_is_believed_to_the_byte() -> None:
    one = timing(hold_ms=0)
    for number in range(13):
        one.add(1, (51 + number) * MS, MS // 10)
    start, bound, consistent = one.estimate(0, 13)
    assert (start, consistent) == (50 * MS - MS // 20, True)  # a byte lies in the kernel for 50 us, usually
    assert bound <= 0.2 * MS


def test_our_own_lateness_widens_the_bound() -> None:
    """We had not looked for 30 ms: the frame may have come at any time in them."""
    one = timing(hold_ms=0)
    one.add(13, 100 * MS, 30 * MS)
    start, bound, consistent = one.estimate(0, 13)
    assert (start, consistent) == (87 * MS - MS // 20, True)
    assert bound == pytest.approx((30 - 12 + 0.01) * MS, rel=0.01)  # it may have begun at 69


def test_a_sender_that_pauses_is_noticed() -> None:
    one = timing(hold_ms=6)
    one.add(6, 106 * MS, 0)  # began at 100 or before
    one.add(7, 140 * MS, 0)  # without a pause: at 127 or later
    start, bound, consistent = one.estimate(0, 13)
    assert not consistent
    assert start == 99.5 * MS  # what the first six say still holds: from 99 to 100
    assert 0.5 * MS <= bound <= 0.7 * MS


def test_an_assumed_latency_learns() -> None:
    """Thirteen bytes at once, and nobody was late: the adapter holds bytes back for 12 ms at least."""
    one = Timing(MS, PROMPT)
    one.add(13, 100 * MS, 0)
    start, bound, consistent = one.estimate(0, 13)
    assert (start, consistent) == (87 * MS, True)
    assert bound <= 0.3 * MS
    assert one.delay_ns == 12 * MS
    given = Timing(MS, Latency(0, 0, "given"))
    given.add(13, 100 * MS, 0)
    assert not given.estimate(0, 13).consistent


def errors(timer_ms: int, *, exchanges: int = 500, clock: float = 1.0, latency: Latency | None = None) -> list[float]:
    """Distance of each start from the truth in ms, as a multiple of the stated bound where that is asked."""
    sent = traffic(exchanges, 485)
    framer = Framer(latency=latency or Latency(timer_ms, 1.0, "given"))
    got: list[TimedRecord] = []
    for time_ns, data in reads(sent, timer_ms * MS, 16, clock=clock):
        got += framer.feed(data, time_ns, 300_000)
    got += framer.flush()
    assert [one.record.data for one in got] == [one.data for one in sent]
    inside = sum(abs(one.time_ns - truth.time_ns) <= one.bound_ns for one, truth in zip(got, sent, strict=True))
    assert inside >= 0.999 * len(sent)
    return sorted(abs(one.time_ns - truth.time_ns) / MS for one, truth in zip(got, sent, strict=True))


@pytest.mark.parametrize("timer_ms", [16, 4, 1])
@pytest.mark.parametrize("clock", [0.993, 1.0])
def test_truth_lies_inside_the_bound(timer_ms: int, clock: float) -> None:
    """A model of an adapter with a buffer; the sender's clock may be off. The limits are those of issue 5."""
    found = errors(timer_ms, clock=clock)
    assert found[len(found) * 95 // 100] <= 2.0
    assert found[-1] <= 3.0


def test_an_adapter_of_an_unknown_kind_is_taken_for_the_slowest() -> None:
    assert errors(16, latency=ASSUMED)[-1] <= 3.0


def test_a_frame_whose_start_is_known_need_not_be_watched() -> None:
    framer = Framer(10_000, latency=PROMPT)
    assert framer.rest_until_ns() == 0
    framer.feed(FRAME[:1], 101 * MS, MS // 10)
    assert framer.rest_until_ns() == 112 * MS  # when its twelfth byte ends
    slow = Framer(10_000, latency=Latency(16, 1, "given"))
    slow.feed(FRAME[:1], 101 * MS, MS // 10)
    assert slow.rest_until_ns() == 0  # every read tells more
    split = Framer(10_000, latency=Latency(16, 0, "given"))
    split.feed(FRAME[:1], 101 * MS, MS // 10)
    assert split.rest_until_ns() == 0
    split.feed(FRAME[1:2], 102 * MS, MS // 10)
    assert split.rest_until_ns() == 112 * MS  # two reads pin it to a byte time, and the third does no more
    junk = Framer(10_000, latency=PROMPT)
    junk.feed(b"\xff", 101 * MS, MS // 10)
    assert junk.rest_until_ns() == 0
