# SPDX-License-Identifier: GPL-2.0-or-later
"""A survey as JSON, for programs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Final

from dalytools import __version__
from dalytools.survey.findings import HALF_KNOWN, KNOWN, REQUESTS, UNKNOWN

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.survey.findings import Finding
    from dalytools.survey.place import Place
    from dalytools.survey.survey import Survey

FORMAT: Final = "dalyshark survey"
FORMAT_VERSION: Final = 1
_GROUPS: Final = {UNKNOWN: "unknown", HALF_KNOWN: "known in part", KNOWN: "known", REQUESTS: "request"}


def text(survey: Survey, findings: Sequence[Finding], files: Sequence[str]) -> str:
    """Return the whole document. Times in s; bits: bit 7 of byte 0 first, how often each flipped."""
    document = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "dalyshark": __version__,
        "files": list(files),
        "records": survey.records,
        "kinds": dict(survey.kinds),
        "left_out": survey.left_out,
        "places": [_place(finding) for finding in findings],
    }
    return json.dumps(document, indent=1) + "\n"


def place_words(place: Place) -> dict[str, object]:
    """Return a place for programs."""
    return {
        "name": place.name,
        "bus": place.bus,
        "board": place.board or None,
        "dialect": place.dialect,
        "direction": place.direction or None,
        "number": place.number,
        "frame": place.page if place.page >= 0 else None,
        "size": place.size,
    }


def _place(finding: Finding) -> dict[str, object]:
    stream, moves = finding.stream, finding.stream.moves
    gaps = stream.gaps
    return {
        **place_words(finding.place),
        "group": _GROUPS[finding.group],
        "count": stream.count,
        "first_time": stream.first_ns / 1e9,
        "last_time": stream.last_ns / 1e9,
        "interval": {"p5": gaps.at(0.05), "p50": gaps.at(0.5), "p95": gaps.at(0.95)} if gaps.count else None,
        "newest": stream.last.hex(),
        "bytes": [
            {
                "names": list(finding.names[index]),
                "changed": moves.changed[index],
                "values": {f"{value:02x}": times for value, times in moves.seen(index).items()},
                "flips": [moves.flips[8 * index + bit] for bit in range(7, -1, -1)],
            }
            for index in range(finding.place.size)
        ],
        "claims": [
            {
                "kind": claim.kind,
                "first": claim.first,
                "last": claim.last,
                "text": claim.text,
                "n": claim.count,
                "strength": round(claim.strength, 4),
            }
            for claim in finding.claims
        ],
    }
