# SPDX-License-Identifier: GPL-2.0-or-later
"""The last records, one a line, as ``dalyshark decode`` says them; writes stand out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from dalytools.dashboard.words import WRITE, line, rule, said
from dalytools.record_lines import line as record_line

if TYPE_CHECKING:
    from rich.text import Text

    from dalyref.decoder import Decoded
    from dalytools.dashboard.glyphs import Glyphs
    from dalytools.dashboard.state import State

_COLOURS: Final = {
    "request": "cyan",
    "echo": "yellow",
    "modbus": "magenta",
    "bad_checksum": "red",
    "short": "red",
    "junk": "dim",
    "foreign": "blue",
    "event": "bold yellow",
}


def frame_lines(state: State, width: int, rows: int, now: float, glyphs: Glyphs) -> list[Text]:
    """Lay out the newest records in `rows` lines below a title."""
    newest = list(state.last)[-rows:] if rows > 0 else []
    return [
        rule("Last records", width, glyphs),
        *(_line(heard.record, overdue=heard.unanswered(now, state.reply_s)) for heard in newest),
    ]


def _line(record: Decoded, *, overdue: bool) -> Text:
    fields = record.fields
    shown = record_line(record, overdue=overdue)
    style = WRITE if "daly.write" in fields or "daly.write_result" in fields else _COLOURS.get(shown.kind, "")
    return line(
        said(f" {shown.time}  ", "dim"),
        said(f"{shown.who:<19}{shown.what:<21}", style),
        said(f" {shown.values}  " if shown.values else "  "),
        said(f"! {shown.warnings}" if shown.warnings else "", "bold red"),
    )
