# SPDX-License-Identifier: GPL-2.0-or-later
"""Which bytes of an ATT packet are kept, which are a board's, and which are blanked (docs/wires.md, 3).

    0A handle                                 asks: kept
    09 size | handle, properties, handle, UUID ...   characteristics (2803): kept, for they tell which are Daly's
    0B value                                  a name, a number, anything: blanked
    52 handle | value      1B handle | value  of Daly's attributes: the bytes of the board's line

Where the capture does not hold the discovery, the values of all attributes are read as a board's: what is no frame in
them is blanked.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, auto
from typing import Final

from dalytools.wires.bluetooth import short_uuid

_KEPT: Final = frozenset(
    (0x01, 0x02, 0x03, 0x04, 0x05, 0x07, 0x08, 0x0A, 0x0C, 0x0E, 0x10, 0x11, 0x13, 0x18, 0x19, 0x1E)
)
_FIND_INFORMATION_RESPONSE, _READ_BY_TYPE, _READ_BY_TYPE_RESPONSE = 0x05, 0x08, 0x09
_FIND_BY_VALUE: Final = 0x06
_WRITES: Final = frozenset((0x12, 0x52))
_NOTICES: Final = frozenset((0x1B, 0x1D))
_HEADS: Final = {0x06: 7, 0x09: 2, 0x16: 5, 0x17: 5, 0x12: 3, 0x52: 3, 0xD2: 3, 0x1B: 3, 0x1D: 3}
"""Bytes, from the first, that say what a packet is about."""
_CHARACTERISTIC: Final = 0x2803
_SERVICE: Final = b"\x00\x28"
_DALYS: Final = frozenset((0xFFF1, 0xFFF2, 0xFF01, 0xFF02))
_MOST_HANDLES: Final = 256
_SWITCHES: Final = (b"\x00\x00", b"\x01\x00", b"\x02\x00")
"""What is written to have notifications or not."""


class Fate(Enum):
    """What becomes of bytes."""

    KEPT = auto()
    BLANKED = auto()
    SENT = auto()
    """Of the line, from the host."""
    RECEIVED = auto()
    """Of the line, from the board."""


@dataclass(slots=True)
class Attributes:
    """What is known of the attributes of one connection."""

    handles: set[int] = field(default_factory=set[int])
    """Of Daly's values."""
    _asks_characteristics: bool = False

    def fates(self, pdu: bytes) -> list[tuple[int, Fate]]:
        """Return what becomes of the bytes of an ATT packet: (how many, what), in order."""
        opcode = pdu[0] if pdu else 0
        size = len(pdu)
        head = min(_HEADS.get(opcode, 1), size)
        rest = size - head
        if opcode in _KEPT:
            if opcode == _READ_BY_TYPE:
                self._asks_characteristics = short_uuid(pdu[5:]) == _CHARACTERISTIC
            elif opcode == _FIND_INFORMATION_RESPONSE and size > 1:
                self._found(pdu[2:], 2, {1: 2, 2: 16}.get(pdu[1], 0))
            return [(size, Fate.KEPT)]
        if opcode in _WRITES or opcode in _NOTICES:
            handle = int.from_bytes(pdu[1:3], "little")
            if opcode in _WRITES and pdu[3:] in _SWITCHES:
                return [(size, Fate.KEPT)]
            if self.handles and handle not in self.handles:
                return [(head, Fate.KEPT), (rest, Fate.BLANKED)]
            return [(head, Fate.KEPT), (rest, Fate.SENT if opcode in _WRITES else Fate.RECEIVED)]
        if opcode == _READ_BY_TYPE_RESPONSE and size > 1:
            if self._asks_characteristics and pdu[1] in (7, 21):
                self._characteristics(pdu)
                return [(size, Fate.KEPT)]
            return [(head, Fate.KEPT), *_values(pdu[1], rest)]
        if opcode == _FIND_BY_VALUE and pdu[5:7] == _SERVICE:
            return [(size, Fate.KEPT)]
        return [(head, Fate.KEPT), (rest, Fate.BLANKED)]

    def _characteristics(self, pdu: bytes) -> None:
        step = pdu[1]
        for at in range(2, len(pdu) - step + 1, step):
            self._found(pdu[at + 3 : at + step], 2, step - 5)

    def _found(self, pairs: bytes, handle_size: int, uuid_size: int) -> None:
        """Take (handle, UUID) pairs: note whose an attribute is; a later discovery is right."""
        step = handle_size + uuid_size
        if not uuid_size:
            return
        for at in range(0, len(pairs) - step + 1, step):
            handle = int.from_bytes(pairs[at : at + handle_size], "little")
            uuid = pairs[at + handle_size : at + step]
            if short_uuid(uuid) not in _DALYS:
                self.handles.discard(handle)
            elif len(self.handles) < _MOST_HANDLES:
                self.handles.add(handle)


def _values(step: int, size: int) -> list[tuple[int, Fate]]:
    """Return the fates of (handle, value) pairs of `step` bytes: the handles are kept."""
    out: list[tuple[int, Fate]] = []
    while size > 0:
        handle = min(2, size)
        value = max(0, min(step - 2, size - handle))
        out += [(handle, Fate.KEPT), (value, Fate.BLANKED)]
        size -= handle + value
    return out
