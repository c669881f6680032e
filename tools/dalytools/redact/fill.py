# SPDX-License-Identifier: GPL-2.0-or-later
"""What stands where something was: as long, of no meaning, and of the same kind for a reader.

    read       32 30 31 36 58 59 00 00   ->   58 58 58 58 58 58 00 00       letters of a text; padding stays
               1A 0B 1B 07 0C 22         ->   00 00 00 00 00 00             all else
    written    the first value 41 41 .. or 00 00 .., the second 41 42 or 00 01, the third ...

What is written is numbered, for a repeated request is a retry or an echo only where it is the same, and a reply to a
write says "as you asked" by being the same.
"""

from __future__ import annotations

from typing import Final

LETTER: Final = ord("X")
_PADDING: Final = frozenset(b"\x00\xff\x20")
_MOST_VALUES: Final = 65536
_TOLD: Final = 3
_DIGITS: Final = 2
"""So many A in front, and no more than so many letters behind, make a text one of ours."""


class Fill:
    """Fills for one capture. other: the byte that numbers are blanked with."""

    def __init__(self, other: int = 0) -> None:
        self.other = other
        self._written: dict[tuple[bool, bytes], bytes] = {}
        self._next: dict[tuple[bool, int], int] = {}

    def read(self, raw: bytes, *, text: bool) -> bytes:
        """Return what stands for bytes that a board says, or that nobody explains."""
        if text:
            return bytes(byte if byte in _PADDING else LETTER for byte in raw)
        return raw if _blank(raw) else bytes((self.other,)) * len(raw)

    def written(self, raw: bytes, *, text: bool) -> bytes:
        """Return what stands for bytes that a host writes: the same for the same."""
        letters = bytes(byte for byte in raw if byte not in _PADDING) if text else raw
        if _blank(letters):
            return raw
        key = (text, letters)
        new = self._written.get(key)
        if new is None:
            new = self._another(letters, text=text)
            if len(self._written) < _MOST_VALUES:
                self._written[key] = new
        if not text:
            return new
        left = iter(new)
        return bytes(byte if byte in _PADDING else next(left) for byte in raw)

    def _another(self, raw: bytes, *, text: bool) -> bytes:
        """Return the next number, written with as many bytes or letters; never what stood there."""
        size = len(raw)
        while True:
            number = self._next.get((text, size), 0)
            self._next[text, size] = number + 1
            new = _letters(number, size) if text else bytes(byte ^ self.other for byte in _bytes(number, size))
            if new != raw:
                return new


def filled(text: bytes) -> bool:
    """Tell whether a text is what stands in a copy for another, or looks like it: it tells nothing."""
    letters = bytes(byte for byte in text if byte not in _PADDING)
    digits = letters.lstrip(b"A")
    numbered = len(letters) - len(digits) >= _TOLD and len(digits) <= _DIGITS and (digits or b"A").isupper()
    return numbered or not letters.strip(bytes((LETTER,)))


def _blank(raw: bytes) -> bool:
    """Tell whether there is nothing: all 00, or all FF."""
    return not raw.strip(b"\x00") or not raw.strip(b"\xff")


def _bytes(number: int, size: int) -> bytes:
    return (number % 256**size).to_bytes(size)


def _letters(number: int, size: int) -> bytes:
    out = bytearray(b"A" * size)
    for at in range(size - 1, -1, -1):
        number, digit = divmod(number, 26)
        out[at] += digit
    return bytes(out)
