# SPDX-License-Identifier: GPL-2.0-or-later
"""What came out for one file: what was read, what was found, and whether that is a failure."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from dalytools.findings.finding import Finding, Severity, Tally
from dalytools.findings.place import Place
from dalytools.findings.rules import found
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from dalytools.comparison import Comparison
    from dalytools.wires.left_out import LeftOut


@dataclass(slots=True)
class Checked:
    """One file. ``differences`` None: the dissector was not asked."""

    file: str
    records: int = 0
    packets: int = 0
    kinds: dict[str, int] = field(default_factory=dict[str, int])
    differences: int | None = None
    findings: list[Finding] = field(default_factory=list[Finding])
    listed: list[str] = field(default_factory=list[str])
    """The first differences of the two readings, a line each."""
    known: int = 0
    """Findings left out because a baseline has them."""
    left_out: list[LeftOut] = field(default_factory=list["LeftOut"])
    broken: str = ""
    """One line, when the file could be read only in part."""
    problem: str = ""
    """One line, when it could not be read at all."""
    seconds: float = 0.0

    def failing(self, fail_on: Severity | None) -> list[Finding]:
        """Return the findings that are a failure; fail_on None: nothing is."""
        return [] if fail_on is None else [finding for finding in self.findings if finding.severity >= fail_on]

    def status(self, fail_on: Severity | None) -> int:
        """Return the exit status that this file alone would give."""
        if self.problem or self.broken:
            return 2
        return 1 if self.failing(fail_on) else 0


def severities(findings: Collection[Finding]) -> str:
    """Count findings by severity, the worst first: ``1 error, 2 warnings``; nothing for none."""
    counts = ((severity, sum(finding.severity == severity for finding in findings)) for severity in reversed(Severity))
    return ", ".join(counted(count, str(severity)) for severity, count in counts if count)


def weighed(
    findings: list[Finding], severity: Mapping[str, Severity], ignored: Collection[str], known: Collection[object] = ()
) -> tuple[list[Finding], int]:
    """Give findings the severities that the user gave, without those ignored; and how many of the rest are known.

    known: keys of the findings of a baseline; they are left out.
    """
    kept = [
        replace(finding, severity=severity.get(finding.rule, finding.severity))
        for finding in findings
        if finding.rule not in ignored
    ]
    new = [finding for finding in kept if finding.key not in known]
    return sorted(new, key=lambda finding: -finding.severity), len(kept) - len(new)


def differences(comparison: Comparison) -> list[Finding]:
    """Make findings of what two readings see differently: one a field."""
    groups: dict[str, Tally] = {}
    examples: dict[str, str] = {}
    for difference in comparison.differences:
        groups.setdefault(difference.field, Tally()).add(difference.packet, 0)
        examples.setdefault(difference.field, str(difference))
    out = [
        found(
            "dissector-differs",
            Place(detail=name),
            tally,
            f"read differently {counted(tally.count, 'time')}",
            examples=(examples[name],),
        )
        for name, tally in groups.items()
    ]
    more = comparison.found - len(comparison.differences)
    if more:
        text = f"{counted(more, 'difference')} more than are listed"
        out.append(found("dissector-differs", Place(detail="more"), Tally(more), text))
    return out
