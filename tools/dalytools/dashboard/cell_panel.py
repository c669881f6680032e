# SPDX-License-Identifier: GPL-2.0-or-later
"""The cells of the selected board as bars, the highest and the lowest marked, the spread in the title."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools.dashboard.words import OLD, STALE_S, line, rule, said, span

if TYPE_CHECKING:
    from rich.text import Text

    from dalytools.dashboard.glyphs import Glyphs
    from dalytools.dashboard.told import BoardTold

_BESIDE: Final = 10  # of a cell: number, voltage, marks, gap
_LONGEST_BAR: Final = 40
_STYLES: Final = {"highest": "bold yellow", "lowest": "bold cyan", "": ""}


def cell_lines(board: BoardTold, width: int, rows: int, now: float, glyphs: Glyphs) -> list[Text]:
    """Lay out the cells in at most `rows` lines below a title; in columns, with bars where there is room."""
    table = board.told.get("daly.cells.voltage")
    cells = [value for value in table.all if isinstance(value, int)] if table else []
    if not table or not cells:
        return [rule(_extremes(board, now), width, glyphs)]
    low, high = min(cells), max(cells)
    begin, end = scale(low, high)
    age = now - table.at
    old = f"   {span(age)} old" if age > STALE_S else ""
    title = (
        f"{len(cells)} cells: {low} to {high} mV, spread {high - low} mV, average {sum(cells) / len(cells):.0f} mV{old}"
    )
    columns = max(-(-len(cells) // max(rows, 1)), 2 if width >= 80 and len(cells) > 4 else 1)
    room = width // columns
    if room < _BESIDE:
        columns = max(1, width // _BESIDE)
        room = width // columns
    height = -(-len(cells) // columns)
    bar = min(room - _BESIDE - 1, _LONGEST_BAR)
    if bar < 3:
        bar = 0
    else:
        title += f"   bars {begin} to {end}"
    balance = board.told.get("daly.balance.cell")
    balanced = balance.all if balance else []
    lines = [rule(title, width, glyphs)]
    for row in range(min(height, rows)):
        pieces: list[Text] = []
        for at in range(row, len(cells), height):
            mark = ("highest" if cells[at] == high else "lowest" if cells[at] == low else "") if high > low else ""
            share = (cells[at] - begin) / (end - begin)
            shown = line(
                said(f"{at + 1:>2} ", OLD if old else "dim"),
                *_bar(share, bar, glyphs, OLD if old else _STYLES[mark] or "green"),
                said(f"{cells[at]:>4}{_sign(mark, glyphs)}", OLD if old else _STYLES[mark]),
                said("b" if at + 1 in balanced else " ", "bold magenta"),
            )
            shown.pad_right(max(0, room - shown.cell_len))
            pieces.append(shown)
        lines.append(line(*pieces))
    if height > rows:
        lines[-1] = said(f" ... {len(cells)} cells; make the window larger to see all", OLD)
    return lines


def scale(low: int, high: int) -> tuple[int, int]:
    """Choose where bars begin and end, mV: round numbers around all cells, that do not move with each reading."""
    step = next(step for step in (10, 20, 50, 100, 200, 500, 1000, 100_000) if high - low <= 4 * step)
    begin = max(0, (low - 1) // step * step)
    return begin, max(-(-(high + 1) // step) * step, begin + step)


def _bar(share: float, length: int, glyphs: Glyphs, style: str) -> list[Text]:
    """Draw a bar, `length` signs of which are filled up to `share` (0 to 1); length 0: none."""
    if not length:
        return []
    halves = max(0, min(2 * length, round(share * 2 * length)))
    drawn = glyphs.full * (halves // 2) + glyphs.half * (halves % 2)
    return [said(drawn, style), said(glyphs.empty * (length - len(drawn)), "dim"), said(" ")]


def _sign(mark: str, glyphs: Glyphs) -> str:
    return {"highest": glyphs.high, "lowest": glyphs.low}.get(mark, " ")


def _extremes(board: BoardTold, now: float) -> str:
    low, high = board.told.get("daly.cell.min_voltage"), board.told.get("daly.cell.max_voltage")
    if not low or not high:
        return "Cells: not told yet"
    age = now - high.at
    old = f"   {span(age)} old" if age > STALE_S else ""
    return (
        f"Cells: {low.number:.0f} to {high.number:.0f} mV   spread {high.number - low.number:.0f} mV "
        f"(no table of all cells yet){old}"
    )
