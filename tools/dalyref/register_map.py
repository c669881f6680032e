# SPDX-License-Identifier: GPL-2.0-or-later
"""How the registers of a dialect are read (docs/protocol.md, d): ``registers_d2`` and ``registers_81`` have the tables.

A value whose registers are not all there is none. In a reply nor is one of which a register reads FFFF (the board does
not have it), but texts, where FF is padding, and numbers of two registers, which must both read so. In a write FFFF is
a value: only a board says that it has no register.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from dalyref import quantities
from dalyref.quantities import Meaning
from dalyref.values import put

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from dalyref.values import Fields

ABSENT = 0xFFFF
_LAST = 0xFFFF
"""The last register that can be named."""

Row: TypeAlias = tuple[int, int, str, Meaning]
"""First register, last register, field, meaning."""


# What a register stands for where it differs from the bytes of other wires.


def small(raw: bytes) -> int | None:
    """Give a number that is one byte on other wires; none above 255."""
    value = int.from_bytes(raw)
    return value if value <= 0xFF else None


def celsius(raw: bytes) -> int | None:
    """Give a temperature, C, sent with offset 40; none above 255."""
    value = small(raw)
    return None if value is None else value - 40


def celsius_of_sensor(raw: bytes) -> int | None:
    """Give a temperature in the same way; none where raw is 0 or FF too, which is no sensor."""
    return None if small(raw) in (0, 0xFF) else celsius(raw)


def milliamperes_not_0(raw: bytes) -> int | None:
    """Give a current, mA, sent with offset 30000; none where it is 0, for at rest boards tell 30000."""
    return int.from_bytes(raw) - 30000 if any(raw) else None


def backward(raw: bytes) -> str | None:
    """Give a text that is sent last character first."""
    sent = quantities.text(raw)
    return None if sent is None else sent[::-1]


_PADDED = (quantities.text, backward)


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """Where a dialect keeps what."""

    told: tuple[Row, ...]
    """Shown on replies to reads."""
    settings: tuple[Row, ...]
    """Shown on replies to reads, and on writes."""
    cells: tuple[int, ...]
    """Register of each cell, cell 1 first (mV)."""
    sensors: tuple[int, ...]
    """Register of each sensor, sensor 1 first (C + 40)."""
    cell_count: int
    sensor_count: int
    charge: int
    """SOC, 0.1 %."""
    faults: tuple[int, ...] = ()
    """The registers with the eight bytes of 98, low byte first."""
    commands: Mapping[int, str] | None = None
    """What a write does, whatever the value."""


@dataclass(frozen=True, slots=True)
class Registers:
    """Some registers in a row, with their values."""

    start: int
    data: bytes

    @property
    def count(self) -> int:
        """How many."""
        return len(self.data) // 2

    def __contains__(self, register: int) -> bool:
        return self.start <= register < self.start + self.count

    def raw(self, first: int, last: int) -> bytes | None:
        """Return the bytes of registers `first` to `last`; None where they are not all there."""
        if first not in self or last not in self:
            return None
        return self.data[2 * (first - self.start) : 2 * (last + 1 - self.start)]

    def value(self, register: int) -> int | None:
        """Return one register; None where it is not there, or reads FFFF."""
        raw = self.raw(register, register)
        value = ABSENT if raw is None else int.from_bytes(raw)
        return None if value == ABSENT else value

    def absent(self, table: RegisterMap) -> list[int]:
        """Return the numbers of the registers that read FFFF, but those that are part of a longer number.

        There are none behind FFFF, though a reply may have words for them.
        """
        there = range(min(self.count, _LAST + 1 - self.start))
        found = [self.start + at for at in there if self.data[2 * at : 2 * at + 2] == b"\xff\xff"]
        if not found:
            return found
        part: set[int] = set()
        for first, last, _, meaning in (*table.told, *table.settings):
            raw = self.raw(first, last) if first != last and meaning is quantities.number else None
            if raw is not None and not _lacks(raw, meaning):
                part.update(range(first, last + 1))
        return [register for register in found if register not in part]

    def named(self, rows: Iterable[Row], *, written: bool = False) -> Fields:
        """Return the values that the rows of a table name. written: as a host writes them, not as a board has them."""
        fields: Fields = {}
        for first, last, name, meaning in rows:
            raw = self.raw(first, last)
            if raw is None or (not written and _lacks(raw, meaning)):
                continue
            value = meaning(raw)
            if value is not None:
                fields["daly." + name] = value
        return fields


def _lacks(raw: bytes, meaning: Meaning) -> bool:
    """Tell whether a reply with these registers has not what they mean."""
    if meaning in _PADDED:
        return False
    lacking = [raw[at : at + 2] == b"\xff\xff" for at in range(0, len(raw), 2)]
    return all(lacking) if meaning is quantities.number else any(lacking)


def would_set(registers: Registers, table: RegisterMap) -> Fields:
    """Return what a write of these registers asks for."""
    fields = registers.named(table.settings, written=True)
    if table.commands:
        put(fields, "daly.command", [name for register, name in table.commands.items() if register in registers])
    return fields
