# SPDX-License-Identifier: GPL-2.0-or-later
"""The time of day on a clock that somebody sets."""

from __future__ import annotations

from dalycapture.clock import WallClock

S = 1_000_000_000


class Computer:
    def __init__(self) -> None:
        self.now, self.offset, self.slept = 5 * S, 1_700_000_000 * S, 0

    def clock(self) -> WallClock:
        return WallClock(lambda: self.now + self.offset, lambda: self.now, lambda: self.slept)


def test_a_step_is_told_once_and_taken_over_when_told_to() -> None:
    computer = Computer()
    clock = computer.clock()
    assert clock.time_ns(7 * S) == 1_700_000_007 * S
    computer.offset += 3_200_000_000
    assert str(clock.step()) == ("clock step: the wall clock was set forward by 3.200 s; times before it are as it was")
    assert clock.step() is None
    assert clock.time_ns(7 * S) == 1_700_000_007 * S  # not in the middle of something
    clock.adopt()
    assert clock.time_ns(7 * S) == 1_700_000_010 * S + 200_000_000
    computer.offset -= S
    assert "set back by 1.000 s" in str(clock.step())


def test_small_changes_are_no_news() -> None:
    computer = Computer()
    clock = computer.clock()
    computer.offset += 900_000
    assert clock.step() is None


def test_a_computer_that_slept() -> None:
    computer = Computer()
    clock = computer.clock()
    computer.offset += 60 * S
    computer.slept += 60 * S
    assert str(clock.step()) == "the computer slept for 60.000 s"


def test_the_real_ones() -> None:
    clock = WallClock()
    assert clock.step() is None
