# SPDX-License-Identifier: GPL-2.0-or-later
"""What the capture tells its screen, a message each: how it goes, and keys."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Final, cast

LARGEST: Final = 16384  # bytes of a message


@dataclass(slots=True)
class Status:
    """How the capture goes: what a file has, and what none has."""

    port: str = ""
    baud: int = 0
    file: str = ""
    seconds: float = 0.0
    records: int = 0
    marks: int = 0
    written: int = 0
    """Bytes, over all files."""
    lost: int = 0
    """Records that no file has, and bytes lost before us."""
    away: list[str] = field(default_factory=list[str])
    """Ports that are waited for."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key that was pressed: a character, or ``left``, ``right``."""

    name: str


def pack(message: Status | Key) -> bytes:
    """Lay out a message."""
    return json.dumps(asdict(message)).encode()


def unpack(data: bytes) -> Status | Key:
    """Read a message; it is from the capture beside us, of the same version."""
    found = cast("dict[str, Any]", json.loads(data))
    return Key(**found) if {each.name for each in fields(Key)} == found.keys() else Status(**found)
