# SPDX-License-Identifier: GPL-2.0-or-later
"""Who waits when a reply comes, whatever a capture holds."""

from __future__ import annotations

from dalytools.findings.waiting import Waiting

SECOND = 1_000_000_000


def test_a_request_waits_a_second_from_its_end() -> None:
    waiting = Waiting[str, int]()
    waiting.ask("90", 5 * SECOND, 4)
    assert waiting.at("90", 5 * SECOND) == 4
    assert waiting.at("90", 6 * SECOND + 13_000_000) == 4  # a request takes 13.5 ms
    assert waiting.at("90", 6 * SECOND + 30_000_000) is None
    assert waiting.at("90", 4 * SECOND) is None
    assert waiting.at("91", 5 * SECOND) is None


def test_of_many_the_oldest_are_forgotten() -> None:
    """A capture may have a million interfaces, each a bus."""
    waiting = Waiting[int, int]()
    for bus in range(1025):
        waiting.ask(bus, 0, bus)
    waiting.ask(1, 0, 1)
    waiting.ask(1025, 0, 1025)
    assert [bus for bus in range(1026) if waiting.at(bus, 0) is None] == [0, 2]
