# SPDX-License-Identifier: GPL-2.0-or-later
"""Copies of the codes, numbers and passwords of a capture, wherever they stand: forward, backward, in swapped pairs.

What was learned is found again by any six bytes of it in a row (all of it, where it is shorter; from four on), so that
a part is found too. What is left of it in fewer bytes is for ``stale``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools.redact.fill import filled

if TYPE_CHECKING:
    from collections.abc import Iterator

WINDOW: Final = 6
SHORTEST: Final = 4
_MOST_WINDOWS: Final = 1 << 17
_MOST_VALUES: Final = 4096
_PADDING: Final = b"\x00\xff\x20"


class Copies:
    """What a capture has of codes, numbers and passwords."""

    def __init__(self) -> None:
        self.values: dict[bytes, None] = {}
        """Each whole, without padding at its ends."""
        self._windows: dict[int, set[bytes]] = {}
        self._count = 0

    def learn(self, raw: bytes) -> None:
        """Remember a value, or a part of one."""
        value = raw.strip(_PADDING)
        if not legible(value) or value in self.values or filled(value):
            return
        if len(self.values) < _MOST_VALUES:
            self.values[value] = None
        for shape in shapes(value):
            size = min(WINDOW, len(shape))
            windows = self._windows.setdefault(size, set())
            for at in range(len(shape) - size + 1):
                window = shape[at : at + size]
                if legible(window) and self._count < _MOST_WINDOWS:
                    self._count += window not in windows
                    windows.add(window)

    def find(self, data: bytes) -> list[tuple[int, int]]:
        """Return (start, stop) of each place where a copy stands, in order."""
        out: list[tuple[int, int]] = []
        for start, stop in sorted(self._found(data)):
            if out and start <= out[-1][1]:
                out[-1] = (out[-1][0], max(stop, out[-1][1]))
            else:
                out.append((start, stop))
        return out

    def _found(self, data: bytes) -> Iterator[tuple[int, int]]:
        for size, windows in self._windows.items():
            for at in range(len(data) - size + 1):
                if data[at : at + size] in windows:
                    yield at, at + size


def legible(value: bytes) -> bool:
    """Tell whether four characters or more are letters, digits or signs: what has fewer could be any number."""
    return sum(0x21 <= byte <= 0x7E for byte in value) >= SHORTEST


def shapes(value: bytes) -> set[bytes]:
    """Return a value as boards of all dialects send it: in order, backward; the bytes of words swapped."""
    found: set[bytes] = set()
    for whole in (value, value[::-1]):
        found.add(whole)
        for start in (0, 1):
            found.add(whole[:start] + _swapped(whole[start:]))
    return found


def _swapped(data: bytes) -> bytes:
    """Swap the bytes of each whole pair."""
    out = bytearray(data)
    even = len(out) // 2 * 2
    out[0:even:2], out[1:even:2] = out[1:even:2], out[0:even:2]
    return bytes(out)
