# SPDX-License-Identifier: GPL-2.0-or-later
"""What was put into the traffic: for whoever tests a reader of it.

One object a happening, in order of time (seconds from the first moment of the bus)::

    what            happened                                            with
    unanswered      a request got no good reply                         host, address, board, data_id or register, why
    late            a reply begins later than the host would wait       board, data_id, delay_s (waits for the line)
    echo            a sleeping board gave a request back                address, data_id
    zero_reply      a reply of nothing after waking up                  board, data_id
    damaged         a frame was damaged on the wire                     sender, how, sent, heard
    collision       two stations spoke at once                          senders, heard, harmed (whether a byte was)
    cut_burst       a board stopped in the middle of a burst            board, data_id, sent, of
    skipped_frame, repeated_frame    in a burst                         board, data_id, frame
    other_board     a board answered what another was asked             board, asked, data_id
    contradiction   a reply says what others do not                     board, name, data_id
    write           a host wrote something                              host, dialect, data_id or register, result ..
    fault_set, fault_unset          in the board                        board, name
    fault_present   in the first fault reply of a board                 board, name, dialect
    fault_raised, fault_cleared     first seen on the wire so           board, name, dialect
    asleep, awake                                                       board
    foreign         somebody else spoke                                 name
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from dalytools.simulator.scenario import Scenario

KINDS = (
    "unanswered",
    "late",
    "echo",
    "zero_reply",
    "damaged",
    "collision",
    "cut_burst",
    "skipped_frame",
    "repeated_frame",
    "other_board",
    "contradiction",
    "write",
    "fault_set",
    "fault_unset",
    "fault_present",
    "fault_raised",
    "fault_cleared",
    "asleep",
    "awake",
    "foreign",
)

Fact = str | int | float | bool | None | list[str]


class Truth:
    """Takes notes. ``on`` False (nobody asked) keeps none, so that a bus may run for days."""

    def __init__(self, *, on: bool = False) -> None:
        self.on = on
        self.notes: list[dict[str, Fact]] = []

    def note(self, time_ns: int, what: str, **facts: Fact) -> None:
        """Write one down. time_ns: of the bus."""
        if self.on:
            self.notes.append({"time": time_ns / 1e9, "what": what, **facts})

    def write(self, out: TextIO, scenario: Scenario, *, wire: str, end_ns: int) -> None:
        """Write all of it as JSON: what the scenario was, how many of each kind, and each.

        A request that was still waiting within a second of the end (``open``) can not be told from the capture.
        """
        notes = sorted(self.notes, key=_seconds)
        for note in notes:
            if note["what"] == "unanswered" and _seconds(note) + 1.1 > end_ns / 1e9:
                note["open"] = True
        counts = {what: n for what in KINDS if (n := sum(note["what"] == what for note in notes))}
        head = {
            "about": scenario.about,
            "story": scenario.story,
            "seed": scenario.seed,
            "wire": wire,
            "seconds": end_ns / 1e9,
            "boards": [board.number for board in scenario.boards],
            "counts": counts,
        }
        out.write(json.dumps(head)[:-1] + ', "notes": [')
        out.write(",".join("\n" + json.dumps(note) for note in notes))
        out.write("\n]}\n")


def _seconds(note: dict[str, Fact]) -> float:
    time = note["time"]
    return time if isinstance(time, float) else 0.0
