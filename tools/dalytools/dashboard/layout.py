# SPDX-License-Identifier: GPL-2.0-or-later
"""From what is known to the lines of a screen of any size."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from dalytools.dashboard.bus_panel import board_lines, capture_line, health_lines
from dalytools.dashboard.cell_panel import cell_lines
from dalytools.dashboard.frame_panel import frame_lines
from dalytools.dashboard.pack_panel import pack_lines
from dalytools.dashboard.words import line, rule, said

if TYPE_CHECKING:
    from rich.text import Text

    from dalytools.dashboard.glyphs import Glyphs
    from dalytools.dashboard.state import State
    from dalytools.dashboard.status import Status

_LEAST_FRAMES: Final = 3
_LEAST_CELLS: Final = 2


@dataclass(frozen=True, slots=True)
class View:
    """What one picture is made of. now: s, monotonic; paused_s: None where it is not."""

    state: State
    status: Status
    selected: str
    now: float
    paused_s: float | None = None


def screen_lines(view: View, width: int, height: int, glyphs: Glyphs) -> list[Text]:
    """Lay out a screen: exactly `height` lines; what is too wide is for the screen to crop."""
    state, now = view.state, view.now
    top = [capture_line(view.status, width), *health_lines(state, view.status, width, now)]
    top += board_lines(state, view.selected, max(2, height // 6), now)
    board = state.boards.get(view.selected)
    if board:
        top.append(rule(_title(board.name, len(state.boards)), width, glyphs))
        top += pack_lines(board, width, now, glyphs)
    left = height - len(top) - 1
    if board and left > 1:
        cells = cell_lines(board, width, max(_LEAST_CELLS, left - 2 - _LEAST_FRAMES), now, glyphs)
        top += cells[:left]
    left = height - len(top) - 1
    if left > 1:
        top += frame_lines(state, width, left - 1, now, glyphs)
    top = top[: height - 1]
    top += [said("")] * (height - 1 - len(top))
    return [*top, _keys(view)]


def _title(name: str, boards: int) -> str:
    return (f"Board {name}" if name.isdecimal() else name) + (f" of {boards} boards" if boards > 1 else "")


def _keys(view: View) -> Text:
    several = len(view.state.boards) > 1
    keys = [("m", "mark"), ("p", "pause" if view.paused_s is None else "go on")]
    keys += [("Tab", "or number: board")] * several + [("q", "end the capture")]
    pieces: list[Text] = []
    for key, what in keys:
        pieces += [said(f" {key} ", "reverse"), said(f" {what}  ")]
    if view.paused_s is not None:
        pieces.append(said(f" PAUSED {view.paused_s:.0f} s, capturing ", "bold black on yellow"))
    return line(*pieces)
