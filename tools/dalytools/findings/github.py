# SPDX-License-Identifier: GPL-2.0-or-later
"""Findings as annotations of GitHub Actions: lines on standard output that the runner reads.

    ::error file=bus.pcapng,title=silent: board 2::nothing ever answered ...

A value ends at a line break or a per cent sign, and a property also at a colon or a comma: each is sent as % and two
hex digits. Control characters are made harmless first, so no text of a capture can begin a command of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalytools.findings.finding import Severity
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalytools.findings.checked import Checked

_COMMANDS = {Severity.NOTE: "notice", Severity.WARNING: "warning", Severity.ERROR: "error"}


def commands(checked: Checked) -> Iterator[str]:
    """Yield a line a finding, and one for a file that could not be read."""
    said = checked.problem or checked.broken
    if said:
        yield f"::error file={_property(checked.file)},title=could not be read::{_value(said)}"
    for finding in checked.findings:
        tally = finding.tally
        where = (
            f"packets {tally.first_packet} to {tally.last_packet}"
            if tally.count > 1
            else f"packet {tally.first_packet}"
        )
        lines = (f"{finding.text} ({where})", *finding.examples, finding.advice)
        text = "%0A".join(_value(line) for line in lines)
        title = _property(f"{finding.rule}: {finding.place}")
        yield f"::{_COMMANDS[finding.severity]} file={_property(checked.file)},title={title}::{text}"


def _value(text: str) -> str:
    return plain(text).replace("%", "%25")


def _property(text: str) -> str:
    return _value(text).replace(":", "%3A").replace(",", "%2C")
