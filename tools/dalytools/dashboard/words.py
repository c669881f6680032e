# SPDX-License-Identifier: GPL-2.0-or-later
"""Pieces of a screen's lines: text of the bus made harmless, ages, parts that are marked when they are old."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from rich.text import Text

from dalytools.terminal_text import plain

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dalytools.dashboard.glyphs import Glyphs
    from dalytools.dashboard.told import Told

STALE_S: Final = 5.0
"""A value that is older is marked."""
WRITE: Final = "bold white on magenta"
OLD: Final = "dim italic"
LABEL: Final = "bold"
_INDENT: Final = 8


def said(text: object, style: str = "") -> Text:
    """Make a piece of a line; nothing in it can steer the terminal."""
    return Text(plain(str(text)), style=style, no_wrap=True, overflow="crop", end="")


def line(*pieces: Text) -> Text:
    """Put pieces together to a line."""
    whole = said("")
    for piece in pieces:
        whole.append_text(piece)
    return whole


def flow(label: str, pieces: Sequence[Text], width: int) -> list[Text]:
    """Lay out pieces behind a label, two spaces apart, in as many lines as they take."""
    lines: list[Text] = []
    current, begun = line(said(f"{label:<{_INDENT}}", LABEL)), False
    for piece in pieces:
        if begun and current.cell_len + 2 + piece.cell_len > width:
            lines.append(current)
            current, begun = said(" " * _INDENT), False
        if begun:
            current.append("  ")
        current.append_text(piece)
        begun = True
    return [*lines, current]


def span(seconds: float) -> str:
    """Say how long: ``12 s``, ``3 min``, ``2 h``."""
    if seconds < 120:
        return f"{max(seconds, 0):.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.0f} h"


def clock(seconds: float) -> str:
    """Say a time since the start: ``0:01:12``."""
    minutes, rest = divmod(int(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{rest:02}"


def size(number: int) -> str:
    """Say how many bytes: ``14.1 kB``."""
    return f"{number / 1000:.1f} kB" if number < 1_000_000 else f"{number / 1_000_000:.1f} MB"


class Value(NamedTuple):
    """A value with the words for it."""

    told: Told
    text: str
    style: str = ""


def aged(values: Sequence[Value], now: float) -> list[Text]:
    """Make pieces of values: those that are old are dim, with their age behind them; once, if it is one for all."""
    ages = [span(now - value.told.at) if now - value.told.at > STALE_S else "" for value in values]
    if len(values) > 1 and ages[0] and len(set(ages)) == 1:
        return [*(said(value.text, OLD) for value in values), said(f"({ages[0]} old)", OLD)]
    return [
        said(f"{value.text} ({age} old)", OLD) if age else said(value.text, value.style)
        for value, age in zip(values, ages, strict=True)
    ]


def rule(title: str, width: int, glyphs: Glyphs) -> Text:
    """Lay out the line above a part of the screen."""
    whole = line(said(glyphs.rule * 2 + " ", "dim"), said(title, LABEL), said(" "))
    whole.append(glyphs.rule * max(0, width - whole.cell_len), "dim")
    return whole
