# SPDX-License-Identifier: GPL-2.0-or-later
"""The terminal: its other screen while the dashboard is on, and no more bytes for a picture than what has changed."""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING, Final, Self

from rich.console import Console

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType

    from rich.text import Text

_BEGIN: Final = "\x1b[?1049h\x1b[?25l\x1b[?7l\x1b[2J"  # other screen, no cursor, no wrapping of lines, empty
_REST: Final = "\x1b[K"  # nothing more in this line
END: Final = "\x1b[0m\x1b[?7h\x1b[?25h\x1b[?1049l"
"""What puts a terminal right, whatever was on it."""


class Screen:
    """Draws lines on the terminal behind a descriptor, within a ``with``; afterwards the terminal is as before.

    ``drawn`` counts bytes. Colours as rich finds them: none with NO_COLOR.
    """

    def __init__(self, fd: int) -> None:
        self.drawn = 0
        self._fd = fd
        self._console = Console(force_terminal=True, highlight=False, markup=False, emoji=False, legacy_windows=False)
        self._before: list[str] = []
        self._size = 0, 0

    @property
    def size(self) -> tuple[int, int]:
        """Columns and lines, as the terminal has them now."""
        try:
            columns, rows = os.get_terminal_size(self._fd)
        except OSError:
            return 80, 24
        return (columns or 80, rows or 24)

    def draw(self, lines: Sequence[Text]) -> None:
        """Show these lines, from the top; what is too wide is cropped."""
        size = self.size
        if size != self._size:
            self._size, self._before = size, []
            self._write("\x1b[2J")
        self._console.width = size[0]
        out: list[str] = []
        now = [self._rendered(line, size[0]) for line in lines[: size[1]]]
        for row, text in enumerate(now):
            if row >= len(self._before) or self._before[row] != text:
                out.append(f"\x1b[{row + 1};1H{text}")
        self._before = now
        if out:
            self._write("".join(out))

    def _rendered(self, line: Text, width: int) -> str:
        with self._console.capture() as captured:
            self._console.print(line, end="", no_wrap=True, overflow="crop", crop=True)
        # In the last column the cursor still stands on the last sign, which must not be wiped.
        return f"{captured.get()}\x1b[0m{_REST if line.cell_len < width else ''}"

    def _write(self, text: str) -> None:
        data = text.encode("utf-8", errors="replace")
        self.drawn += len(data)
        while data:
            data = data[os.write(self._fd, data) :]

    def __enter__(self) -> Self:
        self._write(_BEGIN)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(OSError):
            self._write(END)
