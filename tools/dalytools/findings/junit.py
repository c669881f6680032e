# SPDX-License-Identifier: GPL-2.0-or-later
"""Findings as JUnit XML, which every CI shows: one test suite a file, one test case a rule.

    testsuites
      testsuite    a file; an error of its own case "read" when it could not be read
        property   how many of a kind were left out
        testcase   a rule; a failure holds all its findings at or above the limit
        system-out findings below the limit
        system-err what was left out, why a file was read in part only

Elements and attributes stand where the schema of Ant's JUnit task has them; Jenkins, GitLab and Azure read the same.
"""

from __future__ import annotations

import socket
import xml.etree.ElementTree as ET
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from dalytools.findings.moment import iso
from dalytools.findings.rules import RULES
from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from dalytools.findings.checked import Checked
    from dalytools.findings.finding import Finding, Severity

_CLASS = "dalyshark.check"


def text(files: Sequence[Checked], fail_on: Severity | None, ignored: Collection[str] = ()) -> str:
    """Return the whole document. ignored: rules that were not asked; they have no test case."""
    root = ET.Element("testsuites")
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%S")  # the schema wants it without a time zone
    for number, checked in enumerate(files):
        root.append(_suite(number, checked, fail_on, ignored, now))
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def _suite(number: int, checked: Checked, fail_on: Severity | None, ignored: Collection[str], now: str) -> ET.Element:
    failing = checked.failing(fail_on)
    suite = ET.Element("testsuite", {"name": plain(checked.file), "package": "dalyshark", "id": str(number)})
    properties = ET.SubElement(suite, "properties")
    for one in checked.left_out:
        ET.SubElement(properties, "property", {"name": f"left_out.{one.what}", "value": str(one.count)})
    cases = errors = failures = 0
    if checked.problem or checked.broken:
        cases, errors = 1, 1
        case = ET.SubElement(suite, "testcase", {"classname": _CLASS, "name": "read", "time": "0"})
        said = plain(checked.problem or checked.broken)
        ET.SubElement(case, "error", {"type": "read", "message": said}).text = said
    if not checked.problem:
        for name in RULES:
            if name in ignored or (name == "dissector-differs" and checked.differences is None):
                continue
            cases += 1
            case = ET.SubElement(suite, "testcase", {"classname": _CLASS, "name": name, "time": "0"})
            mine = [finding for finding in failing if finding.rule == name]
            if mine:
                failures += 1
                message = "; ".join(f"{finding.place}: {finding.text}" for finding in mine[:3])
                attributes = {"type": name, "message": plain(message)}
                ET.SubElement(case, "failure", attributes).text = "\n".join(_lines(finding) for finding in mine)
    others = [finding for finding in checked.findings if finding not in failing]
    ET.SubElement(suite, "system-out").text = "\n".join(_lines(finding) for finding in others)
    said = [*map(str, checked.left_out), *([checked.broken] if checked.broken else [])]
    ET.SubElement(suite, "system-err").text = "\n".join(map(plain, said))
    suite.attrib.update(
        {
            "tests": str(cases),
            "failures": str(failures),
            "errors": str(errors),
            "time": f"{checked.seconds:.3f}",
            "timestamp": now,
            "hostname": plain(socket.gethostname()) or "localhost",
        }
    )
    return suite


def _lines(finding: Finding) -> str:
    tally = finding.tally
    head = f"{finding.severity} {finding.rule}: {finding.place}: {finding.text}"
    first, last = iso(tally.first_ns), iso(tally.last_ns)
    times = f", {first} to {last}" if first and last else ""
    where = f"  packets {tally.first_packet} to {tally.last_packet}{times}"
    return "\n".join(map(plain, (head, where, *(f"  {one}" for one in finding.examples), f"  > {finding.advice}")))
