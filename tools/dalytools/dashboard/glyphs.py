# SPDX-License-Identifier: GPL-2.0-or-later
"""The signs a screen is drawn with: for terminals that know Unicode, and for those that do not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True, slots=True)
class Glyphs:
    """One sign for each."""

    full: str
    half: str
    empty: str
    on: str
    off: str
    unknown: str
    high: str
    low: str
    rule: str


UNICODE = Glyphs("█", "▌", "░", "●", "○", "·", "▲", "▼", "─")
ASCII = Glyphs("#", "=", ".", "*", "o", "?", "^", "v", "-")


def glyphs_for(environment: Mapping[str, str]) -> Glyphs:
    """Choose by the locale, as terminal programs do: the first of LC_ALL, LC_CTYPE, LANG that is set."""
    named = (environment.get(name, "") for name in ("LC_ALL", "LC_CTYPE", "LANG"))
    locale = next((text for text in named if text), "")
    return UNICODE if "utf-8" in locale.lower() or "utf8" in locale.lower() else ASCII
