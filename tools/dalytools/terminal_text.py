# SPDX-License-Identifier: GPL-2.0-or-later
"""Text from a capture, made fit for a terminal."""

from __future__ import annotations


def plain(text: str) -> str:
    """Return the text with all that does not print, control characters above all, as escapes: it cannot steer it."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
