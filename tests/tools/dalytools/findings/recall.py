# SPDX-License-Identifier: GPL-2.0-or-later
"""What the simulator put into a capture against what ``check`` finds in it: what is missed, what is invented.

Each thing counted by a rule is a moment: when, and where. Each note of the truth must have its moment, and each moment
of a warning or an error its note.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from tests.tools.dalytools.findings.injected import search

from dalycapture.reader import read_capture
from dalytools.findings.finding import Finding, Severity, Tally
from dalytools.simulator.capture_file import write_capture

if TYPE_CHECKING:
    from pathlib import Path

    import pytest

    from dalytools.findings.place import Place
    from dalytools.simulator.scenario import Scenario

Note = Mapping[str, object]


class Moment(NamedTuple):
    """One of the times that a rule counted something, s from the beginning."""

    rule: str
    place: Place
    severity: Severity
    seconds: float


class Rule(NamedTuple):
    """Which rules find a note, and how long before and after it, s."""

    rules: tuple[str, ...]
    before: float = 0.0
    after: float = 0.3


FOUND_BY = {
    # The last frame of a burst that was cut off, or the first one behind a hole, comes a little later.
    "unanswered": Rule(("unanswered",), 0.01, 0.01),
    "late": Rule(("late", "wrong-board"), 0.01, 0.5),
    "echo": Rule(("echo",), 0.01, 0.01),
    "zero_reply": Rule(("zero-reply",), 0.01, 0.3),
    "damaged": Rule(("damaged", "line-errors"), 0.03, 0.3),
    # Two that begin at once can sum up right: a reply of nobody. One right behind the other harms no byte.
    "collision": Rule(("damaged", "line-errors", "zero-reply", "unasked", "unanswered"), 0.1, 0.3),
    "cut_burst": Rule(("burst-cut-off",), 0.0, 0.5),
    "skipped_frame": Rule(("burst-missing",)),
    "repeated_frame": Rule(("burst-repeat",)),
    "other_board": Rule(("wrong-board",), 0.01, 0.3),
    "contradiction": Rule(("contradiction",), 0.03, 0.03),
    "write": Rule(("write",), 0.01, 0.01),
    "fault_present": Rule(("fault-standing",), 0.3, 0.3),
    "fault_raised": Rule(("fault-raised",), 0.3, 0.3),
    "foreign": Rule(("foreign",), 0.01, 0.3),
}
CAUSES = {
    "silent": ("unanswered",),
    "unanswered": ("unanswered", "damaged", "collision"),
    "asleep": ("unanswered", "echo"),
    "other-dialect": ("unanswered",),
    "unasked": ("late", "damaged", "collision", "other_board"),
    "late": ("late",),
    "wrong-board": ("other_board",),
    "echo": ("echo",),
    "zero-reply": ("zero_reply", "collision"),
    "burst-missing": ("skipped_frame", "damaged", "collision"),
    "burst-repeat": ("repeated_frame",),
    "burst-cut-off": ("cut_burst", "damaged", "collision"),
    "burst-length": ("cut_burst", "damaged", "collision", "zero_reply", "skipped_frame"),
    "contradiction": ("contradiction",),
    "fault-raised": ("fault_raised",),
    "fault-standing": ("fault_present",),
    "write-denied": ("write",),
    "write-unconfirmed": ("write",),
    "write-no-switch": ("write",),
    "write-no-effect": ("write",),
    "damaged": ("damaged", "collision"),
    "line-errors": ("damaged", "collision"),
    "foreign": ("foreign",),
}
"""Rule: notes that may be behind it, no more than AGO before."""
NAMED = {"contradiction", "fault_present", "fault_raised"}
STATES = {"mos_off_by_command", "charging_cabinet_offline"}
"""Bits that are no faults (docs/protocol.md, a.98)."""
AGO_S = 1.5
LONG_AGO_S = {"contradiction": 11.0, "burst-length": 20.0, "write-no-effect": 20.0}
OF_THE_SCENARIO = {"two-hosts", "not-polled"}
"""Rules that find what a scenario is, not what happens in it."""


@dataclass
class Judged:
    """What came out for one capture."""

    notes: int = 0
    missed: list[Note] = field(default_factory=list[Note])
    invented: list[Moment] = field(default_factory=list[Moment])
    findings: list[Finding] = field(default_factory=list[Finding])


def judge(scenario: Scenario, path: Path, patch: pytest.MonkeyPatch, *, wire: str = "", seconds: float = 0.0) -> Judged:
    """Make a capture of a scenario, and compare."""
    written = write_capture(scenario, path, wire=wire, seconds=seconds, truth=path.with_suffix(".json"))
    counted: dict[int, tuple[Tally, list[float]]] = {}  # with the tally, so that no other gets its id

    def add(tally: Tally, number: int, time_ns: int) -> None:
        counted.setdefault(id(tally), (tally, []))[1].append((time_ns - scenario.start_ns) / 1e9)
        whole(tally, number, time_ns)

    whole = Tally.add
    with patch.context() as spied:
        spied.setattr(Tally, "add", add)
        out = Judged(findings=search(path))
    moments = [
        Moment(finding.rule, finding.place, finding.severity, at)
        for finding in out.findings
        if id(finding.tally) in counted
        for at in counted[id(finding.tally)][1]
    ]
    last = max(packet.time_ns for packet in read_capture(path)) - scenario.start_ns
    everything: list[Note] = list(written.truth.notes)
    notes = [note for note in everything if note["what"] in FOUND_BY and _told(note, last / 1e9, wire)]
    out.notes = len(notes)
    out.missed = [note for note in notes if not _found(note, moments)]
    of_it = OF_THE_SCENARIO | {"foreign" for one in scenario.foreign if one.can_id is not None}
    out.invented = [
        moment
        for moment in moments
        if moment.severity > Severity.NOTE and moment.rule not in of_it and not _caused(moment, everything)
    ]
    return out


def _at(note: Note) -> float:
    return float(str(note["time"]))


def _told(note: Note, last: float, wire: str) -> bool:
    """Tell whether a capture with a last packet at that time can show it: whether a request was answered, 1 s later."""
    if note.get("name") in STATES:
        return False
    if wire == "can" and (
        note["what"] in {"echo", "foreign"} or "register" in note or not str(note.get("heard", "a5")).startswith("a5")
    ):  # CAN hears no echo, carries A5 alone, and an error frame stands only for what began as such
        return False
    settled = 1.1 if note["what"] == "unanswered" else 0.5
    return not note.get("open") and _at(note) + settled < last


def _found(note: Note, moments: list[Moment]) -> bool:
    rule = FOUND_BY[str(note["what"])]
    at = _at(note)
    return any(
        moment.rule in rule.rules
        and at - rule.before <= moment.seconds <= at + rule.after
        and _fits(note, moment.place)
        for moment in moments
    )


def _fits(note: Note, place: Place) -> bool:
    """Tell whether a note and a place agree in what both say."""
    pairs = (
        (note.get("board"), place.board),
        (note.get("data_id"), place.data_id),
        (note.get("register"), place.register),
        (note.get("name") if note["what"] in NAMED else None, place.detail or None),
    )
    return all(one is None or other is None or one == other for one, other in pairs)


def _caused(moment: Moment, notes: list[Note]) -> bool:
    long = LONG_AGO_S.get(moment.rule, AGO_S)
    return any(
        note["what"] in CAUSES.get(moment.rule, ()) and _at(note) - 0.3 <= moment.seconds <= _at(note) + long
        for note in notes
    )
