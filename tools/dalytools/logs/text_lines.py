# SPDX-License-Identifier: GPL-2.0-or-later
"""The lines of a log, read in pieces, without colours: UTF-8, UTF-16, or GB 18030, as Chinese programs write."""

from __future__ import annotations

import codecs
import re
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator

PIECE = 1 << 16  # bytes; a longer line comes in pieces of about this length, cut at a blank where there is one


_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]")
_CONTROLS_AT_MOST = 0.02  # of the bytes of a text: a bell, a broken-off line; a raw Daly bus has more than a tenth
_LETTERS = 8  # of UTF-16 without its mark, at least
_COLOUR = re.compile(r"\x1b\[[0-9;]{0,20}m")


def is_text(start: bytes) -> bool:
    """Whether a file that begins so is a text."""
    if _utf_16(start) or start.startswith(codecs.BOM_UTF8):
        return True
    return bool(start) and len(_CONTROL.findall(start)) <= _CONTROLS_AT_MOST * len(start)


def _utf_16(start: bytes) -> str:
    """Which UTF-16 it is, by its mark, or because every second byte of its first line is zero and no other; or none."""
    if start.startswith(codecs.BOM_UTF16_LE):
        return "utf-16-le"
    if start.startswith(codecs.BOM_UTF16_BE):
        return "utf-16-be"
    line = start[:200]
    for encoding, zeros, others in (("utf-16-le", line[1::2], line[::2]), ("utf-16-be", line[::2], line[1::2])):
        if len(zeros) >= _LETTERS and not any(zeros) and len(_CONTROL.findall(others)) * 20 <= len(others):
            return encoding
    return ""


def text_lines(stream: BinaryIO, start: bytes = b"") -> Iterator[str]:
    """Yield the lines of a text, without their ends. ``start``: what was read from the stream already."""
    if encoding := _utf_16(start):
        decoder = codecs.getincrementaldecoder(encoding)("replace")
        start = decoder.decode(start).removeprefix("\ufeff").encode("utf-8", "replace")
    else:
        decoder = None
        start = start.removeprefix(codecs.BOM_UTF8)
    rest = start
    while True:
        while (end := _end(rest)) is not None:
            yield _text(rest[: end[0]])
            rest = rest[end[1] :]
        while len(rest) > PIECE:
            cut = max(rest.rfind(mark, PIECE // 2, PIECE) for mark in (b" ", b",", b":", b"\t")) + 1 or PIECE
            yield _text(rest[:cut])
            rest = rest[cut:]
        piece = stream.read(PIECE)
        if not piece:
            break
        rest += decoder.decode(piece).encode("utf-8", "replace") if decoder else piece
    if rest:
        yield _text(rest.rstrip(b"\r"))


def _end(data: bytes) -> tuple[int, int] | None:
    """Where the first line ends, and where the next begins."""
    at = data.find(b"\n", 0, 2 * PIECE)
    carriage = data.find(b"\r", 0, at if at >= 0 else 2 * PIECE)
    if 0 <= carriage < len(data) - 1 and carriage != at - 1:
        return carriage, carriage + 1  # an old Mac's
    if at < 0:
        return None
    return at - (at > 0 and data[at - 1 : at] == b"\r"), at + 1


def _text(line: bytes) -> str:
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError:
        text = line.decode("gb18030", "replace")
    return _COLOUR.sub("", text)
