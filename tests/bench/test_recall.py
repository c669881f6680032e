# SPDX-License-Identifier: GPL-2.0-or-later
"""Recall on buses by lot, a few of each kind: the short form of ``make bench ARGS=recall``."""

from __future__ import annotations

from collections import Counter

import pytest

from bench import recall, recall_buses


@pytest.mark.parametrize("number", [5, 7, 10])
def test_every_fault_is_found_and_none_invented(number: int) -> None:
    sum_ = recall.judged(number)
    assert sum_.said == []
    assert sum_.injected.total() > 100
    assert sum_.hidden.total() < 0.05 * sum_.injected.total()


def test_the_same_number_is_the_same_bus_and_all_kinds_come() -> None:
    assert recall_buses.bus(3) == recall_buses.bus(3) != recall_buses.bus(7)
    assert Counter(recall_buses.bus(number).about for number in range(8)) == dict.fromkeys(recall_buses.KINDS, 2)


def test_a_miss_and_an_invention_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(recall.FOUND_BY, "write", recall.FOUND_BY["echo"])
    assert any("missed" in said and "'write'" in said for said in recall.judged(5).said)
