# SPDX-License-Identifier: GPL-2.0-or-later
"""What a piece of a stream can be (docs/records.md, sections 2 to 4)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final


class Kind(StrEnum):
    """The values of ``daly.kind``."""

    FRAME = "frame"
    BAD_CHECKSUM = "bad_checksum"
    SHORT = "short"
    JUNK = "junk"
    FOREIGN = "foreign"
    EVENT = "event"


DAMAGED: Final = (Kind.BAD_CHECKSUM, Kind.SHORT, Kind.JUNK)
"""Where frames may have been lost."""


class Dialect(StrEnum):
    """The values of ``daly.dialect`` on a serial line."""

    A5 = "a5"
    D2 = "d2"
    P81 = "81"


@dataclass(slots=True)
class Record:
    """A piece of a stream. The records of a stream, in order, put together, are the stream.

    Not to be changed; frozen, it would cost four times as much to make.
    """

    start: int
    """Offset of the first byte in the stream."""
    data: bytes
    kind: Kind
    dialect: Dialect | None = None
    """Of a frame, and of a bad_checksum (always A5)."""
    foreign: str = ""
    """What a foreign record is: ``Modbus RTU``, ``Sinowealth``, ``Pylontech RS485``, ``JBD``, ``Bluetooth module``."""
