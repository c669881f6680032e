# SPDX-License-Identifier: GPL-2.0-or-later
"""What a capture was, when it is over: a paragraph for people, JSON for programs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from dalyref.kinds import Kind
from dalytools import __version__
from dalytools.terminal_text import counted
from dalytools.whole_file import whole_file

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dalycapture.tally import SideTally, Tally


def summary(tally: Tally, ports: str, output: str, baud: int) -> str:
    """Say in a paragraph what was heard, and what it looks like when it looks wrong."""
    kinds = tally.kinds
    parts = [f"{tally.good} good"]
    for kind, name in (
        (Kind.BAD_CHECKSUM, "bad checksum"),
        (Kind.SHORT, "cut short"),
        (Kind.FOREIGN, "foreign"),
        (Kind.JUNK, "junk"),
    ):
        if kinds[kind]:
            parts.append(f"{kinds[kind]} {name}")
    where = "standard output" if output == "-" else output
    text = (
        f"{where}: {counted(tally.records, 'record')} ({', '.join(parts)}), {counted(tally.bytes, 'byte')} "
        f"in {tally.seconds:.1f} s from {ports} at {baud} baud; ended: {tally.end}."
    )
    if not tally.bytes:
        text += " Nothing was heard: is somebody talking on this bus, and is the adapter's receiver wired to A and B?"
    elif not tally.good and tally.bytes >= 26:
        text += " No good frame: wrong baud rate, or A and B swapped? dalyshark capture --detect PORT tells more."
    if tally.marks:
        text += f" {counted(tally.marks, 'mark')} of yours."
    if tally.clock_steps:
        text += f" The wall clock was set {counted(tally.clock_steps, 'time')}."
    return " ".join([text, *(sentence for side in tally.sides for sentence in side_sentences(side)), *tally.notes])


def side_sentences(side: SideTally) -> list[str]:
    """Say how sure the times are, and what was wrong with the line and the port."""
    said: list[str] = []
    if side.records:
        half, most = side.bounds.quantile_ms(0.5), side.bounds.quantile_ms(0.99)
        said.append(f"{side.name}: times are within {half:.2f} ms (half of them), {most:.2f} ms (99 of 100).")
    if side.contradictory * 20 > side.records:
        said.append(
            f"{side.contradictory} times are doubtful: the sender pauses within frames, is faster than the baud rate, "
            "or the adapter holds bytes back longer than is known."
        )
    counts = str(side.counts) if side.counts else ""
    if side.marked or side.breaks or counts:
        marks = f"{counted(side.marked, 'byte')} and {counted(side.breaks, 'break')} marked"
        said.append(f"Line errors at {side.name}: {marks}; the driver counts {counts or 'none'}.")
    if side.gaps:
        longest = max(side.gaps_s)
        back = ", and was not back at the end" if side.away else ""
        said.append(f"{side.name} was away {counted(side.gaps, 'time')}, for {longest:.1f} s at most{back}.")
    return said


def write_statistics(path: str, tally: Tally, more: Mapping[str, Any]) -> None:
    """Write the tally as JSON, whole or not at all. Raises Problem."""
    with whole_file(path) as out:
        json.dump({"program": f"dalyshark {__version__}", **more, **tally.as_json()}, out, indent=2)
        out.write("\n")
