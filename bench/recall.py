# SPDX-License-Identifier: GPL-2.0-or-later
"""``make bench ARGS=recall``: what ``check`` finds of faults that are known, and what it finds that is not there.

Buses with trouble (recall_buses.py), and the scenarios that come with dalyshark under other seeds, on a serial line and
on CAN. Each fault that was put in must be found by its rule, at its time and place, unless the bytes hide it
(tests: visible.py); each warning and error must have its fault. On clean scenarios there may be neither.
"""

from __future__ import annotations

import dataclasses
import itertools
import tempfile
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from tests.tools.dalytools.findings.recall import FOUND_BY, PLANTED, Judged, judge

from bench import recall_planted
from bench.recall_buses import bus
from bench.table import Goal, Result
from dalytools.simulator.scenario_file import ready_made

if TYPE_CHECKING:
    from collections.abc import Iterator

    from bench.options import Options
    from dalytools.simulator.scenario import Scenario

_MOST_SHOWN = 20
_AT_ONCE = 16


@dataclasses.dataclass
class Sum:
    """What came of many buses: by kind of fault, by reason, and in words what was wrong."""

    injected: Counter[str] = dataclasses.field(default_factory=Counter[str])
    hidden: Counter[str] = dataclasses.field(default_factory=Counter[str])
    missed: Counter[str] = dataclasses.field(default_factory=Counter[str])
    invented: Counter[str] = dataclasses.field(default_factory=Counter[str])
    reasons: Counter[str] = dataclasses.field(default_factory=Counter[str])
    said: list[str] = dataclasses.field(default_factory=list[str])

    def add(self, other: Sum) -> None:
        """Add another's."""
        for name in ("injected", "hidden", "missed", "invented", "reasons"):
            getattr(self, name).update(getattr(other, name))
        self.said += other.said


def judged(number: int) -> Sum:
    """Make bus and scenario of that number, and compare. The number gives the same again."""
    out = Sum()
    names = list(ready_made())
    name = names[number % len(names)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "made.pcapng"
        for title, scenario in (("bus", bus(number)), (name, dataclasses.replace(ready_made()[name], seed=number))):
            for wire in _wires(scenario):
                planted = recall_planted.into(number) if wire == "uart" and title == "bus" else None
                _count(out, f"{title} {number} on {wire}", judge(scenario, path, wire=wire, also=planted))
    return out


def _wires(scenario: Scenario) -> list[str]:
    if scenario.wire == "can":
        return ["can"]
    return ["uart", "can"] if all(host.dialect == "a5" for host in scenario.hosts) else ["uart"]


def _count(out: Sum, title: str, found: Judged) -> None:
    out.injected.update(str(note["what"]) for note in found.notes)
    out.hidden.update(str(note["what"]) for _, note in found.hidden)
    out.reasons.update(why for why, _ in found.hidden)
    out.missed.update(str(note["what"]) for note in found.missed)
    out.invented.update(moment.rule for moment in found.invented)
    out.said += [f"{title}: missed {dict(note)}" for note in found.missed]
    out.said += [
        f"{title}: invented {moment.rule}, {moment.place}, {moment.seconds:.3f} s" for moment in found.invented
    ]


def campaign(faults: int, workers: int | None = None) -> Sum:
    """Go on until so many faults were put in that can be seen."""
    total = Sum()
    with ProcessPoolExecutor(workers) as pool:
        for first in itertools.count(0, _AT_ONCE):
            for part in pool.map(judged, range(first, first + _AT_ONCE)):
                total.add(part)
            if total.injected.total() - total.hidden.total() >= faults:
                return total
    raise AssertionError


def measure(options: Options) -> Iterator[Result]:
    """Tell the shares, and each miss."""
    total = campaign(options.faults)
    seen = total.injected.total() - total.hidden.total()
    result = Result(
        f"Recall: {total.injected.total()} faults put in, {seen} of them to be seen",
        ("fault", "put in", "hidden", "missed", "recall", "found by"),
        note="\n".join(
            [f"hidden, {count}: {why}" for why, count in total.reasons.most_common()]
            + total.said[:_MOST_SHOWN]
            + ([f"and {len(total.said) - _MOST_SHOWN} more"] if len(total.said) > _MOST_SHOWN else [])
        ),
    )
    for what, rule in sorted((FOUND_BY | PLANTED).items()):
        there = total.injected[what] - total.hidden[what]
        share = 1 - total.missed[what] / there if there else 0.0
        numbers = (str(total.injected[what]), str(total.hidden[what]), str(total.missed[what]), f"{share:.5f}")
        result.rows.append((what, *numbers, ", ".join(rule.rules)))
    result.goals = [
        Goal("faults found", seen - total.missed.total(), seen, at_least=True),
        Goal("faults invented", total.invented.total(), 0),
    ]
    yield result
