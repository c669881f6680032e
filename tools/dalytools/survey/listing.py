# SPDX-License-Identifier: GPL-2.0-or-later
"""A survey in the terminal: a heat map of bits for what moves, a line for what does not; as wide as the terminal."""

from __future__ import annotations

import textwrap
from itertools import groupby
from typing import TYPE_CHECKING, Final

from dalytools.survey.findings import HEADINGS, UNKNOWN
from dalytools.survey.heat import STEPS, byte_heat
from dalytools.survey.place import MODBUS
from dalytools.survey.words import held, named, spacing
from dalytools.terminal_text import counted, plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from dalytools.survey.findings import Finding
    from dalytools.survey.survey import Survey

_SIGNS: Final = "·░▒▓█"
_PLAIN_SIGNS: Final = ".-+*#"
_COLOURS: Final = ("bright_black", "blue", "cyan", "yellow", "bold red")
_LABEL: Final = 7
_BYTE: Final = 9
_FAINT, _CLAIM, _PLACE, _UNKNOWN = "bright_black", "green", "bold", "bold magenta"


class Listing:
    """Prints to a console."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._signs = _SIGNS if console.encoding.startswith("utf") else _PLAIN_SIGNS

    def show(self, survey: Survey, findings: Sequence[Finding], *, several_buses: bool) -> None:
        """Print all of it."""
        self._head(survey, findings)
        for group, of_group in groupby(findings, key=lambda one: one.group):
            self._line()
            self._line((HEADINGS[group], _UNKNOWN if group == UNKNOWN else _PLACE))
            for bus, of_bus in groupby(of_group, key=lambda one: one.place.bus):
                if several_buses:
                    self._line((f"bus {plain(bus)}", _PLACE))
                self._places(list(of_bus))

    def _head(self, survey: Survey, findings: Sequence[Finding]) -> None:
        kinds = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in survey.kinds.most_common())
        self._line(f"{counted(survey.records, 'record')} ({kinds}), {counted(len(findings), 'place')}")
        if survey.left_out:
            self._line(f"{survey.left_out} payloads of further places left out")
        signs: list[tuple[str, str]] = [("bits, how often each flips: ", _FAINT)]
        for sign, words, colour in zip(self._signs, STEPS, _COLOURS, strict=True):
            signs += [(sign, colour), (f" {words}  ", _FAINT)]
        self._line(*signs)

    def _places(self, findings: Sequence[Finding]) -> None:
        quiet: list[Finding] = []
        registers: list[Finding] = []
        for one in findings:
            if one.place.dialect in MODBUS and one.place.size == 2:
                registers.append(one)
            elif one.constant:
                quiet.append(one)
            else:
                self._moving(one)
        if registers:
            self._registers(registers)
        if quiet:
            self._line()
        for one in quiet:
            self._constant(one)

    def _moving(self, one: Finding) -> None:
        stream, moves = one.stream, one.stream.moves
        self._line()
        self._line((one.place.name, _PLACE), (f"   {spacing(stream)}", ""))
        size = one.place.size
        across = max(1, (self._console.width - _LABEL) // _BYTE)
        for first in range(0, size, across):
            part = range(first, min(size, first + across))
            self._line((" " * _LABEL, ""), ("".join(f"{f'd{index}':<{_BYTE}}" for index in part).rstrip(), _FAINT))
            bits: list[tuple[str, str]] = [(f"{'bits':<{_LABEL}}", _FAINT)]
            for index in part:
                bits += [(self._signs[step], _COLOURS[step]) for step in byte_heat(moves, index)]
                bits.append((" ", ""))
            self._line(*bits)
            values = [held(stream, index) for index in part]
            self._line((f"{'held':<{_LABEL}}", _FAINT), "".join(f"{span:<{_BYTE}}" for span, _ in values).rstrip())
            if any(count for _, count in values):
                self._line(
                    (f"{'values':<{_LABEL}}", _FAINT), "".join(f"{count:<{_BYTE}}" for _, count in values).rstrip()
                )
            self._line(
                (f"{'newest':<{_LABEL}}", _FAINT), "".join(f"{stream.last[i]:02X}       " for i in part).rstrip()
            )
        self._names_and_claims(one)

    def _names_and_claims(self, one: Finding) -> None:
        names = "; ".join(f"{one.place.bytes_name(first, last)} {words}" for first, last, words in named(one))
        if names:
            self._wrapped("names", names, "")
        for claim in one.claims:
            self._wrapped(one.place.bytes_name(claim.first, claim.last), f"{claim.text} (n {claim.count})", _CLAIM)

    def _constant(self, one: Finding) -> None:
        held_always = f": {one.stream.last.hex(' ').upper()}" if one.stream.last else ""
        moved = "never moved" if one.stream.last else "no values"
        if one.stream.count == 1:
            moved = "seen once" if one.stream.last else moved
        self._line((one.place.name, _PLACE), f"   {spacing(one.stream)}; {moved}{held_always}")
        self._names_and_claims(one)

    def _registers(self, findings: Sequence[Finding]) -> None:
        for who, of_one in groupby(findings, key=lambda one: (one.place.who, one.place.dialect)):
            rows = list(of_one)
            self._line()
            self._line((f"{who[0]} {who[1]} registers", _PLACE), f"   the first {spacing(rows[0].stream)}")
            for constant, some in groupby(rows, key=lambda one: one.constant and not one.claims):
                if constant:
                    self._constant_registers(list(some))
                else:
                    for one in some:
                        self._register(one)

    def _register(self, one: Finding) -> None:
        moves = one.stream.moves
        pieces: list[tuple[str, str]] = [(f" {one.place.number:04X}  ", _FAINT)]
        for index in (0, 1):
            pieces += [(self._signs[step], _COLOURS[step]) for step in byte_heat(moves, index)]
        spans = " ".join(held(one.stream, index)[0] for index in (0, 1))
        names = ", ".join(words for _, _, words in named(one))
        self._line(*pieces, (f"  {spans:<13}", ""), (one.stream.last.hex().upper(), ""), f"  {names}".rstrip())
        for claim in one.claims:
            where = "" if claim.text.startswith("registers") else one.place.bytes_name(claim.first, claim.last)
            self._wrapped(where, f"{claim.text} (n {claim.count})", _CLAIM)

    def _constant_registers(self, findings: Sequence[Finding]) -> None:
        across = max(1, (self._console.width - _LABEL - 16) // 5)
        rows: list[list[Finding]] = []
        for one in findings:
            if rows and len(rows[-1]) < across and one.place.number == rows[-1][-1].place.number + 1:
                rows[-1].append(one)
            else:
                rows.append([one])
        for row in rows:
            words = " ".join(one.stream.last.hex().upper() for one in row)
            self._line((f" {row[0].place.number:04X}  ", _FAINT), words, ("  never moved", _FAINT))

    def _wrapped(self, where: str, words: str, style: str) -> None:
        width = max(20, self._console.width - _LABEL)
        label = f"  {where}".ljust(_LABEL - 1) + " "
        width -= len(label) - _LABEL
        for line in textwrap.wrap(plain(words), width, break_long_words=True) or [""]:
            self._line((label, _FAINT), (line, style))
            label = " " * len(label)

    def _line(self, *pieces: str | tuple[str, str]) -> None:
        from rich.text import Text

        text = Text.assemble(*pieces)
        text.rstrip()
        self._console.print(text, soft_wrap=True)
