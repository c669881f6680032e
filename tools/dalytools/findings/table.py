# SPDX-License-Identifier: GPL-2.0-or-later
"""Findings as tables for people, in colour where the terminal has it and NO_COLOR is not set."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, TextIO

from dalytools.findings.finding import Severity
from dalytools.findings.moment import clock
from dalytools.findings.rules import RULES
from dalytools.terminal_text import counted, plain

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from datetime import tzinfo

    from rich.console import Console

    from dalytools.findings.finding import Finding, Tally

_COLOURS = {Severity.ERROR: "bold red", Severity.WARNING: "yellow", Severity.NOTE: "cyan"}
_WIDTH = 120
"""Columns where no terminal says how many it has: in a log, in a file."""
_LEAST_WIDTH = 60
MOST_SHOWN = 200
"""Findings of a file: a hostile one has thousands, and nobody reads them here."""


def console(out: TextIO, *, colour: bool | None = None) -> Console:
    """Return a console on `out`. colour: None: where it is a terminal that has it, and NO_COLOR is not set."""
    from rich.console import Console

    class ToTheEnd(Console):
        """One whose reader may go away (``| head``): what is left goes nowhere, and the verdict stays what it is."""

        def on_broken_pipe(self) -> None:
            self.quiet = True
            os.dup2(os.open(os.devnull, os.O_WRONLY), self.file.fileno())

    terminal = out.isatty()
    if colour is None:
        colour = terminal and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    made = ToTheEnd(
        file=out,
        highlight=False,
        markup=False,
        emoji=False,
        no_color=not colour,
        force_terminal=colour,
        color_system="auto" if terminal else "standard" if colour else None,
        width=None if terminal else _WIDTH,
        legacy_windows=False,
    )
    made.width = max(made.width, _LEAST_WIDTH)
    return made


def show(findings: Sequence[Finding], to: Console) -> None:
    """Print findings as a table; nothing for none."""
    if not findings:
        return
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), expand=False, header_style="bold")
    table.add_column("severity", no_wrap=True)
    table.add_column("rule", no_wrap=True)
    table.add_column("where", overflow="fold", max_width=26)
    table.add_column("when", no_wrap=True)
    table.add_column("what, and what to do", overflow="fold", ratio=1)
    advised: set[tuple[str, str]] = set()
    for finding in findings[:MOST_SHOWN]:
        words = Text(plain(finding.text))
        for example in finding.examples:
            words.append(f"\n{plain(example)}", "bright_black")
        if (finding.rule, finding.advice) not in advised:  # once is enough for people
            words.append(f"\n> {plain(finding.advice)}", "bright_black")
            advised.add((finding.rule, finding.advice))
        table.add_row(
            Text(str(finding.severity), _COLOURS[finding.severity]),
            finding.rule,
            Text(plain(str(finding.place))),
            Text(when(finding.tally)),
            words,
        )
    to.print(table)
    if len(findings) > MOST_SHOWN:
        more = counted(len(findings) - MOST_SHOWN, "more finding")
        to.print(f"and {more}; --json FILE has all of them", soft_wrap=True)


def when(tally: Tally, zone: tzinfo | None = None, *, day: bool = False) -> str:
    """Say from where to where, a line each: packets, and times; without a zone local ones.

    day: with their dates, which stand there in any case where one is not the other's.
    """
    if not tally.first_packet:
        return "whole file"
    packets = f"packet {tally.first_packet}" if tally.count == 1 else f"{tally.first_packet} .. {tally.last_packet}"
    if not tally.first_ns:
        return packets
    first, last = (clock(time_ns, zone, day=True) for time_ns in (tally.first_ns, tally.last_ns))
    if not day and first.split()[0] == last.split()[0]:
        first, last = first.split()[-1], last.split()[-1]
    return f"{packets}\n{first}" if tally.count == 1 else f"{packets}\n{first}\n{last}"


def show_rules(ignored: Iterable[str], severity: dict[str, Severity], to: Console) -> None:
    """Print all rules with what each means, at the severities that hold here."""
    from rich.table import Table
    from rich.text import Text

    off = set(ignored)
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="bold")
    table.add_column("rule", no_wrap=True)
    table.add_column("severity", no_wrap=True)
    table.add_column("means, and what to do", overflow="fold", ratio=1)
    for rule in RULES.values():
        level = severity.get(rule.name, rule.severity)
        shown = Text("ignored", "bright_black") if rule.name in off else Text(str(level), _COLOURS[level])
        words = Text(rule.means)
        words.append(f"\n> {rule.advice}", "bright_black")
        table.add_row(rule.name, shown, words)
    to.print(table)
