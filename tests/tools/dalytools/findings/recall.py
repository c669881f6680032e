# SPDX-License-Identifier: GPL-2.0-or-later
"""What the simulator put into a capture against what ``check`` finds in it: what is missed, what is invented.

Each thing counted by a rule is a moment: when, and where. Each note of the truth must have its moment, and each moment
of a warning or an error its note.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple
from unittest import mock

from tests.tools.dalytools.findings.explained import explained
from tests.tools.dalytools.findings.heard import Frame, frames
from tests.tools.dalytools.findings.injected import search
from tests.tools.dalytools.findings.moments import Moment, Note, at, during
from tests.tools.dalytools.findings.visible import LONGEST_S, hidden, sent_by

from dalytools.findings.finding import Finding, Severity, Tally
from dalytools.simulator.capture_file import write_capture

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from dalytools.findings.place import Place
    from dalytools.simulator.scenario import Scenario


class Rule(NamedTuple):
    """Which rules find a note, and how long before and after it, s."""

    rules: tuple[str, ...]
    before: float = 0.0
    after: float = 0.3


FOUND_BY = {
    # The last frame of a burst that was cut off, or the first one behind a hole, comes a little later.
    "unanswered": Rule(("unanswered",), 0.01, 0.01),
    # In the middle of the answer to a retry, it looks like a part that comes twice.
    "late": Rule(("late", "wrong-board", "burst-repeat"), 0.01, 0.3),
    "echo": Rule(("echo",), 0.01, 0.01),
    "zero_reply": Rule(("zero-reply",), 0.01, 0.3),
    # A damaged record begins with the first of several damaged frames in a row, which may be a long one of Modbus.
    "damaged": Rule(("damaged", "line-errors"), 0.35, 0.3),
    # Two that begin at once can sum up right: a reply of nobody. One right behind the other harms no byte.
    "collision": Rule(("damaged", "line-errors", "zero-reply", "unasked", "unanswered"), 0.3, 0.3),
    # Behind the last cell or sensor there is nothing to miss: another number of frames than usual.
    "cut_burst": Rule(("burst-cut-off", "burst-length"), 0.0, 0.5),
    "skipped_frame": Rule(("burst-missing", "burst-cut-off", "burst-length"), 0.1),
    "repeated_frame": Rule(("burst-repeat",)),
    # Behind the right board's answer it is nobody's; where its own request was given up, it is late.
    "other_board": Rule(("wrong-board", "unasked", "late"), 0.01, 0.3),
    # On the later of the two records, which may be the other one (docs/records.md 11: 10 s).
    "contradiction": Rule(("contradiction",), 0.03, 10.0),
    "write": Rule(("write",), 0.01, 0.01),
    "fault_present": Rule(("fault-standing",), 0.3, 0.3),
    "fault_raised": Rule(("fault-raised",), 0.3, 0.3),
    # Several exchanges end to end are one record.
    "foreign": Rule(("foreign",), LONGEST_S, 0.3),
}
PLANTED = {
    name.replace("-", "_"): Rule((name,), 0.01, 0.2)
    for name in (
        "port-lost",
        "line-errors",
        "dropped",
        "clock-step",
        "modbus-exception",
        "absent-registers",
        "unknown-id",
        "unasked",
        "write-denied",
        "modbus-ambiguous",
    )
}
"""What the simulator does not do, and ``judge`` may be given."""
CAUSES = {
    "silent": ("unanswered",),
    "unanswered": ("unanswered", "modbus_ambiguous"),
    "asleep": ("unanswered", "echo"),
    "other-dialect": ("unanswered",),
    "unasked": ("late", "collision", "other_board"),
    "late": ("late", "other_board"),
    # Behind the answer to another host's newer request, a late reply goes to one that names another board.
    "wrong-board": ("other_board", "late"),
    "echo": ("echo",),
    "zero-reply": ("zero_reply", "collision"),
    "burst-missing": ("skipped_frame", "damaged", "collision"),
    "burst-repeat": ("repeated_frame", "late"),
    "burst-cut-off": ("cut_burst", "skipped_frame", "damaged", "collision"),
    "burst-length": ("cut_burst", "damaged", "collision", "zero_reply", "skipped_frame"),
    "contradiction": ("contradiction",),
    "fault-raised": ("fault_raised", "late"),
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

    notes: list[Note] = field(default_factory=list[Note])
    missed: list[Note] = field(default_factory=list[Note])
    hidden: list[tuple[str, Note]] = field(default_factory=list[tuple[str, Note]])
    """What could not be seen, and why."""
    invented: list[Moment] = field(default_factory=list[Moment])
    findings: list[Finding] = field(default_factory=list[Finding])


def judge(
    scenario: Scenario,
    path: Path,
    *,
    wire: str = "",
    seconds: float = 0.0,
    also: Callable[[Path], list[Note]] | None = None,
) -> Judged:
    """Make a capture of a scenario, and compare. also: puts more into the file, and says what."""
    written = write_capture(scenario, path, wire=wire, seconds=seconds, truth=path.with_suffix(".json"))
    counted: dict[int, tuple[Tally, list[float]]] = {}  # with the tally, so that no other gets its id

    def add(tally: Tally, number: int, time_ns: int) -> None:
        counted.setdefault(id(tally), (tally, []))[1].append((time_ns - scenario.start_ns) / 1e9)
        whole(tally, number, time_ns)

    whole = Tally.add
    more = also(path) if also is not None else []
    with mock.patch.object(Tally, "add", add):
        out = Judged(findings=search(path))
    moments = sorted(
        (
            Moment(finding.rule, finding.place, finding.severity, seconds)
            for finding in out.findings
            if id(finding.tally) in counted
            for seconds in counted[id(finding.tally)][1]
        ),
        key=_seconds,
    )
    heard = frames(path, scenario.start_ns)
    # Error frames of CAN, which are nobody's, tell no time.
    last = max((frame.seconds for frame in heard if frame.good or wire != "can"), default=0.0)
    everything = sorted([*written.truth.notes, *more], key=at)
    out.notes = [note for note in everything if note["what"] in FOUND_BY | PLANTED and _told(note, last, wire)]
    for note in out.notes:
        if not _found(note, moments):
            why = hidden(note, heard, everything)
            out.hidden += [(why, note)] if why else []
            out.missed += [] if why else [note]
    phase = min(
        (phase.seconds for board in scenario.boards if len(board.pack.profile) > 1 for phase in board.pack.profile),
        default=1e9,
    )
    of_it = OF_THE_SCENARIO | {"foreign" for one in scenario.foreign if one.can_id is not None}
    out.invented = [
        moment
        for moment in moments
        if moment.severity > Severity.NOTE
        and moment.rule not in of_it
        and not _caused(moment, everything)
        and not explained(moment, heard, everything, LONG_AGO_S.get(moment.rule, AGO_S))
        and not (moment.rule == "contradiction" and _load_unknown(moment, heard, phase))
    ]
    return out


def _seconds(moment: Moment) -> float:
    return moment.seconds


def _told(note: Note, last: float, wire: str) -> bool:
    """Tell whether a capture with a last packet at that time can show it: whether a request was answered, 1 s later."""
    if note.get("name") in STATES or note.get("harmed") is False:
        return False
    if wire == "can" and (
        note["what"] in {"echo", "foreign"} or "register" in note or not str(note.get("heard", "a5")).startswith("a5")
    ):  # CAN hears no echo, carries A5 alone, and an error frame stands only for what began as such
        return False
    settled = 1.1 if note["what"] == "unanswered" else 0.5
    return not note.get("open") and at(note) + settled < last


def _rule(note: Note) -> Rule:
    """Say what finds a note: a reply that came within a second of its request is late, and answers it."""
    late = note["what"] == "unanswered" and note.get("why") == "late"
    return Rule(("unanswered", "late"), 0.01, 1.1) if late else (FOUND_BY | PLANTED)[str(note["what"])]


def _found(note: Note, moments: list[Moment]) -> bool:
    rule = _rule(note)
    near = moments[bisect_left(moments, at(note) - rule.before, key=_seconds) :]
    for moment in near:
        if moment.seconds > at(note) + rule.after:
            return False
        if moment.rule in rule.rules and _fits(note, moment.place):
            return True
    return False


def _fits(note: Note, place: Place) -> bool:
    """Tell whether a note and a place agree in what both say."""
    pairs = (
        (note.get("board"), place.board),
        (note.get("data_id"), place.data_id),
        (note.get("register"), place.register),
        (note.get("name") if note["what"] in NAMED else None, place.detail or None),
    )
    return all(one is None or other is None or one == other for one, other in pairs)


def _load_unknown(moment: Moment, heard: list[Frame], phase: float) -> bool:
    """Tell whether the load may have stepped to and fro: between the currents around it, or behind the last one."""
    told = [frame.seconds for frame in heard if frame.address == moment.place.board and frame.data_id == 0x90]
    before = max((at for at in told if at < moment.seconds), default=-1e6)
    return min((at for at in told if at >= moment.seconds), default=1e6) - before > phase


def _caused(moment: Moment, notes: list[Note]) -> bool:
    """Tell whether a note of its place is behind it: one that this rule finds, in time; or another, not long before.

    A number of frames changes twice: to another, and with the board's next answer back.
    """
    causes = {*CAUSES.get(moment.rule, ()), *PLANTED.keys() & {moment.rule.replace("-", "_")}}
    ago = LONG_AGO_S.get(moment.rule, AGO_S)
    return any(
        note["what"] in causes
        and _fits(note, moment.place)
        and _of_its_board(note, moment)
        and (moment.rule == "burst-length" or moment.rule not in _rule(note).rules or _in_time(note, moment.seconds))
        for note in during(notes, moment.seconds - ago, moment.seconds + 0.3)
    )


def _of_its_board(note: Note, moment: Moment) -> bool:
    """Tell whether damage can be behind something in an answer of several frames: it fell on the board's own bytes."""
    board = moment.place.board
    if board is None or note["what"] not in {"damaged", "collision"} or not moment.rule.startswith("burst-"):
        return True
    return sent_by(note, board)


def _in_time(note: Note, seconds: float) -> bool:
    rule = _rule(note)
    return at(note) - rule.before - 1e-6 <= seconds <= at(note) + rule.after + 1e-6
