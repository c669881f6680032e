# SPDX-License-Identifier: GPL-2.0-or-later
"""The page: one HTML file with everything in it. It opens offline, and asks nothing of any net.

Text of a capture (comments, names) is data, never markup: escaped in HTML, and in JSON so that it cannot end a script.
"""

from __future__ import annotations

import html
import json
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from dalytools import __version__
from dalytools.findings.table import when
from dalytools.report.figures import board_figure, bus_figure
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dalytools.findings.finding import Finding
    from dalytools.report.collect import Collected
    from dalytools.report.figures import Figure

_STYLE = """
:root { color-scheme: light dark; --text: #1d2433; --faint: #5c677d; --line: #d5dae3; --page: #ffffff; --box: #f5f7fa;
  --bad: #b3261e; --warn: #8a5300; }
:root.dark { --text: #e4e8ef; --faint: #9aa5b8; --line: #363d4a; --page: #14171c; --box: #1d2128; --bad: #ff8a80;
  --warn: #ffb74d; }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--text); background: var(--page); margin: 0 auto;
  max-width: 1280px; padding: 12px 16px 60px; }
h1 { font-size: 1.5em; margin: .3em 0; overflow-wrap: anywhere; } h2 { font-size: 1.2em; margin: 1.6em 0 .3em; }
.faint { color: var(--faint); } .bad { color: var(--bad); font-weight: 600; } .warn { color: var(--warn); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; margin: .4em 0; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--line); padding: 3px 12px 3px 0; text-align: left; vertical-align: top; }
.found td:last-child { overflow-wrap: anywhere; } .found td:first-child + td { white-space: nowrap; }
@media (max-width: 640px) { .found tr { display: block; padding: 6px 0; border-bottom: 1px solid var(--line); }
  .found td { display: inline-block; border: 0; padding-bottom: 0; } .found td:last-child { display: block; } }
td:first-child { white-space: nowrap; }
th { font-weight: 600; color: var(--faint); } td.n, th.n { text-align: right; }
button { font: inherit; color: inherit; background: var(--box); border: 1px solid var(--line); border-radius: 6px;
  padding: 3px 10px; } .top { display: flex; justify-content: space-between; align-items: start; gap: 12px; }
noscript { display: block; background: var(--box); padding: 8px 12px; }
"""

_SCRIPT = """
(function () {
  var figures = JSON.parse(document.getElementById('figures').textContent);
  var root = document.documentElement, busy = false, boxes = [];
  var dark = window.matchMedia('(prefers-color-scheme: dark)').matches;
  function colours() {
    var style = getComputedStyle(root), text = style.getPropertyValue('--text').trim();
    var line = style.getPropertyValue('--line').trim(), page = style.getPropertyValue('--page').trim();
    var faint = style.getPropertyValue('--faint').trim();
    var change = { 'modebar.bgcolor': 'rgba(0,0,0,0)', 'modebar.color': faint, 'modebar.activecolor': text,
      'font.color': text, 'hoverlabel.bgcolor': page, 'hoverlabel.font.color': text };
    return function (layout) {
      Object.keys(layout).forEach(function (key) {
        if (/^[xy]axis\\d*$/.test(key)) {
          change[key + '.gridcolor'] = line; change[key + '.zerolinecolor'] = line; change[key + '.linecolor'] = line;
        }
      });
      return change;
    };
  }
  function paint() {
    root.classList.toggle('dark', dark);
    boxes.forEach(function (box) { Plotly.relayout(box, colours()(box.layout)); });
  }
  var narrow = window.innerWidth < 640;
  figures.forEach(function (figure) {
    var box = document.getElementById(figure.id);
    if (narrow && figure.data.length > 12) { figure.layout.showlegend = false; }
    Plotly.newPlot(box, figure.data, figure.layout,
      { responsive: true, displaylogo: false, scrollZoom: false, displayModeBar: narrow ? false : 'hover' });
    boxes.push(box);
    box.on('plotly_relayout', function (change) {
      if (busy) { return; }
      var next = null;
      if ('xaxis.range[0]' in change) { next = [change['xaxis.range[0]'], change['xaxis.range[1]']]; }
      if ('xaxis.range' in change) { next = change['xaxis.range']; }
      if (change['xaxis.autorange']) { next = figure.layout.xaxis.range; }
      if (!next) { return; }
      busy = true;
      Promise.all(boxes.filter(function (other) { return other !== box; }).map(function (other) {
        return Plotly.relayout(other, { 'xaxis.range': next.slice() });
      })).then(function () { busy = false; }, function () { busy = false; });
    });
  });
  document.getElementById('theme').addEventListener('click', function () { dark = !dark; paint(); });
  paint();
  root.setAttribute('data-ready', String(boxes.length));
})();
"""


def page(title: str, collected: Collected, found: Sequence[tuple[str, Finding]], library: str) -> str:
    """Return the page.

    title: what was reported on. found: what was found, each with the file's name, or nothing where there is only one.
    library: plotly.js.
    """
    figures = [("bus", bus_figure(collected))]
    body = [_head(title, collected), _found(found)]
    for index, board in enumerate(collected.boards.values()):
        figure = board_figure(board, collected)
        texts = ", ".join(str(text) for text in board.newest.values())
        body.append(f"<h2>{_text(board.name.capitalize())}</h2>")
        if texts:
            body.append(f'<p class="faint">{_text(texts)}</p>')
        if figure["data"]:
            figures.append((f"board-{index}", figure))
            body.append(f'<div id="board-{index}"></div>')
        else:
            body.append('<p class="faint">It told no values that can be drawn.</p>')
        if board.faults_left_out:
            body.append(f'<p class="faint">{board.faults_left_out} more times that a fault was there are left out.</p>')
    body += ["<h2>Bus</h2>", '<div id="bus"></div>', _responses(collected), _events(collected)]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; script-src 'unsafe-inline'; "
        "style-src 'unsafe-inline'; img-src data: blob:\">\n"
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_text(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        + "\n".join(body)
        + f'\n<script type="application/json" id="figures">{_json(figures)}</script>\n'
        + f"<script>{library}</script>\n<script>{_SCRIPT}</script>\n</body>\n</html>\n"
    )


def _head(title: str, collected: Collected) -> str:
    kinds = ", ".join(f"{count} {_text(kind.replace('_', ' '))}" for kind, count in collected.kinds.most_common())
    begin = datetime.fromtimestamp(collected.begin_ns / 1e9 + collected.start, UTC)
    length = _duration(collected.end - collected.start)
    span = f"{begin:%Y-%m-%d %H:%M:%S} UTC, {length}" if collected.records else "no records"
    spoken = ", ".join(_text(name) for name in (*collected.transports, *collected.dialects) if name)
    left_out = f"; {collected.boards_left_out} replies of further boards left out" if collected.boards_left_out else ""
    return (
        f'<div class="top"><h1>{_text(title)}</h1><button id="theme" type="button">light / dark</button></div>\n'
        f"<p>{span}. {counted(collected.records, 'record')}: {kinds or 'none'}.<br>"
        f'<span class="faint">{spoken}{left_out}. dalyshark {_text(__version__)}. '
        "Drag to zoom, double-click to zoom out; all plots share the time.</span></p>\n"
        "<noscript>The plots need JavaScript; the tables do not.</noscript>"
    )


def _found(found: Sequence[tuple[str, Finding]]) -> str:
    if not found:
        return "<h2>Found</h2>\n<p>Nothing to complain of.</p>"
    classes = {"error": "bad", "warning": "warn"}
    rows: list[str] = []
    advised: set[tuple[str, str]] = set()
    for file, finding in found:
        where = f"{file}: {finding.place}" if file else str(finding.place)
        moment = when(finding.tally, UTC, day=True).replace("\n", ", ", 1).replace("\n", " to ")
        moment += " UTC" if finding.tally.first_ns else ""
        faint = [*finding.examples, f"packets {moment}" if moment[0].isdigit() else moment]
        if (finding.rule, finding.advice) not in advised:  # once is enough for people
            faint.append(f"→ {finding.advice}")
            advised.add((finding.rule, finding.advice))
        rows.append(
            f'<tr><td class="{classes.get(str(finding.severity), "faint")}">{_text(str(finding.severity))}</td>'
            f"<td>{_text(finding.rule)}</td><td>{_text(f'{where}: {finding.text}')}"
            f'<div class="faint">{"<br>".join(map(_text, faint))}</div></td></tr>'
        )
    return f'<h2>Found</h2>\n<div class="wide"><table class="found">{"".join(rows)}</table></div>'


def _responses(collected: Collected) -> str:
    heads = (
        "board",
        "asked",
        "requests",
        "unanswered",
        "retries",
        "echoes",
        "replies",
        "p50, ms",
        "p95, ms",
        "p99, ms",
        "max, ms",
    )
    rows: list[tuple[str, ...]] = []
    for (board, what), asked in sorted(collected.asked.items()):
        times = asked.response
        waits = [f"{1000 * time:.1f}" for time in (*map(times.at, (0.5, 0.95, 0.99)), times.high)]
        rows.append(
            (
                board,
                what,
                str(asked.requests),
                str(asked.unanswered),
                str(asked.retries),
                str(asked.echoes),
                str(asked.replies),
                *(waits if times.count else ("", "", "", "")),
            )
        )
    return f"<h3>Requests, replies, response times</h3>\n{_table(heads, rows, numbers_from=2)}" if rows else ""


def _events(collected: Collected) -> str:
    out: list[str] = []
    if collected.events:
        rows = [(_time(collected, time), text) for time, text in collected.events]
        out.append(f"<h3>Events</h3>\n{_table(('time, UTC', 'what'), rows)}")
        if collected.events_left_out:
            out.append(f'<p class="faint">and {collected.events_left_out} more</p>')
    if collected.pauses:
        longest = sorted(collected.pauses, key=lambda pause: -pause[1])[:20]
        rows = [(_time(collected, start), f"{length:.3f}") for start, length in longest]
        out.append(f"<h3>Longest pauses</h3>\n{_table(('from, UTC', 'for, s'), rows, numbers_from=1)}")
    return "\n".join(out)


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]], numbers_from: int = 99) -> str:
    def cells(tag: str, row: Sequence[str]) -> str:
        return "".join(
            f"<{tag}{' class=n' if index >= numbers_from else ''}>{_text(cell)}</{tag}>"
            for index, cell in enumerate(row)
        )

    lines = "".join(f"<tr>{cells('td', row)}</tr>\n" for row in rows)
    return f'<div class="wide"><table><tr>{cells("th", heads)}</tr>\n{lines}</table></div>'


def _time(collected: Collected, seconds: float) -> str:
    moment = datetime.fromtimestamp(collected.begin_ns / 1e9 + seconds, UTC)
    return f"{moment:%Y-%m-%d %H:%M:%S}.{moment.microsecond // 1000:03d}"


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.1f} s"
    if seconds < 7200:
        return f"{seconds / 60:.1f} min"
    return f"{seconds / 3600:.1f} h"


def _json(figures: Sequence[tuple[str, Figure]]) -> str:
    text = json.dumps([{"id": name, **figure} for name, figure in figures], separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _text(text: str) -> str:
    return html.escape(
        "".join(character if character.isprintable() else "\N{REPLACEMENT CHARACTER}" for character in text)
    )
