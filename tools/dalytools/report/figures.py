# SPDX-License-Identifier: GPL-2.0-or-later
"""Plots of what was collected, as plotly.js takes them: plain data, {"data": [...], "layout": {...}}.

One figure a board, one for the bus; in each, rows one below the other over one time axis. Colours of text and lines are
set by the page, light or dark.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dalytools.report.gaps import LONGER, broken, gaps, longest_step

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Iterable

    from dalytools.report.collect import BoardSeen, Collected
    from dalytools.report.series import Series

Trace = dict[str, Any]
Figure = dict[str, Any]

_ROW_PX = 190
_GAP_PX = 46
_PIXELS = 500
_MOST_DOTS = 1000
_KIND_COLOURS = {
    "frame": "#2a9d8f",
    "bad_checksum": "#d62828",
    "short": "#f77f00",
    "junk": "#7d7d7d",
    "foreign": "#457b9d",
    "event": "#b5179e",
}
_KIND_WORDS = {"frame": "good", "bad_checksum": "bad checksum", "short": "cut off"}
_STATES = {0: "stationary", 1: "charging", 2: "discharging"}


class _Rows:
    """Traces, row by row, from the top."""

    def __init__(self, collected: Collected) -> None:
        self._begin_ms = collected.begin_ns / 1e6
        self._start = collected.start
        self._end = collected.end
        self._titles: list[tuple[str, dict[str, Any]]] = []
        self.data: list[Trace] = []

    def times(self, seconds: Iterable[float]) -> list[float]:
        """Return times as plotly.js counts them: ms since 1970."""
        return [round(self._begin_ms + second * 1000, 3) for second in seconds]

    def row(self, heading: str, traces: list[Trace], **axis: object) -> None:
        """Add a row, if there is anything in it."""
        if not traces:
            return
        self._titles.append((heading, axis))
        suffix = "" if len(self._titles) == 1 else str(len(self._titles))
        self.data += [{**trace, "xaxis": "x", "yaxis": f"y{suffix}"} for trace in traces]

    def figure(self) -> Figure:
        """Return the whole of it."""
        count = max(1, len(self._titles))
        height = count * (_ROW_PX + _GAP_PX) + 70
        share, gap = _ROW_PX / (height - 70), _GAP_PX / (height - 70)
        layout: dict[str, Any] = {
            "height": height,
            "margin": {"l": 62, "r": 14, "t": 30, "b": 40},
            "hovermode": "x unified",
            "showlegend": True,
            "legend": {"orientation": "h", "y": -60 / height, "font": {"size": 11}},
            "xaxis": {
                "type": "date",
                "anchor": f"y{count}" if count > 1 else "y",
                "range": self.times((self._start, max(self._end, self._start + 0.001))),
                "showspikes": True,
                "spikemode": "across",
                "spikethickness": 1,
            },
            "annotations": [],
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
        }
        for index, (title, axis) in enumerate(self._titles):
            top = 1 - index * (share + gap)
            layout["yaxis" if not index else f"yaxis{index + 1}"] = {
                "domain": [max(0.0, top - share), top],
                "automargin": True,
                **axis,
            }
            layout["annotations"].append(
                {
                    "text": f"<b>{title}</b>",
                    "xref": "paper",
                    "yref": "paper",
                    "x": 0,
                    "y": top,
                    "xanchor": "left",
                    "yanchor": "bottom",
                    "showarrow": False,
                }
            )
        return {"data": self.data, "layout": layout}


def board_figure(board: BoardSeen, collected: Collected) -> Figure:
    """Return the plots of one board, all that it told about."""
    rows = _Rows(collected)
    series = board.series
    rows.row("Pack voltage, V", _lines(rows, series, ("voltage",), "V"))
    rows.row("Current, A (sign as sent)", _lines(rows, series, ("current",), "A"))
    rows.row("State of charge, %", _lines(rows, series, ("soc",), "%"))
    rows.row("Cells, mV", _lines(rows, series, _numbered(series, "cell"), "mV"))
    rows.row("Spread of the cells, mV", _lines(rows, series, ("spread",), "mV"))
    rows.row("Temperatures, C", _lines(rows, series, (*_numbered(series, "sensor"), "MOS", "board"), "C"))
    rows.row(
        "Switches and state",
        _steps(rows, series, ("charge MOS", "discharge MOS")) + _state(rows, series),
        tickvals=[0, 1, 2, 3, 4, 5, 6],
        ticktext=["charge off", "on", "discharge off", "on", *_STATES.values()],
        tickfont={"size": 10},
        range=[-0.4, 6.5],
    )
    rows.row("Faults", _faults(rows, board, collected.end), type="category", autorange="reversed")
    rows.row("Balancing, share of the time", _balancing(rows, board), title="cell")
    return rows.figure()


def bus_figure(collected: Collected) -> Figure:
    """Return the plots of the bus: records by kind, response times, events and pauses."""
    rows = _Rows(collected)
    columns = collected.over_time.columns()
    length = collected.over_time.length
    bars: list[Trace] = [
        {
            "type": "bar",
            "name": _KIND_WORDS.get(kind, kind),
            "x": rows.times(begin + length / 2 for begin, _ in columns),
            "y": [column[kind] / length for _, column in columns],
            "width": length * 1000,
            "marker": {"color": _KIND_COLOURS.get(kind, "#888888")},
            "hovertemplate": "%{y:.3g}/s",
        }
        for kind in _KIND_COLOURS
        if collected.kinds[kind]
    ]
    rows.row("Records a second, by kind", bars)
    rows.row("Response time, ms", _line_of(rows, "response", collected.response, "ms"))
    marks: list[Trace] = []
    if collected.events:
        marks.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": "event",
                "x": rows.times(time for time, _ in collected.events),
                "y": ["event"] * len(collected.events),
                "text": [_escaped(text) for _, text in collected.events],
                "hovertemplate": "%{text}",
                "marker": {"size": 9, "color": _KIND_COLOURS["event"]},
            }
        )
    for start, length_s in collected.pauses:
        marks.append(
            {
                "type": "scatter",
                "mode": "lines",
                "showlegend": False,
                "name": "pause",
                "x": rows.times((start, start + length_s)),
                "y": ["pause", "pause"],
                "line": {"width": 8, "color": "#7d7d7d"},
                "hovertemplate": f"{length_s:.3f} s of silence",
            }
        )
    rows.row("Events and pauses", marks, type="category")
    figure = rows.figure()
    figure["layout"]["barmode"] = "stack"
    figure["layout"]["bargap"] = 0
    return figure


def _numbered(series: dict[str, Series], what: str) -> tuple[str, ...]:
    return tuple(
        sorted((name for name in series if name.startswith(f"{what} ")), key=lambda name: int(name.split()[1]))
    )


def _lines(rows: _Rows, series: dict[str, Series], names: Iterable[str], unit: str) -> list[Trace]:
    return [trace for name in names if name in series for trace in _line_of(rows, name, series[name], unit)]


def _line_of(rows: _Rows, name: str, series: Series, unit: str) -> list[Trace]:
    if not series.count:
        return []
    times, values = broken(*series.points())
    few = len(values) == 1 or (None in values and len(values) <= _MOST_DOTS)  # of a short piece the line is no pixel
    return [
        {
            "type": "scatter",  # not scattergl: a remote desktop has no WebGL, and shows nothing
            "mode": "lines+markers" if few else "lines",
            "name": name,
            "x": rows.times(times),
            "y": values,
            "line": {"width": 1.4},
            "marker": {"size": 3 if len(values) > 1 else 6},
            "hovertemplate": f"%{{y:.6g}} {unit}",
        }
    ]


def _steps(rows: _Rows, series: dict[str, Series], names: tuple[str, ...]) -> list[Trace]:
    """Return switches, one above the other: off, on; off, on."""
    out: list[Trace] = []
    for level, name in enumerate(names):
        if name in series:
            times, values = broken(*series[name].points())
            out.append(
                {
                    "type": "scatter",
                    "mode": "lines",
                    "name": name,
                    "x": rows.times(times),
                    "y": [None if value is None else value + 2 * level for value in values],
                    "text": ["on" if value else "off" for value in values],
                    "line": {"shape": "hv", "width": 2},
                    "hovertemplate": "%{text}",
                }
            )
    return out


def _state(rows: _Rows, series: dict[str, Series]) -> list[Trace]:
    if "state" not in series:
        return []
    times, values = broken(*series["state"].points())
    return [
        {
            "type": "scatter",
            "mode": "lines",
            "name": "state",
            "x": rows.times(times),
            "y": [None if value is None else 4 + min(value, 2.4) for value in values],
            "text": ["" if value is None else _STATES.get(int(value), f"state {value:.0f}") for value in values],
            "line": {"shape": "hv", "width": 2},
            "hovertemplate": "%{text}",
        }
    ]


def _faults(rows: _Rows, board: BoardSeen, end: float) -> list[Trace]:
    """Return a bar for each time that a fault was there."""
    out: list[Trace] = []
    for span in board.faults:
        until = end if span.end is None else span.end
        out.append(
            {
                "type": "scatter",
                "mode": "lines+markers",
                "showlegend": False,
                "name": span.name,
                "x": rows.times((span.start, until)),
                "y": [span.name, span.name],
                "line": {"width": 9, "color": "#d62828"},
                "marker": {"size": 3, "color": "#d62828"},
                "hovertemplate": f"{until - span.start:.3f} s"
                + (", still there at the end" if span.end is None else ""),
            }
        )
    return out


def _balancing(rows: _Rows, board: BoardSeen) -> list[Trace]:
    columns: list[tuple[float, Counter[str] | None]] = [*board.balancing.columns()]
    cells = sorted({int(name) for _, column in columns for name in column or () if name != "replies"})
    if not cells:
        return []
    begins = [begin for begin, _ in columns]
    usual = max(board.balancing.length, longest_step(begins) / LONGER, (begins[-1] - begins[0]) / _PIXELS)
    for place in reversed(gaps(begins)):  # what is next to nothing must not be drawn as wide as that
        width = min(usual, (begins[place + 1] - begins[place]) / 3)
        columns[place + 1 : place + 1] = [(begins[place] + width, None), (begins[place + 1] - width, None)]
    numbers = list(range(1, max(cells) + 1))
    return [
        {
            "type": "heatmap",
            "name": "balancing",
            "showlegend": False,
            "x": rows.times(begin + board.balancing.length / 2 for begin, _ in columns),
            "y": numbers,
            "z": [
                [column and column[str(cell)] / max(1, column["replies"]) for _, column in columns] for cell in numbers
            ],
            "zmin": 0,
            "zmax": 1,
            "colorscale": [[0, "rgba(42,157,143,0)"], [1, "rgb(42,157,143)"]],
            "showscale": False,
            "hovertemplate": "cell %{y}: %{z:.0%} of the time",
        }
    ]


def _escaped(text: str) -> str:
    """Return text that plotly.js, which reads some markup in labels, shows as it is."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
