# SPDX-License-Identifier: GPL-2.0-or-later
"""Where a finding belongs: bus, board or address, data ID or register, and a detail where one rule needs it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from dalytools.record_lines import NAMES

if TYPE_CHECKING:
    from dalyref.decoder import Decoded
    from dalyref.values import Fields

REQUEST, REPLY, ECHO = 1, 2, 3


@dataclass(frozen=True, slots=True)
class Place:
    """Part of what a finding is about; what is not known, or does not matter, is left out."""

    bus: str = ""
    """Named only where a capture holds several."""
    board: int | None = None
    """1 to 16."""
    address: int | None = None
    """As sent: who was asked, or who answered, where that is no board."""
    data_id: int | None = None
    register: int | None = None
    """Of Modbus or HKMS."""
    detail: str = ""

    def __str__(self) -> str:
        parts = [self.bus] if self.bus else []
        if self.board is not None:
            parts.append(f"board {self.board}")
        elif self.address is not None:
            parts.append(f"address 0x{self.address:02X}")
        if self.data_id is not None:
            parts.append(f"0x{self.data_id:02X} {NAMES.get(self.data_id, '')}".rstrip())
        if self.register is not None:
            parts.append(f"register 0x{self.register:04X}")
        if self.detail:
            parts.append(self.detail)
        return ", ".join(parts) or "the capture"


def number(fields: Fields, name: str) -> int | None:
    """Return a field as a whole number, None where it is absent or something else."""
    value = fields.get(name)
    return value if isinstance(value, int) else None


def first_number(fields: Fields, *names: str) -> int | None:
    """Return the first of these fields that is there."""
    for name in names:
        value = number(fields, name)
        if value is not None:
            return value
    return None


def address_of(fields: Fields) -> int | None:
    """Return the address that a record carries: of the host for a request, of the board for a reply (A5, Modbus, CAN).

    A request on CAN names the board it goes to as its destination.
    """
    if "daly.can.source" in fields:
        asks = fields.get("daly.direction") == REQUEST
        return number(fields, "daly.can.destination" if asks else "daly.can.source")
    return first_number(fields, "daly.address", "daly.modbus.address")


def place_of(record: Decoded, bus: str = "", detail: str = "") -> Place:
    """Say where a record belongs."""
    fields = record.fields
    board = number(fields, "daly.board")
    return Place(
        bus,
        board,
        None if board is not None else address_of(fields),
        number(fields, "daly.data_id"),
        first_number(fields, "daly.modbus.register", "daly.can.register"),
        detail,
    )


def words(fields: Fields, name: str) -> list[str]:
    """Return all values of a field, as text."""
    value = fields.get(name, [])
    return [str(one) for one in value] if isinstance(value, list) else [str(value)]
