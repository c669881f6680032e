# SPDX-License-Identifier: GPL-2.0-or-later
"""However many payloads come, what is kept of them is bounded, and counts stay exact."""

from __future__ import annotations

import random
from array import array
from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from dalytools.survey.known import COUNT
from dalytools.survey.moves import Moves
from dalytools.survey.samples import MOST_RUNS, RUN, Samples


def test_samples_are_runs_from_all_over() -> None:
    samples, known = Samples(), array("d", bytes(8 * COUNT))
    for number in range(200_000):
        samples.add(number, (number & 0xFFFFFFFF).to_bytes(4), known)
    runs = samples.runs()
    assert len(runs) <= MOST_RUNS
    assert all(list(run.times) == list(range(run.times[0], run.times[0] + len(run.times))) for run in runs)
    assert all(len(run.times) == RUN for run in runs[:-1])
    assert all(int.from_bytes(run.data[:4]) == run.times[0] for run in runs)
    starts = [run.times[0] for run in runs]
    assert starts[0] == 0
    assert starts[-1] > 150_000
    assert max(b - a for a, b in pairwise(starts)) <= 200_000 / (MOST_RUNS / 2 - 1)


def test_a_short_series_is_one_run() -> None:
    samples, known = Samples(), array("d", bytes(8 * COUNT))
    for number in range(500):
        samples.add(number, b"\0", known)
    (run,) = samples.runs()
    assert list(run.times) == list(range(500))
    assert len(run.known) == 500 * COUNT


@given(st.lists(st.binary(min_size=3, max_size=3), min_size=1, max_size=400))
def test_counts_are_exact(payloads: list[bytes]) -> None:
    moves = Moves(3)
    for payload in payloads:
        moves.add(payload)
    moves.settle()
    for index in range(3):
        column = [payload[index] for payload in payloads]
        assert moves.seen(index) == {value: column.count(value) for value in sorted(set(column))}
        assert moves.changed[index] == sum(a != b for a, b in pairwise(column))
        for bit in range(8):
            flips = sum((a ^ b) >> bit & 1 for a, b in pairwise(column))
            assert moves.flips[8 * index + bit] == flips


def test_noise_is_settled_again_and_again() -> None:
    moves, r = Moves(8), random.Random(3)
    for _ in range(5000):
        moves.add(r.randbytes(8))
    moves.settle()
    assert sum(moves.seen(0).values()) == 5000
    assert sum(moves.stepped(7).values()) == 4999
