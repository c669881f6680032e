# SPDX-License-Identifier: GPL-2.0-or-later
"""Which request a reply answers, by docs/records.md 6 to 8: frames by hand."""

from __future__ import annotations

import pytest
from tests.tools.dalytools.findings.heard import Frame
from tests.tools.dalytools.findings.own_answers import answers


def f(seconds: float, address: int, data_id: int = 0x90, number: int = 0, size: int = 13) -> Frame:
    return Frame(seconds, size, address, data_id, bytes((number, *bytes(7))))


CASES: dict[str, tuple[list[Frame], dict[float, float]]] = {
    "one": ([f(1, 0x40), f(1.05, 1)], {1: 1.05}),
    "the newest request": ([f(1, 0x40), f(1.03, 0x20), f(1.08, 1)], {1.03: 1.08}),
    "one reply each": ([f(1, 0x40), f(1.03, 0x20), f(1.08, 1), f(1.1, 1)], {1.03: 1.08, 1: 1.1}),
    "its own board": ([f(1, 0x41), f(1.05, 1), f(1.08, 2)], {1: 1.08}),
    "40 takes any board": ([f(1, 0x40), f(1.05, 7)], {1: 1.05}),
    "of its ID": ([f(1, 0x40), f(1.05, 1, 0x93)], {}),
    "a second at the most": ([f(1, 0x40), f(2.02, 1)], {}),
    "just within": ([f(1, 0x40), f(2.01, 1)], {1: 2.01}),
    "an echo waits for nothing": ([f(1, 0x40), f(1.05, 0x40), f(1.09, 1), f(1.12, 1)], {1: 1.09}),
    "nothing on CAN is an echo": ([f(1, 0x40, size=16), f(1.05, 0x40, size=16), f(1.09, 1)], {1.05: 1.09}),
    "a retry waits": ([f(1, 0x40), f(1.2, 0x40), f(1.25, 1), f(1.3, 1)], {1.2: 1.25, 1: 1.3}),
    "a burst is one answer": (
        [f(1, 0x40, 0x95), f(1.2, 0x40, 0x95), *(f(1.25 + number / 70, 1, 0x95, number) for number in (1, 2, 3))],
        {1.2: 1.25 + 1 / 70},
    ),
    "a lower number is another": (
        [f(1, 0x40, 0x95), f(1.2, 0x40, 0x95), f(1.25, 1, 0x95, 2), f(1.27, 1, 0x95, 1)],
        {1.2: 1.25, 1: 1.27},
    ),
    "the same number is a repeat": (
        [f(1, 0x40, 0x95), f(1.2, 0x40, 0x95), f(1.25, 1, 0x95, 1), f(1.27, 1, 0x95, 1)],
        {1.2: 1.25},
    ),
    "but not behind a request": (
        [f(1, 0x40, 0x96), f(1.25, 1, 0x96, 1), f(1.3, 0x40, 0x96), f(1.35, 1, 0x96, 1)],
        {1: 1.25, 1.3: 1.35},
    ),
    "another reply ends a burst": (
        [f(1, 0x40, 0x95), f(1.2, 0x40, 0x95), f(1.25, 1, 0x95, 1), f(1.27, 1, 0x93), f(1.29, 1, 0x95, 2)],
        {1.2: 1.25, 1: 1.29},
    ),
    "FF is skipped": ([f(1, 0x40, 0x95), f(1.25, 1, 0x95, 0xFF), f(1.27, 1, 0x95, 1)], {1: 1.27}),
}


@pytest.mark.parametrize("name", CASES)
def test_which_request_is_answered(name: str) -> None:
    frames, expected = CASES[name]
    data_id = frames[0].data_id
    given = answers(frames, data_id, 1, 2)
    assert {request.seconds: reply.seconds for request, reply in given.items()} == expected
