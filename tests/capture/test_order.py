# SPDX-License-Identifier: GPL-2.0-or-later
"""Several sides in the order of time."""

from __future__ import annotations

from dalycapture.framing import TimedRecord
from dalycapture.order import Event, Order
from dalyref.kinds import Kind, Record


def record(time_ns: int, side: int) -> TimedRecord:
    return TimedRecord(time_ns, Record(0, b"x", Kind.JUNK), side=side)


def test_nothing_overtakes_what_may_still_come() -> None:
    order = Order()
    late, early = record(20, 0), record(10, 1)
    order.put(late)
    assert list(order.due([25, 5])) == []  # side 1 may bring something that began at 5
    order.put(early)
    assert list(order.due([25, 15])) == [early]
    assert (len(order), order.oldest_ns) == (1, 20)
    assert list(order.due([0, 20])) == [late]  # its own side does not hold it back
    assert order.oldest_ns is None


def test_an_event_waits_for_all() -> None:
    order = Order()
    event = Event(10, "x")
    order.put(event)
    assert list(order.due([5])) == []
    assert list(order.due([10])) == [event]


def test_what_began_together_keeps_its_order() -> None:
    order = Order()
    items = [record(10, 0), Event(10, "x"), record(10, 1)]
    for item in items:
        order.put(item)
    assert list(order.rest()) == items
