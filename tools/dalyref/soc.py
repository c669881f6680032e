# SPDX-License-Identifier: GPL-2.0-or-later
"""The state of charge as A5 and as Modbus tell it, of one board (docs/wires.md, section 1).

90 from 03    <-- 1 %, 10 s -->    Modbus from 53
90 from any   <-- 1 %, 10 s -->    Modbus from D2, which names no board: where one board alone speaks A5
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from dalyref.modbus_frame import D2
from dalyref.values import add

if TYPE_CHECKING:
    from dalyref.board import Seen
    from dalyref.options import Options
    from dalyref.values import Fields

_BOARDS = range(0x01, 0x11)


class _Told(NamedTuple):
    seen: Seen
    raw: int
    """0.1 %."""
    order: int


class StatesOfCharge:
    """Of one bus."""

    def __init__(self, options: Options) -> None:
        """Begin with nothing known."""
        self._age_ns = options.limit_ns(options.age)
        self._tolerance = options.soc_tolerance * 10
        self._speaks_a5: set[int] = set()
        self._a5: dict[int, _Told] = {}  # by address byte of 90
        self._modbus: dict[int, _Told] = {}  # by address of replies
        self._order = 0

    def replied(self, address: int) -> None:
        """Note an A5 reply, of any ID."""
        if address in _BOARDS:
            self._speaks_a5.add(address)

    def told_by_a5(self, seen: Seen, address: int, raw: int, fields: Fields) -> None:
        """Take the SOC (0.1 %) of a 90, whose address has been noted."""
        if address not in _BOARDS:
            return
        addresses = (0x50 + address, D2) if self._speaks_a5 == {address} else (0x50 + address,)
        others = [self._modbus[other] for other in addresses if other in self._modbus]
        mine = self._take(self._a5, seen, address, raw)
        if others:
            self._compare(mine, max(others, key=lambda told: told.order), fields)

    def told_by_modbus(self, seen: Seen, address: int, raw: int, fields: Fields) -> None:
        """Take the SOC (0.1 %) of a Modbus reply."""
        mine = self._take(self._modbus, seen, address, raw)
        board = address - 0x50
        if address == D2:
            if len(self._speaks_a5) != 1:
                return
            (board,) = self._speaks_a5
        if board in self._a5:
            self._compare(mine, self._a5[board], fields)

    def _take(self, into: dict[int, _Told], seen: Seen, address: int, raw: int) -> _Told:
        self._order += 1
        into[address] = told = _Told(seen, raw, self._order)
        return told

    def _compare(self, mine: _Told, theirs: _Told, fields: Fields) -> None:
        if mine.seen.start_ns - theirs.seen.end_ns <= self._age_ns and abs(mine.raw - theirs.raw) > self._tolerance:
            add(fields, "daly.contradiction", "soc")
            add(fields, "daly.contradicts", theirs.seen.number)
