# SPDX-License-Identifier: GPL-2.0-or-later
"""Text from a capture, made fit for a terminal."""

from __future__ import annotations


def plain(text: str) -> str:
    """Return the text with every control character (and what else does not print) as an escape: a file cannot steer it."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode("ascii") for c in text)
