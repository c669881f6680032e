# SPDX-License-Identifier: GPL-2.0-or-later
"""The lines of a log, read in pieces: UTF-8, UTF-16 with its mark, or GB 18030, as Chinese terminal programs write."""

from __future__ import annotations

import codecs
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from collections.abc import Iterator

PIECE = 1 << 16  # bytes; a longer line comes in pieces of about this length, cut at a blank where there is one


def is_text(start: bytes) -> bool:
    """Whether a file that begins so is a text."""
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE, codecs.BOM_UTF8)):
        return True
    return bool(start) and not any(byte < 0x20 and byte not in b"\t\n\v\f\r\x1b" for byte in start)


def text_lines(stream: BinaryIO, start: bytes = b"") -> Iterator[str]:
    """Yield the lines of a text, without their ends. ``start``: what was read from the stream already."""
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16-le" if start.startswith(codecs.BOM_UTF16_LE) else "utf-16-be"
        decoder = codecs.getincrementaldecoder(encoding)("replace")
        start = decoder.decode(start[2:]).encode("utf-8", "replace")
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
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("gb18030", "replace")
