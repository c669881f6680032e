# SPDX-License-Identifier: GPL-2.0-or-later
"""A difference in the terminal, and as JSON."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from dalytools import __version__
from dalytools.survey.as_json import FORMAT_VERSION, place_words
from dalytools.survey.difference import KINDS
from dalytools.survey.names import shortened
from dalytools.survey.words import spacing
from dalytools.terminal_text import counted, plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from dalytools.survey.difference import Change, Changed, Difference
    from dalytools.survey.findings import Finding

_PLACE, _NEW, _GONE, _FAINT = "bold", "green", "red", "bright_black"


def show(found: Difference, names: Sequence[str], console: Console) -> None:
    """Print all of it. names: of the two files."""
    from rich.text import Text

    def line(*pieces: str | tuple[str, str]) -> None:
        console.print(Text.assemble(*pieces), soft_wrap=True)

    line(f"before: {plain(names[0])}")
    line(f"now:    {plain(names[1])}")
    for heading, places, style in (("Only now", found.new, _NEW), ("Only before", found.gone, _GONE)):
        if places:
            line("")
            line((heading, f"bold {style}"))
            for one in places:
                says = ", newest" if any(one.stream.moves.changed) else ":"
                newest = f"{says} {one.stream.last.hex(' ').upper()}" if one.stream.last else ""
                line((f"  {one.place.name}", _PLACE), f"   {spacing(one.stream)}{newest}")
    if found.changed:
        line("")
        line(("Changed, the surest first", _PLACE))
        for one in found.changed:
            line((f"  {one.after.place.name}", _PLACE), (f"   {_counts(one)}", _FAINT))
            for change in one.changes:
                line(f"    {where(one, change)}: {change.text}")
    line("")
    unchanged = f"{counted(found.same, 'place')} unchanged"
    line(unchanged if found.changed or found.new or found.gone else f"Nothing changed: {unchanged}")


def where(one: Changed, change: Change) -> str:
    """Name the bytes that changed, with the fields that stand there."""
    if change.first < 0:
        return "spacing"
    names = list(dict.fromkeys(name for of_byte in one.after.names[change.first : change.last + 1] for name in of_byte))
    shown = one.after.place.bytes_name(change.first, change.last)
    return f"{shown} {shortened(names)}" if names else shown


def _counts(one: Changed) -> str:
    return f"{counted(one.before.stream.count, 'time')} before, {one.after.stream.count} now"


def text(found: Difference, names: Sequence[str]) -> str:
    """Return the difference as JSON."""

    def places(findings: Sequence[Finding]) -> list[dict[str, object]]:
        return [
            {**place_words(one.place), "count": one.stream.count, "newest": one.stream.last.hex()} for one in findings
        ]

    document = {
        "format": "dalyshark survey difference",
        "version": FORMAT_VERSION,
        "dalyshark": __version__,
        "files": list(names),
        "only_before": places(found.gone),
        "only_now": places(found.new),
        "changed": [
            {
                **place_words(one.after.place),
                "count_before": one.before.stream.count,
                "count_now": one.after.stream.count,
                "changes": [
                    {
                        "kind": KINDS[change.kind],
                        "first": change.first if change.first >= 0 else None,
                        "last": change.last if change.last >= 0 else None,
                        "text": change.text,
                    }
                    for change in one.changes
                ],
            }
            for one in found.changed
        ],
        "unchanged": found.same,
    }
    return json.dumps(document, indent=1) + "\n"
