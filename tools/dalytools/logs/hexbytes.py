# SPDX-License-Identifier: GPL-2.0-or-later
r"""Bytes as people and programs write them: ``A5 40``, ``a5:40``, ``A5,40``, ``0xA5, 0x40``, ``A540``, ``b'\xa5@'``."""

from __future__ import annotations

import ast
import re
import warnings

_PAIRS = re.compile(r"(?:0x|\\x)?[0-9A-Fa-f]{2}(?:[ \t,:;|_-]{0,4}(?:0x|\\x)?[0-9A-Fa-f]{2})*[ \t,:;|_-]{0,4}")
_LOOSE = re.compile(r"(?:0x)?[0-9A-Fa-f]{1,2}(?:[ \t,]{1,4}(?:0x)?[0-9A-Fa-f]{1,2}){3,}[ \t,]{0,4}")
_DECIMAL = re.compile(r"0|[1-9][0-9]{0,2}")
_TOKEN = re.compile(r"(?:0x|\\x)?([0-9A-Fa-f]{1,2})")
_LITERAL = re.compile(r"(?:bytearray|bytes)?\(?(b'(?:[^'\\\n]|\\.){0,4000}'|b\"(?:[^\"\\\n]|\\.){0,4000}\")\)?")
_MARKUP = re.compile(r"0x|\\x|[ \t,:;|_-]")


def hex_bytes(text: str) -> bytes | None:
    """Read bytes in hex, whole text; None where it is anything else. ``5`` for ``05`` only with blanks between."""
    text = text.strip()
    if not text:
        return None
    if _PAIRS.fullmatch(text):
        return bytes.fromhex(_MARKUP.sub("", text))
    if _LOOSE.fullmatch(text):
        return bytes(int(token, 16) for token in _TOKEN.findall(text))
    return None


def decimal_bytes(text: str) -> bytes | None:
    """Read bytes in decimal, with blanks or commas between them: ``165, 64, 144``; None where it is anything else."""
    parts = text.strip().rstrip(",").replace(",", " ").split()
    if not parts or not all(_DECIMAL.fullmatch(part) for part in parts):
        return None
    values = [int(part) for part in parts]
    return bytes(values) if max(values) <= 255 else None


def literal_bytes(text: str) -> bytes | None:
    r"""Read the first bytes of Python's making in a text: ``bytearray(b'\xa5@\x90')``; None where there are none."""
    found = _LITERAL.search(text)
    if not found:
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # of an escape that Python doesn't have
            value: object = ast.literal_eval(found[1])
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return None
    return value if isinstance(value, bytes) else None
