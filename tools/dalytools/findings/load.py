# SPDX-License-Identifier: GPL-2.0-or-later
"""Whether the load stepped between two replies that contradict each other: the next reply with a current tells.

    91: 3290..3310 mV | the load steps here | 95: 3250..3270 mV, contradicts 91 | 90: 30 A, it was 0 A -> no finding

The rule of both readings (docs/records.md 11) looks back only.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dalyref.values import Fields

STEP_A = 1.0
"""Currents further apart are another load (docs/records.md 11)."""
_MOST_HELD, _MOST_BOARDS, _MOST_STEPS = 256, 1024, 256

Board = tuple[str, int | None, int | None]


@dataclass(frozen=True, slots=True)
class Held:
    """A contradiction that waits for the next current: its name, packet and time, the other packet."""

    name: str
    packet: int
    time_ns: int
    other: str


@dataclass(slots=True)
class _Known:
    amperes: float | None = None
    state: object = None
    told_in: int = 0
    """Packet of the newest current."""
    steps: deque[tuple[int, int]] = field(default_factory=lambda: deque[tuple[int, int]](maxlen=_MOST_STEPS))
    """Packets of two currents in a row that are of another load."""


class Load:
    """Holds contradictions of voltages, by board, until they can be judged."""

    def __init__(self) -> None:
        self._known: dict[Board, _Known] = {}
        self._held: dict[Board, list[Held]] = {}

    def judged(self, board: Board, packet: int, fields: Fields) -> list[Held]:
        """Take a reply of a board; return contradictions before it that no step of the load explains.

        One of nothing but zeros, as from a board that just woke, says nothing of the load.
        """
        data = fields.get("daly.data")
        if isinstance(data, str) and not data.strip("0"):
            return []
        if board not in self._known and len(self._known) >= _MOST_BOARDS:
            return []
        known = self._known.setdefault(board, _Known())
        amperes, state = fields.get("daly.pack.current"), fields.get("daly.state")
        out: list[Held] = []
        held = self._held.get(board)
        if held:
            if state is not None and known.state is not None and state != known.state:
                held = []
            elif isinstance(amperes, float) and known.amperes is not None:
                out, held = ([] if abs(amperes - known.amperes) > STEP_A else held), []
            self._held[board] = held
        if isinstance(amperes, float):
            if known.amperes is not None and abs(amperes - known.amperes) > STEP_A:
                known.steps.append((known.told_in, packet))
            known.amperes, known.told_in = amperes, packet
        if state is not None:
            known.state = state
        return out

    def stepped(self, board: Board, packet: str) -> bool:
        """Tell whether a packet stands between two currents of another load: what is held against it is explained."""
        known = self._known.get(board)
        return known is not None and any(first < int(packet) < last for first, last in known.steps)

    def hold(self, board: Board, held: Held) -> bool:
        """Keep one until the next current; False where that says nothing: it stands at once."""
        known = self._known.get(board)
        waiting = self._held.setdefault(board, []) if known is not None else []
        if known is None or known.amperes is None or len(waiting) >= _MOST_HELD:
            return False
        waiting.append(held)
        return True

    def rest(self) -> list[tuple[Board, Held]]:
        """Return what waits at the end of the capture: nothing explains it."""
        return [(board, held) for board, waiting in self._held.items() for held in waiting]
