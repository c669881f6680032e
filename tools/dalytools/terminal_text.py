# SPDX-License-Identifier: GPL-2.0-or-later
"""Text made fit for people at a terminal."""

from __future__ import annotations


def plain(text: str) -> str:
    """Return the text with all that does not print, control characters above all, as escapes: it cannot steer it."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)


def counted(number: int, one: str, several: str = "") -> str:
    """Say how many: ``1 record``, ``2 records``; ``several`` where it is not ``one`` with an s."""
    return f"{number} {one if number == 1 else several or one + 's'}"
