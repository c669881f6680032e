# SPDX-License-Identifier: GPL-2.0-or-later
"""Replies of a board that are nothing but zeros, in a row: after waking up it sends some (field notes b, sleep).

    97 zeros (no cell is balanced: perhaps) | 98 zeros (no fault: perhaps) | 90 zeros: 0 V, none of them was true

What may be true waits until a reply comes that can't be, or one that is not zero. Right behind a reply that is not zero
it is true, if the board then pauses: it did not sleep in between.

    95: 3.3 V | 97 zeros, 98 zeros: true | the others have their turn, it sleeps and wakes | 90 zeros
"""

from __future__ import annotations

from dataclasses import dataclass, field

_NEVER_ZERO = frozenset((0x90, 0x91, 0x94, 0x95))
"""Of these eight bytes of zero say what can't be: 0 V, cell number 0, no cells, frame number 0."""
_NUMBERED = frozenset((0x95, 0x96))
"""Of these zeros behind the frame number may be slots that are not used."""
_CELLS = 0x95
_ZERO = "00" * 8
_MOST_WAITING = 64
_PAUSE_NS = 2_000_000_000
"""In less nobody presses a button, or turns a key, on a board that has just fallen asleep."""
_FELL_SILENT = 2
"""So many unanswered requests, and what was zero before them is not of the same waking up."""


@dataclass(slots=True)
class ZeroRun:
    """The newest replies of one board."""

    waiting: list[tuple[int, int]] = field(default_factory=list[tuple[int, int]])
    """Packet and time of zeros that may be true."""
    proven: bool = False
    """One that can't be true was among them."""
    hidden: set[str] = field(default_factory=set[str])
    """Faults that seemed to go with these zeros."""
    kept: set[str] = field(default_factory=set[str])
    """The same of proven zeros that are over: they were there all the time, until a fault reply says otherwise."""
    told: bool = False
    """The board has said which faults it has."""
    _perhaps_told: bool = False
    _unanswered: int = 0
    _answers: set[object] = field(default_factory=set[object])
    _newest_ns: int = 0
    _cells_from_zero: bool = False
    """Its newest reply was number 0 of the cells."""
    _awake: bool = False
    """It has made no pause since a reply that is not zero."""

    @property
    def running(self) -> bool:
        """Whether the newest reply was of zeros."""
        return self.proven or bool(self.waiting)

    def replies_at(self, time_ns: int) -> set[str]:
        """Take note of when a reply comes, before the reply; return faults that went for sure before a pause."""
        paused = time_ns - self._newest_ns > _PAUSE_NS
        self._newest_ns = time_ns
        went = self.end() if paused and self._awake and not self.proven else set[str]()
        self._awake = self._awake and not paused
        return went

    def hide(self, cleared: set[str]) -> None:
        """Take note of a fault reply of zeros: no fault is set, if that is true."""
        self.hidden |= cleared
        self._perhaps_told = True

    def unanswered(self, data_id: object, time_ns: int) -> set[str]:
        """Take note of an unanswered request; return faults that went for sure.

        What it never answers says nothing, and makes no pause of the time that the asking takes.
        """
        if data_id not in self._answers:
            if time_ns - self._newest_ns <= _PAUSE_NS:
                self._newest_ns = time_ns
            return set()
        self._unanswered += 1
        if self._unanswered < _FELL_SILENT:
            return set()
        self._awake = False
        return set() if self.proven else self.end()

    def end(self) -> set[str]:
        """Take note of a reply that is not zero; return faults that went for sure."""
        went, self.hidden = self.hidden, set[str]()
        if self.proven:
            self.kept |= went
            went = set[str]()
        elif self._perhaps_told:
            self.told = True
            went |= self.kept
            self.kept = set[str]()
        self._perhaps_told = False
        self.proven = False
        self.waiting.clear()
        return went

    def state(self, *, zero: bool) -> bool:
        """Take a reply of the same board in Modbus that tells its state, and whether that is zero; return the same."""
        self._unanswered = 0
        self.proven = self.proven or zero
        self._awake = self._awake or not zero
        return zero

    def reply(self, data: str, data_id: object) -> bool | None:
        """Take a reply's eight bytes (hex): whether it is zero for sure. None: it may be true, and waits."""
        self._unanswered = 0
        self._answers.add(data_id)
        # All boards have a cell 1, which is in number 1 unless they count from 0.
        no_cell = data_id == _CELLS and data[:2] == "01" and not self._cells_from_zero
        self._cells_from_zero = data_id == _CELLS and data[:2] == "00"
        if data != _ZERO and not (data_id in _NUMBERED and data[2:] == _ZERO[2:]):
            self._awake = True
            return False
        if self.proven:
            return True
        if not no_cell and len(self.waiting) < _MOST_WAITING and (data != _ZERO or data_id not in _NEVER_ZERO):
            return None
        self.proven = True
        return True
