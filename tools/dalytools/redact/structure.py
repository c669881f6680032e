# SPDX-License-Identifier: GPL-2.0-or-later
"""What must be the same in the copy: which records there are, when, and which belongs to which.

A digest, so that a capture of any length needs no memory. Values are not in it: some of them were blanked.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Final

from dalyref.kinds import Kind

if TYPE_CHECKING:
    from dalyref.decoder import Decoded

_FIELDS: Final = (
    "daly.dialect",
    "daly.foreign",
    "daly.address",
    "daly.data_id",
    "daly.board",
    "daly.direction",
    "daly.retry",
    "daly.request_in",
    "daly.reply_in",
    "daly.unanswered",
    "daly.unasked",
    "daly.late_to",
    "daly.other_board",
    "daly.second_host",
    "daly.frame_number",
    "daly.burst.missing",
    "daly.burst.repeat",
    "daly.burst.cut_off",
    "daly.contradiction",
    "daly.changed",
    "daly.fault_raised",
    "daly.fault_cleared",
    "daly.modbus.function",
    "daly.modbus.ambiguous",
)

_LIKE: Final = frozenset((Kind.FRAME, Kind.FOREIGN))
"""Of Bluetooth and TCP: where packets divide other bytes, and when, depends on what they are (docs/wires.md, 4)."""


class Structure:
    """Takes the records of a capture, in order."""

    def __init__(self) -> None:
        self._digest = hashlib.blake2b()
        self._lines: dict[tuple[str, str], int] = {}  # by connection and direction: bytes so far
        self._of_lines = 0

    def add(self, record: Decoded) -> None:
        """Take the next record."""
        fields = record.fields
        told = (
            record.number,
            record.time_ns,
            record.kind.value,
            len(record.data),
            record.interface,
            record.connection,
            record.direction,
            [fields.get(name) for name in _FIELDS],
        )
        if not record.connection:
            self._digest.update(repr(told).encode())
            return
        line = record.connection, record.direction
        at = self._lines.get(line, 0)
        self._lines[line] = at + len(record.data)
        if record.kind in _LIKE:
            # Each line for itself, by a sum: which of two lines comes first may depend on such bytes as well.
            self._of_lines += int.from_bytes(hashlib.blake2b(repr((at, told)).encode()).digest())

    def digest(self) -> bytes:
        """Return what two captures of the same structure have alike, when all records are there."""
        self._digest.update(repr((self._of_lines, sorted(self._lines.items()))).encode())
        return self._digest.digest()
