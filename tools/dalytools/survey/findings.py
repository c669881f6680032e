# SPDX-License-Identifier: GPL-2.0-or-later
"""Every place of a survey with the names of its bytes, and all that is claimed of them: the unknown ones first."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from dalytools.survey.clocks import clocks
from dalytools.survey.copies import copies
from dalytools.survey.counters import counters
from dalytools.survey.follows import follows, moving
from dalytools.survey.known import FIELDS
from dalytools.survey.names import Names, names
from dalytools.survey.numbers import numbers
from dalytools.survey.place import CAN, MODBUS, REQUEST
from dalytools.survey.steady import steady
from dalytools.survey.texts import register_texts, texts

if TYPE_CHECKING:
    from collections.abc import Callable

    from dalytools.survey.claim import Claim
    from dalytools.survey.place import Place
    from dalytools.survey.stream import Stream
    from dalytools.survey.survey import Survey

UNKNOWN, HALF_KNOWN, KNOWN, REQUESTS = range(4)
HEADINGS: Final = (
    "Not known: no source explains a byte of these",
    "Known in part: bytes that move have no name, or are said to be reserved",
    "Known",
    "Requests",
)
NO_NAME: Final = ("reserved",)
ABSENT: Final = b"\xff\xff"
"""What a register reads that a board does not have."""


@dataclass(slots=True)
class Finding:
    """One place."""

    stream: Stream
    names: Names
    """By byte: the fields that stand in it, by what the reference decoder reads."""
    claims: list[Claim] = field(default_factory=list["Claim"])
    group: int = UNKNOWN

    @property
    def place(self) -> Place:
        """Return where it is."""
        return self.stream.place

    @property
    def constant(self) -> bool:
        """Tell whether no byte ever moved."""
        return not any(self.stream.moves.changed)


def findings(survey: Survey, wanted: Callable[[Place], bool] = lambda _: True) -> list[Finding]:
    """Return what is to be said of each place that is wanted, unknown ones first, then by board and number."""
    looked_at = sum(moving(stream) for stream in survey.streams.values())
    out: list[Finding] = []
    for stream in survey.streams.values():
        if not wanted(stream.place):
            continue
        known = ((),) * stream.place.size if stream.unknown else names(stream.place, stream.last)
        finding = Finding(stream, known)
        finding.group = _group(finding)
        if stream.place.size:
            finding.claims = _claims(finding, looked_at)
        out.append(finding)
    _add_register_texts(out)
    return sorted(out, key=lambda one: (one.group, one.place))


def _group(finding: Finding) -> int:
    stream, place = finding.stream, finding.place
    if stream.unknown or place.dialect == CAN:
        return UNKNOWN
    if place.direction == REQUEST or not place.size:
        return REQUESTS
    if place.dialect in MODBUS and finding.constant and stream.last == ABSENT:
        return KNOWN
    named = [any(name not in NO_NAME for name in of_byte) for of_byte in finding.names]
    if place.page >= 0 and named:
        named[0] = False
    if not any(named):
        return UNKNOWN
    if any(moved and not name for moved, name in zip(stream.moves.changed, named, strict=True)):
        return HALF_KNOWN
    return KNOWN


def _claims(finding: Finding, looked_at: int) -> list[Claim]:
    stream = finding.stream
    found = list(numbers(stream.moves))
    pairs = [(claim.first, claim.last) for claim in found if "high byte first" in claim.text]
    found += counters(stream.moves)
    counted = frozenset(claim.first for claim in found if claim.kind == "counter")
    found += clocks(stream)
    ticking = {index for one in found if one.kind == "clock" for index in range(one.first, one.last + 1)}
    found += steady(stream, pairs, counted | ticking)
    found += texts(stream)
    copied = list(copies(stream))
    found += copied
    own = frozenset(
        quantity for of_byte in finding.names for name in of_byte for quantity in FIELDS.get(f"daly.{name}", ())
    )
    same = {index for one in copied for index in range(one.first, one.last + 1)}
    found += [one for one in follows(stream, looked_at, own, pairs) if not {one.first, one.last} & same]
    return sorted(found, key=lambda claim: (claim.first, claim.last, claim.kind))


def _add_register_texts(all_findings: list[Finding]) -> None:
    groups: dict[tuple[str, int, str, str], list[Finding]] = {}
    for one in all_findings:
        place = one.place
        if place.dialect in MODBUS and place.size == 2:
            groups.setdefault((place.bus, place.board, place.dialect, place.direction), []).append(one)
    for group in groups.values():
        group.sort(key=lambda one: one.place)
        by_stream = {one.stream.index: one for one in group}
        for index, claim in register_texts([one.stream for one in group]).items():
            by_stream[index].claims.append(claim)
