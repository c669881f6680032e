# SPDX-License-Identifier: GPL-2.0-or-later
"""What changed from one capture to another: "what did the traffic do when I turned this knob?"

What moves anyway is no change. So a byte that moves in both is named only where what it holds in the one is new to the
other, and the other is known well enough: by Good and Turing, the share of values never seen is about that of values
seen once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.survey.findings import Finding
    from dalytools.survey.moves import Moves
    from dalytools.survey.place import Place

VALUE, MOSTLY, STARTED, STOPPED, RANGE, ALSO, FEW, SPACING = range(8)
KINDS: Final = ("value", "mostly", "began to move", "stands still", "range", "also", "few", "spacing")
"""From the surest on."""
_LEAST: Final = 5
_ENOUGH: Final = 20
_CHANCE: Final = 0.001
_NEW: Final = 0.5
_UNSEEN: Final = 0.1
_MOSTLY: Final = 0.8
_SPACED: Final = 1.25
_ENOUGH_GAPS: Final = 10


@dataclass(frozen=True, slots=True)
class Change:
    """One thing that is different. Bytes `first` to `last`; -1: the whole place."""

    kind: int
    first: int
    last: int
    text: str


@dataclass(slots=True)
class Changed:
    """What changed in one place."""

    before: Finding
    after: Finding
    changes: list[Change] = field(default_factory=list[Change])


@dataclass(slots=True)
class Difference:
    """All that changed."""

    gone: list[Finding] = field(default_factory=list["Finding"])
    """Places in the first capture alone."""
    new: list[Finding] = field(default_factory=list["Finding"])
    changed: list[Changed] = field(default_factory=list[Changed])
    same: int = 0
    """How many places did not change."""


def difference(before: Sequence[Finding], after: Sequence[Finding]) -> Difference:
    """Compare the places of two surveys; where each is of one bus, whatever that is called."""
    one_bus = all(len({finding.place.bus for finding in some}) <= 1 for some in (before, after))
    old, new = _by_place(before, off_bus=one_bus), _by_place(after, off_bus=one_bus)
    out = Difference(
        [finding for place, finding in old.items() if place not in new],
        [finding for place, finding in new.items() if place not in old],
    )
    for place, finding in old.items():
        if place in new:
            changes = _changes(finding, new[place])
            if changes:
                out.changed.append(Changed(finding, new[place], changes))
            else:
                out.same += 1
    out.changed.sort(key=lambda one: (min(change.kind for change in one.changes), one.after.group))
    return out


def _by_place(findings: Sequence[Finding], *, off_bus: bool) -> dict[Place, Finding]:
    return {finding.place.off_bus() if off_bus else finding.place: finding for finding in findings}


def _changes(before: Finding, after: Finding) -> list[Change]:
    counting = {
        index
        for finding in (before, after)
        for claim in finding.claims
        if claim.kind in ("counter", "steady", "clock")
        for index in range(claim.first, claim.last + 1)
    }
    out: list[Change] = []
    for index in range(before.place.size):
        if index in counting:
            continue
        change = _byte(before.stream.moves, after.stream.moves, index)
        if change is not None:
            out.append(change)
    out = _joined(out, before, after)
    spaced = _spacing(before, after)
    return [*out, spaced] if spaced is not None else out


def _byte(old: Moves, new: Moves, index: int) -> Change | None:
    was, now = old.seen(index), new.seen(index)
    moved, moves = old.changed[index], new.changed[index]
    if not moved and not moves:
        if was.keys() == now.keys():
            return None
        kind = VALUE if min(old.count, new.count) >= _LEAST else FEW
        return Change(kind, index, index, "")
    if not moved:
        return _started(old, new, index)
    if not moves:
        return _stopped(old, new, index)
    for known, other, count in ((was, now, old.count), (now, was, new.count)):
        share = sum(times for value, times in other.items() if value not in known) / sum(other.values())
        unseen = sum(times == 1 for times in known.values()) / count
        if share >= _NEW and unseen <= _UNSEEN and min(old.count, new.count) >= 2 * _LEAST:
            return Change(RANGE, index, index, f"{_span(was)} before, {_span(now)} now{_often(was, now)}")
    return None


def _started(old: Moves, new: Moves, index: int) -> Change | None:
    was, now = old.seen(index), new.seen(index)
    if _by_chance(old.count, new.changed[index], new.count) < _CHANCE:
        return Change(STARTED, index, index, f"stood still at {_span(was)}, now {_moving(now)}")
    if min(old.count, new.count) < _ENOUGH:
        return None
    fresh = {value: times for value, times in now.items() if value not in was}
    times = sum(fresh.values())
    mostly = times >= _MOSTLY * new.count
    text = f"always {_span(was)} before, now {_span(fresh)}{'' if mostly else ' too'} ({times} of {new.count} times)"
    return Change(MOSTLY if mostly else ALSO, index, index, text)


def _stopped(old: Moves, new: Moves, index: int) -> Change | None:
    was, now = old.seen(index), new.seen(index)
    if _by_chance(new.count, old.changed[index], old.count) < _CHANCE:
        return Change(STOPPED, index, index, f"{_moving(was)}, now stands still at {_span(now)}")
    if min(old.count, new.count) < _ENOUGH:
        return None
    gone = {value: times for value, times in was.items() if value not in now}
    text = f"{_span(gone)} too before ({sum(gone.values())} of {old.count} times), now always {_span(now)}"
    return Change(ALSO, index, index, text)


def _by_chance(still: int, changes: int, count: int) -> float:
    """Return how likely `still` payloads without a change are, where there are `changes` in `count` payloads."""
    return float((1 - changes / (count - 1)) ** (still - 1))


def _span(seen: dict[int, int]) -> str:
    low, high = min(seen), max(seen)
    return f"{low:02X}" if low == high else f"{low:02X}-{high:02X}"


def _moving(seen: dict[int, int]) -> str:
    return f"moves in {_span(seen)} ({len(seen)} values)"


def _often(was: dict[int, int], now: dict[int, int]) -> str:
    a, b = (max(seen, key=seen.__getitem__) for seen in (was, now))
    return f"; most often {a:02X} before, {b:02X} now"


def _joined(changes: Sequence[Change], before: Finding, after: Finding) -> list[Change]:
    """Put neighbours that stand at another value together, and say it in words."""
    out: list[Change] = []
    for change in changes:
        last = out[-1] if out else None
        if (
            last is not None
            and last.kind == change.kind
            and change.kind in (VALUE, FEW)
            and last.last + 1 == change.first
        ):
            out[-1] = Change(change.kind, last.first, change.last, "")
        else:
            out.append(change)
    return [_worded(change, before, after) if change.kind in (VALUE, FEW) else change for change in out]


def _worded(change: Change, before: Finding, after: Finding) -> Change:
    old, new = (one.stream.last[change.first : change.last + 1] for one in (before, after))
    text = f"{old.hex(' ').upper()} before, {new.hex(' ').upper()} now"
    if len(old) == 1:
        bits = [bit for bit in range(8) if (old[0] ^ new[0]) >> bit & 1]
        text += f" (bit{'s' if len(bits) > 1 else ''} {', '.join(map(str, bits))})" if len(bits) <= 2 else ""
    if change.kind == FEW:
        text += f", but seen {before.stream.count} and {after.stream.count} times only: it may move anyway"
    return Change(change.kind, change.first, change.last, text)


def _spacing(before: Finding, after: Finding) -> Change | None:
    old, new = before.stream.gaps, after.stream.gaps
    if min(old.count, new.count) < _ENOUGH_GAPS:
        return None
    was, now = old.at(0.5), new.at(0.5)
    # the middle of the one is outside of what is usual in the other, both ways
    usual = new.at(0.05) <= was <= new.at(0.95) or old.at(0.05) <= now <= old.at(0.95)
    if usual or not was or not now or max(was, now) < _SPACED * min(was, now):
        return None
    return Change(SPACING, -1, -1, f"every {was:.3g} s before, every {now:.3g} s now")
