# SPDX-License-Identifier: GPL-2.0-or-later
"""Rules about what is right, and easily read wrongly: current-sign, stale-slots, absent-registers, read-short."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from dalyref.kinds import Kind
from dalytools.findings.finding import Tally
from dalytools.findings.place import REPLY, Place, address_of, first_number, number, place_of
from dalytools.findings.rules import found
from dalytools.findings.watch import Groups, Watch
from dalytools.terminal_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dalyref.decoder import Decoded
    from dalytools.findings.finding import Finding

_CHARGING, _DISCHARGING = 1, 2
_CLEAR_A = 1.0
"""A current below it may be noise around zero."""
_LEAST, _SHARE = 3, 0.9
"""So many readings, and this share of them, tell what the sign means: the load may step between 0x93 and 0x90."""
_CELLS = 0x95
_READ = 0x03
_MOST_SLOTS = 48
_ABSENT = 0xFFFF
_FEW, _ENOUGH, _GPS = 0x3E, 0x44, 0x57
"""Of D2: what many programs read (62 registers), what has all readings but cells 33 to 48, and where others begin."""


@dataclass(slots=True)
class _Sign:
    tally: Tally = field(default_factory=Tally)
    discharging: int = 0
    """Readings where above 0 A goes with discharging, or below 0 A with charging."""


@dataclass(slots=True)
class _Slots:
    tally: Tally = field(default_factory=Tally)
    cells: int = 0
    example: str = ""


@dataclass(slots=True)
class _Read:
    tally: Tally = field(default_factory=Tally)
    end: int = 0
    """The register behind the last one that was read."""


class Misread(Watch):
    """Counts, by board, what the sign of the current goes with, and cell slots that hold old bytes."""

    def __init__(self) -> None:
        self._signs = Groups(_Sign)
        self._slots = Groups(_Slots)
        self._absent = Groups(Tally)
        self._read = Groups(_Read)
        self._cells: dict[tuple[str, int | None], int] = {}

    def record(self, record: Decoded, bus: str) -> None:
        """See one reply."""
        fields = record.fields
        if record.kind is not Kind.FRAME or fields.get("daly.direction") != REPLY:
            return
        board = bus, number(fields, "daly.board")
        self._registers(record, bus)
        cells = number(fields, "daly.cell_count")
        if cells is not None and 0 < cells <= _MOST_SLOTS and len(self._cells) < 4096:
            self._cells[board] = cells
        if number(fields, "daly.data_id") == _CELLS and board in self._cells:
            self._slot(record, bus, self._cells[board])
        amperes = fields.get("daly.pack.current")
        state = first_number(fields, "daly.pack.state", "daly.state")
        if isinstance(amperes, float) and abs(amperes) >= _CLEAR_A and state in (_CHARGING, _DISCHARGING):
            sign = self._signs[_board(record, bus)]
            sign.tally.add(record.number, record.time_ns)
            sign.discharging += (amperes > 0) == (state == _DISCHARGING)

    def _registers(self, record: Decoded, bus: str) -> None:
        """Look at a reply to a read: registers that are not there read FFFF (field notes d)."""
        fields = record.fields
        start, count = number(fields, "daly.modbus.register"), number(fields, "daly.modbus.count")
        if start is None or count is None or number(fields, "daly.modbus.function") != _READ:
            return
        values = fields.get("daly.modbus.value")
        if set(values if isinstance(values, list) else [values]) == {_ABSENT}:
            self._absent[place_of(record, bus, f"{count} of them")].add(record.number, record.time_ns)
        if fields.get("daly.dialect") == "d2" and start < _GPS:
            read = self._read[_board(record, bus)]
            read.tally.add(record.number, record.time_ns)
            read.end = max(read.end, start + count)

    def _slot(self, record: Decoded, bus: str, cells: int) -> None:
        """Look at the slots behind the last cell: zeros and FF are fillers, all else is left from before."""
        frame, reserved = number(record.fields, "daly.frame_number"), record.fields.get("daly.reserved")
        if frame is None or not isinstance(reserved, str):
            return
        left = bytes.fromhex(reserved)[:-1]  # the last byte is no slot's
        values = [int.from_bytes(left[at : at + 2]) for at in range(0, len(left) - 1, 2)]
        if not any(value not in (0, 0xFFFF) for value in values):
            return
        slots = self._slots[place_of(record, bus)]
        slots.tally.add(record.number, record.time_ns)
        slots.cells = cells
        if not slots.example:
            slots.example = f"packet {record.number}: {' '.join(map(str, values))} mV behind the last cell"

    def findings(self) -> Iterator[Finding]:
        """Say what the sign of the current means on each board, and how many slots are no cells."""
        for place, sign in self._signs.items():
            share = sign.discharging / max(1, sign.tally.count)
            if sign.tally.count < _LEAST or 1 - _SHARE < share < _SHARE:
                continue
            meaning, agree = ("discharging", sign.discharging) if share >= _SHARE else ("charging", 0)
            agree = agree or sign.tally.count - sign.discharging
            text = (
                f"a current above 0 A means {meaning} on this board: "
                f"so in {agree} of {counted(sign.tally.count, 'reading')}, by the state that the board reports"
            )
            yield found("current-sign", place, sign.tally, text)
        for place, tally in self._absent.items():
            text = (
                f"{counted(tally.count, 'reply', 'replies')} of nothing but FFFF: they are not there on this "
                "board, or not in this dialect"
            )
            yield found("absent-registers", place, tally, text)
        for place, read in self._read.items():
            if _FEW <= read.end < _ENOUGH:
                text = (
                    f"nobody reads behind register {read.end - 1:04X}: balance current is in 0040, temperatures of MOS "
                    "and board in 0042 and 0043, cells 33 to 48 from 0047 on"
                )
                yield found("read-short", place, read.tally, text)
        for place, slots in self._slots.items():
            text = (
                f"the board has {slots.cells} cells; what stands in slot {slots.cells + 1} and behind is left from an "
                f"earlier reply, no cell: {counted(slots.tally.count, 'frame')}"
            )
            yield found("stale-slots", place, slots.tally, text, examples=(slots.example,))


def _board(record: Decoded, bus: str) -> Place:
    """Say whose values they are, whichever request brought them."""
    board = number(record.fields, "daly.board")
    return Place(bus, board, None if board is not None else address_of(record.fields))
