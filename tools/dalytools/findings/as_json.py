# SPDX-License-Identifier: GPL-2.0-or-later
"""Findings as JSON, for programs and as a baseline of later runs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

from dalytools import __version__
from dalytools.findings.moment import iso

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.findings.checked import Checked
    from dalytools.findings.finding import Finding, Severity

FORMAT = "dalyshark check"
FORMAT_VERSION = 1


def text(files: Sequence[Checked], fail_on: Severity | None, status: int, tshark: str = "") -> str:
    """Return the whole document. tshark: its version, empty where the dissector was not asked."""
    document = {
        "format": FORMAT,
        "version": FORMAT_VERSION,
        "dalyshark": __version__,
        "tshark": tshark or None,
        "fail_on": str(fail_on) if fail_on is not None else None,
        "status": status,
        "files": [_file(checked) for checked in files],
    }
    return json.dumps(document, indent=2) + "\n"


def _file(checked: Checked) -> dict[str, object]:
    return {
        "file": checked.file,
        "problem": checked.problem or None,
        "broken": checked.broken or None,
        "packets": checked.packets,
        "records": checked.records,
        "kinds": checked.kinds,
        "differences": checked.differences,
        "known": checked.known,
        "left_out": [{"what": one.what, "count": one.count, "text": str(one)} for one in checked.left_out],
        "findings": [_finding(finding) for finding in checked.findings],
    }


def _finding(finding: Finding) -> dict[str, object]:
    place, tally = finding.place, finding.tally
    return {
        "rule": finding.rule,
        "severity": str(finding.severity),
        "where": str(place),
        "bus": place.bus or None,
        "board": place.board,
        "address": place.address,
        "data_id": place.data_id,
        "register": place.register,
        "detail": place.detail or None,
        "count": tally.count,
        "first_packet": tally.first_packet,
        "last_packet": tally.last_packet,
        "first_time": iso(tally.first_ns),
        "last_time": iso(tally.last_ns),
        "text": finding.text,
        "examples": list(finding.examples),
        "advice": finding.advice,
    }
