# SPDX-License-Identifier: GPL-2.0-or-later
"""The bus: how the capture goes, how healthy the traffic is, a line for each board."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dalytools.dashboard.words import LABEL, OLD, STALE_S, WRITE, clock, flow, line, said, size, span
from dalytools.record_lines import line as record_line
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from rich.text import Text

    from dalytools.dashboard.state import State
    from dalytools.dashboard.status import Status
    from dalytools.dashboard.told import BoardTold

_COLUMNS = (6, 6, 8, 6, 18, 7, 8, 8)
_HEADS = ("board", "V", "A", "SOC %", "cells mV (spread)", "faults", "replies", "unansw.")
_WORST = "bold red"
_ODD = "yellow"
_RESPONSE = "  ms 50/95%"


def capture_line(status: Status, width: int) -> Text:
    """Say what is captured, and where to; the first line of the screen. Of a long name of a file its end is shown."""
    pieces = [f" {status.port}  {status.baud} baud", clock(status.seconds), size(status.written)]
    if status.marks:
        pieces.append(counted(status.marks, "mark"))
    whole = line(said("  ".join(pieces), "reverse"))
    for trouble in [f"{status.lost} LOST"] * bool(status.lost) + [f"WAITING FOR {name}" for name in status.away]:
        whole.append_text(line(said("  ", "reverse"), said(f" {trouble} ", "bold white on red")))
    room = max(0, width - whole.cell_len - 3)
    file = status.file if len(status.file) <= room else f"..{status.file[-max(1, room - 2) :]}"
    whole.append_text(said(f"  {file} ".ljust(room + 3), "reverse"))
    return whole


def health_lines(state: State, status: Status, width: int, now: float) -> list[Text]:
    """Say how much comes, how much of it is good, and what is wrong with the talk on the bus."""
    pieces = [said(f"{state.rate(now):.1f} records/s"), said(f"{state.kinds.good} good")]
    for count, what, style in ((state.kinds.bad, "bad", _WORST), (state.kinds.junk, "junk", _ODD)):
        pieces.append(said(f"{count} {what}", style if count else ""))
    unanswered = state.unanswered(now).total()
    pieces.append(said(f"{unanswered} unanswered", _WORST if unanswered else ""))
    for count, what, several in (
        (state.retries, "retry", "retries"),
        (state.echoes, "echo", "echoes"),
        (state.unasked, "not asked for", "not asked for"),
        (state.second_hosts, "by a second host", "by a second host"),
        (state.contradictions, "contradiction", "contradictions"),
    ):
        if count:
            pieces.append(said(counted(count, what, several), _ODD))
    behind = status.records - state.records
    if behind > max(50, 2 * state.rate(now)):
        pieces.append(said(f"the screen is {behind} records behind", OLD))
    lines = flow("Bus", pieces, width)
    if state.last_write:
        shown = record_line(state.last_write)
        text = (
            f"{state.writes} write{'s' if state.writes > 1 else ''}, the last at {shown.time}: {shown.who} {shown.what}"
        )
        lines += flow("Written", [said(f" {text}  {shown.values} ".rstrip() + " ", WRITE)], width)
    return lines


def board_lines(state: State, selected: str, rows: int, now: float) -> list[Text]:
    """Lay out a line a board below a head, at most `rows`, around the selected one."""
    names = state.names()
    head = "".join(text.rjust(width) for text, width in zip(_HEADS, _COLUMNS, strict=True))
    head += _RESPONSE
    if not names:
        return [said(head, LABEL), said("  no board has answered yet", OLD)]
    first = 0
    if len(names) > rows:
        first = max(0, min(names.index(selected) - rows // 2, len(names) - rows))
    lines = [said(head, LABEL)]
    unanswered = state.unanswered(now)
    for name in names[first : first + rows]:
        shown = _board(state.boards[name], unanswered[name], now)
        lines.append(line(said(">" if name == selected and len(names) > 1 else " ", "bold"), shown))
        if name == selected and len(names) > 1:
            lines[-1].stylize("reverse")
    return lines


def _board(board: BoardTold, unanswered: int, now: float) -> Text:
    told = board.told
    voltage, current, soc = (told.get(f"daly.{name}") for name in ("pack.voltage", "pack.current", "soc"))
    low, high = told.get("daly.cells.min"), told.get("daly.cells.max")
    if not low or not high:
        low, high = told.get("daly.cell.min_voltage"), told.get("daly.cell.max_voltage")
    cells = ""
    if low and high:
        cells = f"{low.number:.0f}..{high.number:.0f} ({high.number - low.number:.0f})"
    faults = board.faults()
    known = board.faults_at() is not None
    columns = (
        (board.name, ""),
        (f"{voltage.number:.1f}" if voltage else "", ""),
        (f"{current.number:.1f}" if current else "", ""),
        (f"{soc.number:.1f}" if soc else "", ""),
        (cells, ""),
        (str(len(faults)) if faults else "none" if known else "", _WORST if faults else ""),
        (str(board.replies), ""),
        (str(unanswered), _WORST if unanswered else ""),
    )
    widths = (_COLUMNS[0] - 1, *_COLUMNS[1:])
    pieces = [said(text.rjust(width), style) for (text, style), width in zip(columns, widths, strict=True)]
    half, most = board.wait_ms(0.5), board.wait_ms(0.95)
    if half is not None and most is not None:
        pieces.append(said(f"{half:.0f}/{most:.0f}".rjust(len(_RESPONSE))))
    age = now - board.heard_at
    if board.replies and age > STALE_S:
        whole = line(*pieces, said(f"   silent {span(age)}"))
        whole.stylize(OLD)
        return whole
    return line(*pieces)
