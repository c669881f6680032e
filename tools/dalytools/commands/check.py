# SPDX-License-Identifier: GPL-2.0-or-later
"""``dalyshark check``: the dissector against the reference decoder, and the rules of the protocol as findings.

Exit status: 0 nothing at or above --fail-on, 1 something, 2 could not run (or not to the end of a file).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from dalytools import wire_times
from dalytools.comparison import Comparison, compare, read_alone
from dalytools.findings import as_json, baseline, config, github, junit, table
from dalytools.findings.checked import Checked, differences, severities, weighed
from dalytools.findings.finding import SEVERITIES, Severity
from dalytools.findings.limits import Limits
from dalytools.findings.rules import RULES
from dalytools.findings.search import Search
from dalytools.problem import Problem
from dalytools.progress import progress_bar
from dalytools.terminal_text import counted, plain
from dalytools.tshark import Tshark
from dalytools.whole_file import whole_file
from dalytools.wires import choice, left_out

if TYPE_CHECKING:
    from rich.console import Console

    from dalyref.options import Options
    from dalytools.findings.baseline import Baseline
    from dalytools.findings.config import Config
    from dalytools.wires.choice import Choice

SHOWN = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.description = (
        "Read captures twice, with tshark and our dissector and with the reference decoder, which were written apart "
        "from the same papers, and name every field in which they differ; and find what breaks the protocol's rules: "
        "silent boards, late replies, holes, contradictions, damaged bytes, writes, faults. --rules lists them."
    )
    parser.epilog = (
        "Settings can stand in dalyshark.toml, in the working directory or beside the first capture (docs/ci.md). "
        "Exit status: 0 nothing at or above --fail-on, 1 something, 2 could not run."
    )
    parser.add_argument("files", nargs="*", metavar="FILE", help="capture file, or a log of candump -L")
    parser.add_argument("-q", "--quiet", action="store_true", help="only what makes the check fail, and the sum")
    parser.add_argument("--rules", action="store_true", help="list the rules with what each means, and end")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--no-dissector", action="store_true", help="the rules alone: needs no tshark")
    which.add_argument("--no-rules", action="store_true", help="dissector against reference alone")
    parser.add_argument(
        "--fail-on",
        choices=(*SEVERITIES, config.NEVER),
        metavar="SEVERITY",
        help="exit status 1 from this severity on: note, warning, error (default), never",
    )
    parser.add_argument(
        "--ignore",
        action="append",
        default=[],
        choices=list(RULES),
        metavar="RULE",
        help="leave a rule out; repeatable",
    )
    parser.add_argument(
        "--late-after", type=_limit, metavar="S", help=f"replies later than this are late (default {Limits().late_s:g})"
    )
    parser.add_argument(
        "--damaged-limit",
        type=_limit,
        metavar="PERCENT",
        help=f"more bytes outside good frames are a warning (default {Limits().damaged_percent:g})",
    )
    parser.add_argument("--baseline", metavar="OLD", help="tell only what is new against a capture, or a --json of one")
    parser.add_argument("--config", metavar="FILE", help="settings, instead of dalyshark.toml")
    parser.add_argument("--json", metavar="FILE", help="findings for programs; - is standard output")
    parser.add_argument("--junit", metavar="FILE", help="findings for a CI, a test case a rule; - is standard output")
    parser.add_argument("--github", action="store_true", help="findings as annotations of GitHub Actions")
    parser.add_argument("--no-colour", "--no-color", action="store_true", help="as NO_COLOR=1 does")
    choice.add_arguments(parser)
    wire_times.add_arguments(parser, quiet="--silence")


def _limit(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 <= value <= 1e6:
        raise argparse.ArgumentTypeError(f"{text!r} is no limit; 0.5 is one")
    return value


@dataclass(frozen=True, slots=True)
class _Asked:
    """What to check by: command line over configuration over defaults."""

    options: Options
    wires: Choice
    limits: Limits
    severity: dict[str, Severity]
    ignored: frozenset[str]
    fail_on: Severity | None
    rules: bool

    @classmethod
    def of(cls, args: argparse.Namespace, settings: Config) -> _Asked:
        base = wire_times.checked(settings.wire, f"{settings.path}: wire.")
        late: float | None = args.late_after if args.late_after is not None else settings.late_after
        damaged: float | None = args.damaged_limit if args.damaged_limit is not None else settings.damaged_limit
        usual = Limits()
        limits = Limits(usual.late_s if late is None else late, usual.damaged_percent if damaged is None else damaged)
        fail_on: str = args.fail_on or settings.fail_on or str(Severity.ERROR)
        return cls(
            wire_times.read(args, base),
            choice.read(args, settings.wires),
            limits,
            settings.severity,
            frozenset((*settings.ignore, *args.ignore)),
            SEVERITIES.get(fail_on),
            not args.no_rules,
        )


def run(args: argparse.Namespace) -> int:
    """Check every file; print what was found, write what was asked for."""
    files: list[str] = args.files
    settings = config.find(args.config, files)
    asked = _Asked.of(args, settings)
    if "-" in (args.json, args.junit) and args.json == args.junit:
        raise Problem("both --json and --junit want standard output; give one of them a file")
    # What programs read has standard output for itself.
    people = sys.stderr if "-" in (args.json, args.junit) else sys.stdout
    to = table.console(people, colour=False if args.no_colour else None)
    if args.rules:
        table.show_rules(asked.ignored, asked.severity, to)
        return 0
    if not files:
        raise Problem("name a capture file to check; --rules lists what is looked for")
    if settings.path and not args.quiet:
        print(f"dalyshark check: settings from {plain(settings.path)}", file=sys.stderr)  # noqa: T201
    _refuse_inputs_as_outputs(args)
    with ExitStack() as stack:
        tshark = None if args.no_dissector else stack.enter_context(Tshark())
        known = _baseline(args.baseline, asked, tshark) if args.baseline else None
        results: list[Checked] = []
        for name in files:
            checked = _check(name, asked, tshark, known)
            results.append(checked)
            _show(checked, asked, to, quiet=args.quiet)
            if args.github:
                for command in github.commands(checked):
                    print(command)  # noqa: T201
        if any(not checked.problem for checked in results):
            to.print(sum_up(results, tshark.version if tshark else ""), soft_wrap=True)
    status = max(checked.status(asked.fail_on) for checked in results)
    version = tshark.version if tshark else ""
    _write(args.json, as_json.text(results, asked.fail_on, status, version))
    _write(args.junit, junit.text(results, asked.fail_on, asked.ignored))
    return status


def _refuse_inputs_as_outputs(args: argparse.Namespace) -> None:
    inputs = {os.path.realpath(name) for name in (*args.files, args.baseline or args.files[0])}
    for name in (args.json, args.junit):
        if name and name != "-" and os.path.realpath(name) in inputs:
            raise Problem(f"{name} is one of the files to read; name another file to write")
    if args.json and args.junit and os.path.realpath(args.json) == os.path.realpath(args.junit):
        raise Problem("both --json and --junit would write that file; give one of them another")


def _write(name: str | None, text: str) -> None:
    if name == "-":
        sys.stdout.write(text)
    elif name:
        with whole_file(name) as out:
            out.write(text)


def _baseline(name: str, asked: _Asked, tshark: Tshark | None) -> Baseline:
    known = baseline.read_json(name)
    if known is not None:
        return known
    checked = _check(name, asked, tshark, None)
    if checked.problem or checked.broken:
        raise Problem(f"the baseline can not be used: {checked.problem or checked.broken}")
    return baseline.Baseline.of(checked)


def _check(name: str, asked: _Asked, tshark: Tshark | None, known: Baseline | None) -> Checked:
    """Check one file."""
    checked = Checked(name)
    search = Search(asked.limits)
    started = time.monotonic()
    try:
        with progress_bar(f"check {plain(Path(name).name)}") as advance:
            if tshark is None:
                result = read_alone(
                    Path(name), options=asked.options, wires=asked.wires, progress=advance, listener=search
                )
            else:
                listener = search if asked.rules else None
                result = compare(
                    tshark,
                    Path(name),
                    options=asked.options,
                    wires=asked.wires,
                    progress=advance,
                    listener=listener,
                )
                checked.differences = result.found
    except Problem as problem:
        checked.problem = str(problem)
        print(f"dalyshark check: {plain(checked.problem)}", file=sys.stderr)  # noqa: T201
        return checked
    checked.seconds = time.monotonic() - started
    checked.records, checked.packets, checked.kinds = result.records, result.packets, dict(result.kinds)
    checked.broken = result.broken
    everything = [*differences(result), *search.findings()]
    checked.findings, checked.known = weighed(
        everything, asked.severity, asked.ignored, known.keys if known is not None else ()
    )
    checked.left_out = result.left_out
    left_out.say("check", name, result.left_out)
    if result.broken:
        said = plain(f"{result.broken}; compared what is there")
        print(f"dalyshark check: {said}", file=sys.stderr)  # noqa: T201
    _say_differences(checked, result, asked)
    return checked


def _say_differences(checked: Checked, result: Comparison, asked: _Asked) -> None:
    """Keep the first differences for people to read, where the rule is not ignored."""
    if "dissector-differs" in asked.ignored:
        return
    checked.listed = [str(difference) for difference in result.differences[:SHOWN]]


def _show(checked: Checked, asked: _Asked, to: Console, *, quiet: bool) -> None:
    """Print what came out for one file."""
    if checked.problem:
        return
    shown = checked.failing(asked.fail_on) if quiet else checked.findings
    if quiet and not shown:
        return
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(checked.kinds.items(), key=lambda item: -item[1]))
    kinds = f" ({kinds})" if kinds else ""
    head = f"{plain(checked.file)}: {counted(checked.records, 'record')}{kinds}: {verdict([checked])}"
    to.print(head, soft_wrap=True)
    for line in checked.listed:
        to.print(f"  {plain(line)}", soft_wrap=True)
    if checked.listed and (checked.differences or 0) > SHOWN:
        to.print(f"  and {(checked.differences or 0) - SHOWN} more", soft_wrap=True)
    others = [finding for finding in shown if finding.rule != "dissector-differs"]
    if others:
        table.show(others, to)
        to.print()


def verdict(results: list[Checked]) -> str:
    """Count what was found, in a line."""
    told = [checked.differences for checked in results if checked.differences is not None]
    parts = [counted(sum(told), "difference")] if told else []
    found = [finding for checked in results for finding in checked.findings if finding.rule != "dissector-differs"]
    if found:
        parts.append(severities(found))
    known = sum(checked.known for checked in results)
    if known:
        parts.append(f"{known} known before")
    return ", ".join(parts) or "nothing found"


def sum_up(results: list[Checked], version: str) -> str:
    """Say in a line what was checked; nothing is said of files that could not be."""
    done = [checked for checked in results if not checked.problem]
    total = counted(len(results), "file")
    files = total if len(done) == len(results) else f"{len(done)} of {total}"
    what = f"{files}, {counted(sum(checked.records for checked in done), 'record')}"
    return f"{what}{f', tshark {version}' if version else ''}: {verdict(done)}"
